// Maps of materials: what they hold, how they are looked up and resampled, and what UVs are fit for.
#include <gtest/gtest.h>

#include "patina/asset/material_maps.h"
#include "patina/image/color.h"
#include "support.h"
#include "tiny_gltf.h"

namespace patina::asset {
namespace {

using test::gradient_image;
using test::TemporaryFolder;
using test::TinyGltf;

Map map_of(Image texels, Wrap wrap_s = Wrap::kRepeat, Wrap wrap_t = Wrap::kRepeat) {
  Map map;
  map.texels = std::move(texels);
  map.wrap_s = wrap_s, map.wrap_t = wrap_t;
  return map;
}

TEST(MaterialMaps, multiply_factors_and_decode_srgb) {
  TinyGltf g = TinyGltf::quad();
  g.add_image(gradient_image(3, 2, 4));
  g.json["materials"][0] = {{"alphaMode", "BLEND"},
                            {"pbrMetallicRoughness",
                             {{"baseColorTexture", {{"index", 0}}},
                              {"baseColorFactor", {0.5, 1, 0.25, 0.5}},
                              {"metallicRoughnessTexture", {{"index", 0}}},
                              {"metallicFactor", 0.5}}},
                            {"normalTexture", {{"index", 0}, {"scale", 2}}},
                            {"emissiveTexture", {{"index", 0}}},
                            {"emissiveFactor", {1, 0.5, 0}}};
  const TemporaryFolder folder;
  const Asset asset = read_asset(g.write_glb(folder.path()));
  const MaterialMaps maps = resolve_materials(asset)[0];
  const Image& image = asset.images[0];
  for (int y = 0; y < 2; ++y)
    for (int x = 0; x < 3; ++x) {
      const float* s = image.at(x, y);
      EXPECT_NEAR(maps.base_color.texels.at(x, y)[0], 0.5f * linear_from_srgb(s[0]), 1e-6f);
      EXPECT_NEAR(maps.base_color.texels.at(x, y)[2], 0.25f * linear_from_srgb(s[2]), 1e-6f);
      EXPECT_NEAR(*maps.alpha.texels.at(x, y), 0.5f * s[3], 1e-6f);
      EXPECT_NEAR(*maps.roughness.texels.at(x, y), s[1], 1e-6f);
      EXPECT_NEAR(*maps.metallic.texels.at(x, y), 0.5f * s[2], 1e-6f);
      EXPECT_NEAR(maps.emission.texels.at(x, y)[1], 0.5f * linear_from_srgb(s[1]), 1e-6f);
      const vec3 n =
          glm::normalize(vec3(2 * (2 * s[0] - 1), 2 * (2 * s[1] - 1), std::max(2 * s[2] - 1, 1e-3f)));
      EXPECT_NEAR(glm::distance(maps.normal.texels.rgb(x, y), n), 0.0f, 1e-5f);
    }
}

TEST(MaterialMaps, slots_without_texture_are_one_texel) {
  TinyGltf g = TinyGltf::quad();
  g.json["materials"][0]["pbrMetallicRoughness"] = {{"baseColorFactor", {0.2, 0.4, 0.6, 1}},
                                                    {"roughnessFactor", 0.3}};
  const TemporaryFolder folder;
  const MaterialMaps maps = resolve_materials(read_asset(g.write_glb(folder.path())))[0];
  EXPECT_EQ(maps.base_color.texels.num_pixels(), 1u);
  EXPECT_EQ(sample3(maps.base_color, vec2(0.7f, 123.0f)), vec3(0.2f, 0.4f, 0.6f));
  EXPECT_EQ(sample1(maps.roughness, vec2(-5.0f, 0.0f)), 0.3f);
  EXPECT_EQ(sample3(maps.normal, vec2(0.0f)), vec3(0, 0, 1));
  EXPECT_EQ(sample3(maps.emission, vec2(0.0f)), vec3(0.0f));
}

TEST(BilinearTap, texel_centres_lie_at_one_half) {
  const Map map = map_of(gradient_image(4, 3, 1));
  for (int y = 0; y < 3; ++y)
    for (int x = 0; x < 4; ++x)
      EXPECT_NEAR(sample1(map, {(static_cast<float>(x) + 0.5f) / 4, (static_cast<float>(y) + 0.5f) / 3}),
                  *map.texels.at(x, y), 1e-5f);
  const float between = sample1(map, {2.0f / 4, 0.5f / 3});
  EXPECT_NEAR(between, 0.5f * (*map.texels.at(1, 0) + *map.texels.at(2, 0)), 1e-5f);
}

TEST(BilinearTap, wrap_modes_at_the_border) {
  const Image row = gradient_image(4, 1, 1);
  const auto value = [&](Wrap wrap, float u) {
    return sample1(map_of(row, wrap, Wrap::kClampToEdge), {u, 0.5f});
  };
  const float first = row.pixels[0], last = row.pixels[3];
  EXPECT_NEAR(value(Wrap::kRepeat, 0.0f), 0.5f * (first + last), 1e-6f);
  EXPECT_NEAR(value(Wrap::kClampToEdge, 0.0f), first, 1e-6f);
  EXPECT_NEAR(value(Wrap::kMirroredRepeat, 0.0f), first, 1e-6f);
  EXPECT_NEAR(value(Wrap::kRepeat, 1.125f), first, 1e-6f);
  EXPECT_NEAR(value(Wrap::kClampToEdge, 1.125f), last, 1e-6f);
  EXPECT_NEAR(value(Wrap::kMirroredRepeat, 1.125f), last, 1e-6f);
  EXPECT_NEAR(value(Wrap::kRepeat, -0.125f), last, 1e-6f);
  EXPECT_NEAR(value(Wrap::kMirroredRepeat, -0.125f), first, 1e-6f);
  EXPECT_NEAR(value(Wrap::kMirroredRepeat, -1.125f), last, 1e-6f);
}

TEST(BilinearTap, weights_sum_to_one_and_texels_exist_for_any_uv) {
  for (const Wrap wrap : {Wrap::kRepeat, Wrap::kClampToEdge, Wrap::kMirroredRepeat}) {
    const Map map = map_of(Image(5, 7, 1), wrap, wrap);
    for (const float u :
         {0.0f, 1.0f, -1.0f, 0.999999f, -1e-9f, 1e5f, -1e5f, 1e30f, -1e38f, INFINITY, -INFINITY, NAN}) {
      const BilinearTap tap = bilinear_tap(map, {u, -u});
      float sum = 0;
      for (size_t k = 0; k < 4; ++k) {
        sum += tap.weight[k];
        EXPECT_GE(tap.weight[k], 0.0f);
        EXPECT_GE(tap.texel[k], 0);
        EXPECT_LT(tap.texel[k], 35);
      }
      EXPECT_NEAR(sum, 1.0f, 1e-6f);
    }
  }
}

TEST(Resized, shrinking_keeps_the_mean_and_growing_keeps_a_ramp) {
  const Map map = map_of(gradient_image(12, 9, 3));
  for (const auto& [w, h] : {std::pair(4, 3), std::pair(5, 7), std::pair(1, 1)}) {
    const Map small = resized(map, w, h);
    for (size_t c = 0; c < 3; ++c) {
      double before = 0, after = 0;
      for (size_t i = c; i < map.texels.pixels.size(); i += 3) before += map.texels.pixels[i];
      for (size_t i = c; i < small.texels.pixels.size(); i += 3) after += small.texels.pixels[i];
      EXPECT_NEAR(before / 108, after / (w * h), 1e-5);
    }
  }
  Image ramp(4, 1, 1);
  for (int x = 0; x < 4; ++x) *ramp.at(x, 0) = static_cast<float>(x);
  const Map grown = resized(map_of(ramp, Wrap::kClampToEdge, Wrap::kClampToEdge), 8, 2);
  for (int x = 1; x < 7; ++x)
    EXPECT_NEAR(*grown.texels.at(x, 1), 0.5f * static_cast<float>(x) - 0.25f, 1e-5f);
  EXPECT_EQ(resized(map, 12, 9).texels.pixels, map.texels.pixels);
}

UvState state_of(const std::vector<float>& uv, const std::vector<uint16_t>& corners) {
  TinyGltf g = TinyGltf::quad();
  g.primitive()["attributes"] = {
      {"POSITION", g.add_accessor(std::vector<float>(uv.size() / 2 * 3, 1.0f), 5126, "VEC3", uv.size() / 2)}};
  g.primitive()["attributes"]["TEXCOORD_0"] = g.add_accessor(uv, 5126, "VEC2", uv.size() / 2);
  g.primitive()["indices"] = g.add_accessor(corners, 5123, "SCALAR", corners.size());
  const TemporaryFolder folder;
  return uv_states(read_asset(g.write_glb(folder.path())))[0];
}

TEST(UvStates, a_whole_tile_is_covered_once) {
  const UvState s = state_of({0, 0, 1, 0, 1, 1, 0, 1}, {0, 1, 2, 0, 2, 3});
  EXPECT_FLOAT_EQ(s.covered, 1.0f);
  EXPECT_EQ(s.overlapping, 0.0f);  // the shared diagonal belongs to one side only
  EXPECT_EQ(s.mirrored, 0.0f);
  EXPECT_FALSE(s.missing);
}

TEST(UvStates, tiles_that_wrap_onto_each_other_overlap) {
  const UvState s = state_of({0, 0, 0.5f, 0, 0, 0.5f, 1, 0, 1.5f, 0, 1, 0.5f}, {0, 1, 2, 3, 4, 5});
  EXPECT_NEAR(s.covered, 0.125f, 1e-3f);
  EXPECT_FLOAT_EQ(s.overlapping, 1.0f);
  EXPECT_EQ(s.max, vec2(1.5f, 0.5f));
}

TEST(UvStates, mirrored_and_zero_area_triangles_are_counted) {
  const UvState s = state_of({0, 0, 0.25f, 0, 0, 0.25f, 0.5f, 0.5f}, {0, 1, 2, 0, 2, 1, 0, 1, 2, 3, 3, 3});
  EXPECT_FLOAT_EQ(s.mirrored, 0.25f);
  EXPECT_FLOAT_EQ(s.zero_area, 0.25f);
}

TEST(UvStates, far_and_huge_uvs_end_quickly) {
  const UvState s = state_of({-1e30f, 0, 1e30f, 0, 0, 1e30f, 0, 0, 9e4f, 0, 0, 9e4f}, {0, 1, 2, 3, 4, 5});
  EXPECT_EQ(s.max.x, 1e30f);
  EXPECT_FLOAT_EQ(s.covered, 1.0f);
}

TEST(UvStates, missing_uvs_are_told) {
  TinyGltf g = TinyGltf::quad();
  g.primitive()["attributes"].erase("TEXCOORD_0");
  const TemporaryFolder folder;
  EXPECT_TRUE(uv_states(read_asset(g.write_glb(folder.path())))[0].missing);
}

}  // namespace
}  // namespace patina::asset
