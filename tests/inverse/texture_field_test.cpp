// How a fitted map's change is stored, and how the light cache packs its lights.
#include <cmath>

#include <gtest/gtest.h>

#include "patina/asset/texel_raster.h"
#include "patina/base/random.h"
#include "patina/inverse/light_packing.h"
#include "patina/inverse/path_replay.h"
#include "patina/inverse/texture_field.h"
#include "worlds.h"

namespace patina::test {
namespace {

TEST(texture_field, restriction_is_the_adjoint_of_composition) {
  for (const auto wrap : {asset::Wrap::kRepeat, asset::Wrap::kClampToEdge, asset::Wrap::kMirroredRepeat}) {
    asset::Map map;
    map.wrap_s = wrap;
    map.wrap_t = asset::Wrap::kRepeat;
    inverse::TextureField field = inverse::make_field(map, 37, 20, 2);
    RandomStream random(1, RandomPurpose::kTest, 5);
    field.kinds.texels.resize(37 * 20);
    for (auto& shares : field.kinds.texels)
      for (size_t k = 0; k < shares.size(); ++k) shares[k] = {static_cast<uint16_t>(3 * k), random.uniform()};
    for (Image& level : field.levels)
      for (float& value : level.pixels) value = random.uniform() - 0.5f;
    field.edited = Image(37, 20, 1);
    for (float& value : field.edited.pixels) value = random.uniform();
    inverse::compose(field);
    Image y(37, 20, 2);
    for (float& value : y.pixels) value = random.uniform() - 0.5f;
    const std::vector<Image> adjoint = inverse::restrict_to_levels(field, y);
    double left = 0, right = 0;
    for (size_t i = 0; i < y.pixels.size(); ++i)
      left += static_cast<double>(field.delta.texels.pixels[i]) * y.pixels[i];
    for (size_t level = 0; level < adjoint.size(); ++level)
      for (size_t i = 0; i < adjoint[level].pixels.size(); ++i)
        right += static_cast<double>(adjoint[level].pixels[i]) * field.levels[level].pixels[i];
    EXPECT_NEAR(left, right, 1e-4 * (1 + std::abs(left)));
  }
}

TEST(texture_field, splatting_is_the_adjoint_of_sampling) {
  const World world = make_world(Lighting::kConstant, 8, 8);
  RandomStream random(1, RandomPurpose::kTest, 6);
  inverse::TexelGradients adjoint = inverse::zero_gradients(world.maps, 2);
  double left = 0;
  for (int k = 0; k < 200; ++k) {
    inverse::MaterialPoint point;
    point.material = static_cast<uint16_t>(k % 2);
    for (vec2& uv : point.uv) uv = 4.0f * random.uniform2() - 2.0f;
    const inverse::MapValues value = inverse::sample_maps(world.maps[point.material], point);
    const inverse::MapGradient w{vec3(random.uniform()), random.uniform(), random.uniform(),
                                 vec3(random.uniform(), 0.3f, -0.4f)};
    left += glm::dot(value.base_color, w.base_color) + value.roughness * w.roughness +
            value.metallic * w.metallic + glm::dot(value.normal, w.normal);
    inverse::splat(adjoint, world.maps[point.material], point, w);
  }
  double right = 0;
  for (size_t m = 0; m < 2; ++m)
    for (const asset::MapSlotRow& row : asset::kMapSlots) {
      const Image& texels = asset::slot_map(world.maps[m], row.slot).texels;
      const Image& gradient = adjoint.slots[m][index_of(row.slot)];
      for (size_t i = 0; i < texels.pixels.size(); ++i)
        right += static_cast<double>(texels.pixels[i]) * gradient.pixels[i];
    }
  EXPECT_NEAR(left, right, 1e-5 * std::abs(left));
}

TEST(texture_field, dilation_fills_from_the_nearest_and_stops) {
  asset::Map map;
  map.wrap_s = map.wrap_t = asset::Wrap::kClampToEdge;
  map.texels = Image(9, 1, 1, 7.0f);
  Image valid(9, 1, 1);
  valid.pixels[4] = 1.0f;
  map.texels.pixels[4] = 3.0f;
  const Image filled = asset::dilated(map, valid, 2);
  const std::vector<float> expected{0, 0, 3, 3, 3, 3, 3, 0, 0};
  EXPECT_EQ(filled.pixels, expected);
}

TEST(light_packing, keeps_direction_and_radiance) {
  RandomStream random(2, RandomPurpose::kTest, 1);
  for (int k = 0; k < 10000; ++k) {
    const float z = 2.0f * random.uniform() - 1.0f, phi = 6.2831853f * random.uniform();
    const vec3 d(std::sqrt(1 - z * z) * std::cos(phi), std::sqrt(1 - z * z) * std::sin(phi), z);
    ASSERT_LT(glm::length(inverse::unpack_direction(inverse::pack_direction(d)) - d), 1e-4f);
    const vec3 rgb = vec3(random.uniform(), random.uniform(), random.uniform()) *
                     std::exp2(40.0f * random.uniform() - 20.0f);
    const vec3 error = inverse::unpack_radiance(inverse::pack_radiance(rgb)) - rgb;
    ASSERT_LE(max_component(glm::abs(error)), 0.0041f * max_component(rgb));
  }
  EXPECT_EQ(inverse::unpack_radiance(inverse::pack_radiance(vec3(0.0f))), vec3(0.0f));
}

}  // namespace
}  // namespace patina::test
