// Composed samples: light against the path tracer, masks where their recipes say, the same sample for the
// same seed.
#include <cmath>

#include <ATen/ATen.h>
#include <gtest/gtest.h>

#include "make_dataset/bake.h"
#include "make_dataset/shapes.h"
#include "mini_data/compose.h"
#include "mini_data/fields.h"
#include "mini_data/shading.h"
#include "patina/asset/material_maps.h"
#include "patina/image/color.h"
#include "patina/render/path_tracer.h"
#include "patina/report/report.h"
#include "patina/views/view_set.h"
#include "support.h"

namespace patina::make_dataset {
namespace {

using namespace mini_data;

constexpr uint64_t kSeed = 5;
const char* const kKind = "kettle";

BakeOptions bake_options() {
  BakeOptions options;
  options.num_views = 1;
  options.azimuth_start = 0.4f;
  return options;
}

// One view of a kettle in the studio, baked once and sent through the shard's compression for all tests.
const Dataset& kettle_data() {
  static const Dataset data = [] {
    BakedObject baked =
        bake(finished(make_shape(kKind, kSeed).mesh), render::studio_environment(), bake_options());
    baked.object.name = "kettle", baked.object.words = {"kettle"}, baked.object.environment = "studio";
    const test::TemporaryFolder folder;
    write_shard(folder.path() / "kettle.shard", entries_of(baked));
    return read_dataset(folder.path(), Part::kAll);
  }();
  return data;
}
const Library& kettle_library() {
  static const auto library = make_library(kettle_data(), at::kCPU);
  return *library;
}

Image image_of(const at::Tensor& chw) {
  const at::Tensor hwc = chw.permute({1, 2, 0}).contiguous();
  Image out(static_cast<int>(hwc.size(1)), static_cast<int>(hwc.size(0)), static_cast<int>(hwc.size(2)));
  std::copy_n(hwc.data_ptr<float>(), out.pixels.size(), out.pixels.begin());
  return out;
}

struct Uniform {
  const char* name;
  vec3 srgb;
  float roughness, metallic;
};

// The product's own picture of the same object in one material.
Image path_traced(const Uniform& material, int side) {
  const Finished shape = finished(make_shape(kKind, kSeed).mesh);
  asset::Asset asset = shape.asset;
  for (int c = 0; c < 3; ++c) asset.materials[0].base_color_factor[c] = linear_from_srgb(material.srgb[c]);
  asset.materials[0].roughness_factor = material.roughness;
  asset.materials[0].metallic_factor = material.metallic;
  const render::Scene scene(asset, asset::resolve_materials(asset), render::studio_environment());
  views::OrbitOptions orbit;
  const BakeOptions baked = bake_options();
  orbit.num_views = 1, orbit.resolution = side, orbit.elevations = {baked.elevation};
  orbit.azimuth_start = baked.azimuth_start, orbit.fov_y = baked.fov_y;
  views::ViewOptions options;
  options.path.samples_per_pixel = 96;
  const auto set =
      views::render_views(scene, views::orbit_cameras({vec3(-1), vec3(1), 1.0f}, orbit), options, {});
  return views::tile_control(set.views[0], set.exposure_ev);
}

TEST(Compose, light_matches_the_path_tracer) {
  for (const Uniform& material :
       {Uniform{"clay", {0.75f, 0.5f, 0.35f}, 0.9f, 0.0f}, Uniform{"lacquer", {0.6f, 0.1f, 0.1f}, 0.2f, 0.0f},
        Uniform{"brass", {0.9f, 0.75f, 0.42f}, 0.35f, 1.0f}}) {
    Plan plan;
    plan.views = {0};
    plan.clean[0].color = material.srgb;
    plan.clean[0].roughness = material.roughness;
    plan.clean[0].metallic = material.metallic;
    plan.clean[1] = plan.clean[0];
    const Batch batch = compose(kettle_library(), std::span(&plan, 1));
    // Half the size: an eighth of the rays for the same noise, and the average of four pixels here.
    const Image composed = image_of(at::avg_pool2d(batch.tile, {2, 2})[0]);
    const Image mask = image_of(at::avg_pool2d(batch.coverage, {2, 2})[0]);
    const float psnr = report::psnr(composed, path_traced(material, kViewSide / 2), mask);
    RecordProperty(std::string("psnr_") + material.name, std::to_string(psnr));
    std::printf("%s: %.1f dB on the object\n", material.name, static_cast<double>(psnr));
    EXPECT_GE(psnr, 28.0f) << material.name;
  }
}

// Maps and light put together again outside of compose().
at::Tensor relit(const MaterialMaps& maps, const Plan& plan, float exposure_ev) {
  const std::vector<const Plan*> samples{&plan};
  const Fields fields = read_fields(kettle_library(), samples, {plan.views[0]}, 1);
  const at::Tensor world = rotated(fields.rotation, maps.normal.contiguous());
  const SurfaceValues surface{maps.base_color, maps.roughness, maps.metallic, {}, world - fields.normal};
  const at::Tensor light = std::exp2(exposure_ev) * shaded(kettle_library(), fields, surface, 1);
  const float backdrop = linear_from_srgb(views::kBackdropSrgb);
  return mini_data::srgb_from_linear(fields.coverage * (light / (1 + light)) +
                                     (1 - fields.coverage) * backdrop);
}

TEST(Compose, maps_of_a_sample_give_its_pictures_when_lit_again) {
  const Catalog catalog = catalog_of(kettle_data());
  for (uint64_t index = 0; index < 8; ++index) {
    const Plan plan = draw_plan(catalog, 31, index, {});
    const Batch batch = compose(kettle_library(), std::span(&plan, 1));
    const float ev = batch.exposure_ev[0];
    EXPECT_LT((relit(batch.clean, plan, ev) - batch.tile).abs().max().item<float>(), 2e-3f) << index;
    EXPECT_LT((relit(batch.aged, plan, ev) - batch.target).abs().max().item<float>(), 2e-3f) << index;
  }
}

// The renderer's own buffers of the same object are the truth for the camera's frame.
TEST(Compose, maps_of_one_plain_material_are_its_numbers_and_the_normals_of_the_renderer) {
  Plan plan;
  plan.views = {0};
  plan.clean[0].color = vec3(0.6f, 0.3f, 0.1f), plan.clean[0].roughness = 0.4f, plan.clean[0].metallic = 1;
  plan.clean[1] = plan.clean[0];
  const Batch batch = compose(kettle_library(), std::span(&plan, 1));
  const Finished shape = finished(make_shape(kKind, kSeed).mesh);
  const render::Scene scene(shape.asset, asset::resolve_materials(shape.asset), render::studio_environment());
  views::OrbitOptions orbit;
  const BakeOptions baked = bake_options();
  orbit.num_views = 1, orbit.resolution = kViewSide, orbit.elevations = {baked.elevation};
  orbit.azimuth_start = baked.azimuth_start, orbit.fov_y = baked.fov_y;
  const views::GBuffer gbuffer =
      views::make_gbuffer(scene, views::orbit_cameras({vec3(-1), vec3(1), 1.0f}, orbit)[0]);
  const mat3& world_from_camera = kettle_data().objects[0].views[0].world_from_camera;
  const Image normal = image_of(batch.clean.normal[0]);
  double cosines = 0;
  int count = 0;
  for (int y = 0; y < kViewSide; ++y)
    for (int x = 0; x < kViewSide; ++x) {
      const auto i = static_cast<size_t>(y * kViewSide + x);
      if (gbuffer.coverage[i] < 1 || gbuffer.view_cosine[i] < 0.3f) continue;
      cosines += glm::dot(normal.rgb(x, y), glm::transpose(world_from_camera) * gbuffer.n_shading_world[i]);
      ++count;
    }
  ASSERT_GT(count, 1000);
  EXPECT_GT(cosines / count, std::cos(glm::radians(3.0)));
  EXPECT_LT((batch.clean.base_color.select(1, 1) - linear_from_srgb(0.3f)).abs().max().item<float>(), 1e-5f);
  EXPECT_LT((batch.clean.roughness - 0.4f).abs().max().item<float>(), 1e-6f);
  EXPECT_LT((batch.clean.metallic - 1).abs().max().item<float>(), 1e-6f);
  EXPECT_TRUE(at::equal(batch.clean.normal, batch.aged.normal));
}

// Mean of the age mask over the pixels on which `holds` is true.
template <class Holds>
double mean_mask(const Batch& batch, const Holds& holds) {
  const at::Tensor mask = batch.age_mask.contiguous();
  const ViewData& view = kettle_data().objects[0].views[0];
  constexpr size_t kPixels = static_cast<size_t>(kViewSide) * kViewSide;
  double sum = 0, count = 0;
  for (size_t i = 0; i < kPixels; ++i) {
    if (view.planes[kCoverage * kPixels + i] < 255 || !holds(view, i, kPixels)) continue;
    sum += static_cast<double>(mask.data_ptr<float>()[i]);
    count += 1;
  }
  EXPECT_GT(count, 50);
  return sum / count;
}

// The last layer alone, so that grime below does not count.
Batch only_main_layer(const std::string& name, uint64_t index) {
  const Catalog catalog = catalog_of(kettle_data());
  Plan plan = plan_of(catalog, name, 1, 7, index, {});
  plan.layers.erase(plan.layers.begin(), plan.layers.end() - 1);
  return compose(kettle_library(), std::span(&plan, 1));
}

vec3 normal_of(const ViewData& view, size_t i, size_t pixels) {
  const float x = 2.0f * view.planes[kNormalX * pixels + i] / 255.0f - 1,
              y = 2.0f * view.planes[kNormalY * pixels + i] / 255.0f - 1;
  return view.world_from_camera * vec3(x, y, std::sqrt(std::max(0.0f, 1 - x * x - y * y)));
}

TEST(Compose, moss_and_snow_lie_on_top) {
  for (const char* name : {"moss", "snow"})
    for (uint64_t index = 0; index < 3; ++index) {
      const Batch batch = only_main_layer(name, index);
      const double up = mean_mask(
          batch, [](const auto& view, size_t i, size_t n) { return normal_of(view, i, n).y > 0.6f; });
      const double down = mean_mask(
          batch, [](const auto& view, size_t i, size_t n) { return normal_of(view, i, n).y < -0.1f; });
      EXPECT_GT(up, down + 0.2) << name;
    }
}

TEST(Compose, edges_wear_first) {
  for (uint64_t index = 0; index < 3; ++index) {
    const Batch batch = only_main_layer("edge wear", index);
    const double edges = mean_mask(batch, [](const auto& view, size_t i, size_t n) {
      return view.planes[kCurvatureFine * n + i] > 190;
    });
    const double flat = mean_mask(batch, [](const auto& view, size_t i, size_t n) {
      return std::abs(view.planes[kCurvatureFine * n + i] - 140) < 15;
    });
    EXPECT_GT(edges, flat + 0.2);
  }
}

TEST(Compose, the_amount_is_the_share_of_the_surface) {
  const Catalog catalog = catalog_of(kettle_data());
  for (int level = 0; level < 3; ++level) {
    Plan plan = plan_of(catalog, "rust", level, 7, 3, {});
    plan.layers.erase(plan.layers.begin(), plan.layers.end() - 1);
    const Batch batch = compose(kettle_library(), std::span(&plan, 1));
    EXPECT_NEAR(mean_mask(batch, [](const auto&, size_t, size_t) { return true; }),
                plan.layers[0].mask.amount, 0.05);
  }
}

TEST(Compose, the_same_plan_gives_the_same_sample_alone_and_in_company) {
  const Catalog catalog = catalog_of(kettle_data());
  std::vector<Plan> plans;
  for (uint64_t index = 0; index < 3; ++index) plans.push_back(draw_plan(catalog, 11, index, {}));
  const Batch together = compose(kettle_library(), plans);
  for (size_t i = 0; i < plans.size(); ++i) {
    const Batch alone = compose(kettle_library(), std::span(&plans[i], 1));
    const auto k = static_cast<int64_t>(i);
    EXPECT_LT((alone.target[0] - together.target[k]).abs().max().item<float>(), 1e-4f);
    EXPECT_LT((alone.tile[0] - together.tile[k]).abs().max().item<float>(), 1e-4f);
    EXPECT_EQ(alone.captions[0], plans[i].caption);
  }
}

TEST(Compose, samples_are_pictures_on_the_neutral_backdrop) {
  const Catalog catalog = catalog_of(kettle_data());
  std::vector<Plan> plans;
  for (uint64_t index = 0; index < 6; ++index) plans.push_back(draw_plan(catalog, 12, index, {}));
  const Batch batch = compose(kettle_library(), plans);
  const at::Tensor outside = (batch.coverage == 0).expand_as(batch.tile);
  for (const at::Tensor& picture : {batch.tile, batch.target}) {
    EXPECT_TRUE(at::isfinite(picture).all().item<bool>());
    EXPECT_GE(picture.min().item<float>(), 0.0f);
    EXPECT_LE(picture.max().item<float>(), 1.0f);
    EXPECT_LT((picture.masked_select(outside) - views::kBackdropSrgb).abs().max().item<float>(), 1e-4f);
  }
  EXPECT_EQ(batch.normal.masked_select(outside).abs().max().item<float>(), 0.0f);
}

TEST(Compose, smaller_samples_show_the_same) {
  const Catalog catalog = catalog_of(kettle_data());
  const Plan plan = plan_of(catalog, "rust", 1, 7, 2, {});
  const Batch full = compose(kettle_library(), std::span(&plan, 1));
  for (const int side : {kViewSide / 2, kViewSide / 4}) {
    const Batch small = compose(kettle_library(), std::span(&plan, 1), side);
    ASSERT_EQ(small.target.size(2), side);
    const int64_t k = kViewSide / side;
    const Image expected = image_of(at::avg_pool2d(full.target, {k, k}, {k, k})[0]);
    EXPECT_GT(report::psnr(image_of(small.target[0]), expected), 26.0f) << side;
  }
}

TEST(Compose, a_clean_prompt_asks_for_no_change) {
  Plan plan;
  plan.views = {0};
  plan.clean[1] = plan.clean[0];
  const Batch batch = compose(kettle_library(), std::span(&plan, 1));
  EXPECT_TRUE(at::equal(batch.tile, batch.target));
}

}  // namespace
}  // namespace patina::make_dataset
