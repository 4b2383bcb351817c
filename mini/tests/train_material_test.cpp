// The trainer of the material prior: what it makes of records, its disturbances, its loss, its measures, and
// that a training goes on where it stopped.
#include <cmath>
#include <fstream>

#include <ATen/ATen.h>
#include <gtest/gtest.h>

#include "mini_data/dataset.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/prior/material_prior.h"
#include "support.h"
#include "train_material/augment.h"
#include "train_material/evaluation.h"
#include "train_material/loss.h"
#include "train_material/training.h"

namespace patina::train_material {
namespace {

namespace fs = std::filesystem;
using at::Tensor;
using mini_data::kViewSide;

// Samples that are noise, all of them covered by an object; `unchanged`: the edited picture shows what was
// there.
void write_noise(const fs::path& folder, int64_t count, bool unchanged) {
  fs::create_directories(folder);
  std::ofstream out(folder / "records.u8", std::ios::binary);
  at::manual_seed(3);
  for (int64_t i = 0; i < count; ++i) {
    Tensor planes = at::rand({kNumPlanes, kViewSide, kViewSide});
    for (const int64_t normal : {kCleanNormal, kTrueNormal}) {
      Tensor n = at::randn({3, kViewSide, kViewSide});
      n[2].abs_().add_(1.5);
      planes.slice(0, normal, normal + 3).copy_(0.5 + 0.5 * n / n.norm(2, {0}, true));
    }
    planes[kCoverage].fill_(1);
    const auto copy = [&](int64_t to, int64_t from, int64_t n) {
      planes.slice(0, to, to + n).copy_(planes.slice(0, from, from + n));
    };
    if (unchanged)
      copy(kEdited, kRender, 3), copy(kTrueBase, kCleanBase, 3), copy(kTrueRoughness, kCleanRoughness, 2),
          copy(kTrueNormal, kCleanNormal, 3);
    const Tensor bytes = (planes * 255).round().to(at::kByte).contiguous();
    out.write(static_cast<const char*>(bytes.data_ptr()), bytes.numel());
  }
}

TEST(MaterialRecords, true_slopes_bend_the_clean_normal_to_the_true_one) {
  const test::TemporaryFolder folder;
  write_noise(folder.path(), 1, false);
  const Tensor planes = Records(folder.path()).record(0).unsqueeze(0);
  const Truth truth = truth_of(planes);
  const Tensor bent = prior::bent_normals(inputs_of(planes).normal, truth.slope);
  const Tensor inside = (truth.slope.abs().amax({1}, true) < prior::kMaxSlope).to(at::kFloat);
  EXPECT_GT(inside.mean().item<float>(), 0.8f);
  EXPECT_LT(((bent - truth.normal).abs() * inside).max().item<float>(), 1e-4f);
}

// By the same rule as the one for a single normal.
TEST(MaterialRecords, normals_of_tensors_are_bent_as_single_ones) {
  const vec3 n = glm::normalize(vec3(0.6f, -0.3f, 0.2f)), expected = prior::bent_normal(n, vec2(-0.7f, 0.2f));
  const Tensor normal = at::tensor({n.x, n.y, n.z}).view({1, 3, 1, 1});
  const Tensor slope = at::tensor({-0.7f, 0.2f}).view({1, 2, 1, 1});
  const Tensor bent = prior::bent_normals(normal, slope);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(bent[0][c].item<float>(), expected[c], 1e-6f);
  EXPECT_LT((prior::slopes_between(normal, bent) - slope).abs().max().item<float>(), 1e-5f);
}

TEST(MaterialRecords, an_unchanged_view_divides_to_its_own_base_color) {
  at::manual_seed(4);
  prior::MaterialInputs inputs;
  inputs.render = inputs.edited = at::rand({1, 3, 8, 8}) * 0.85 + 0.05;
  inputs.base_color = at::rand({1, 3, 8, 8});
  EXPECT_LT((prior::divided_base_color(inputs) - inputs.base_color).abs().max().item<float>(), 1e-5f);
}

TEST(MaterialRecords, an_empty_folder_is_refused_by_name) {
  const test::TemporaryFolder folder;
  std::ofstream(folder.path() / "records.u8") << "too short";
  try {
    Records records(folder.path());
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.context(), folder.path().string());
  }
}

TEST(MaterialCuts, pictures_and_maps_are_cut_mirrored_and_recoloured_alike) {
  const test::TemporaryFolder folder;
  write_noise(folder.path(), 1, true);
  std::mt19937_64 random(1);
  const Tensor cuts = random_cuts(Records(folder.path()), 24, 64, random);
  const auto same = [&](int64_t a, int64_t b, int64_t n) {
    return at::equal(cuts.slice(1, a, a + n), cuts.slice(1, b, b + n));
  };
  EXPECT_TRUE(same(kEdited, kRender, 3));
  EXPECT_TRUE(same(kTrueBase, kCleanBase, 3));
  EXPECT_TRUE(same(kTrueRoughness, kCleanRoughness, 2));
  EXPECT_TRUE(same(kTrueNormal, kCleanNormal, 3));
  // A mirrored normal is still a unit vector toward the camera.
  const Tensor n = 2 * cuts.slice(1, kTrueNormal, kTrueNormal + 3) - 1;
  EXPECT_GT(n.select(1, 2).min().item<float>(), 0.0f);
}

TEST(MaterialDisturbance, of_no_strength_changes_nothing) {
  at::manual_seed(1);
  const Tensor picture = at::rand({2, 3, 32, 24}) * 0.9, none = at::zeros({2, 1, 1, 1});
  EXPECT_LT((blurred(picture, none) - picture).abs().max().item<float>(), 1e-5f);
  EXPECT_LT((compressed(picture, none) - picture).abs().max().item<float>(), 1e-3f);
  EXPECT_LT((reexposed(picture, at::ones({2, 1, 32, 24}), none) - picture).abs().max().item<float>(), 1e-4f);
}

TEST(MaterialDisturbance, blur_and_compression_keep_means_and_take_detail) {
  at::manual_seed(2);
  const Tensor picture = 0.4 + 0.2 * at::rand({1, 3, 64, 64}), strength = at::ones({1, 1, 1, 1});
  for (const Tensor& found : {blurred(picture, strength), compressed(picture, strength)}) {
    EXPECT_NEAR(found.mean().item<float>(), picture.mean().item<float>(), 0.01f);
    EXPECT_LT(found.std().item<float>(), 0.9f * picture.std().item<float>());
  }
}

TEST(MaterialDisturbance, touches_pictures_alone) {
  const test::TemporaryFolder folder;
  write_noise(folder.path(), 1, false);
  const Tensor planes = Records(folder.path()).record(0).unsqueeze(0).slice(2, 0, 64).slice(3, 0, 64);
  at::manual_seed(5);
  const Tensor found = disturbed(planes.expand({12, -1, -1, -1}));
  EXPECT_TRUE(
      at::equal(found.slice(1, kCleanNormal), planes.slice(1, kCleanNormal).expand({12, -1, -1, -1})));
  EXPECT_GE(found.min().item<float>(), 0.0f);
  EXPECT_LE(found.max().item<float>(), 1.0f);
}

// Whatever the weight of a pixel, the scale that costs least is its mean absolute error.
TEST(MaterialLoss, is_least_where_expected_errors_are_the_errors) {
  Truth truth;
  truth.base_color = at::full({1, 3, 4, 4}, 0.5), truth.roughness = at::full({1, 1, 4, 4}, 0.5);
  truth.metallic = at::zeros({1, 1, 4, 4}), truth.weight = at::ones({1, 1, 4, 4});
  truth.slope = at::zeros({1, 2, 4, 4});
  prior::MaterialOutputs y;
  y.base_color = truth.base_color + 0.1, y.roughness = truth.roughness - 0.2, y.slope = truth.slope + 0.3;
  y.metallic_logit = at::full({1, 1, 4, 4}, -4.0);
  y.base_color_error = at::full({1, 1, 4, 4}, 0.1), y.roughness_error = at::full({1, 1, 4, 4}, 0.2);
  y.slope_error = at::full({1, 1, 4, 4}, 0.3);
  for (Tensor* scale : {&y.base_color_error, &y.roughness_error, &y.slope_error})
    scale->set_requires_grad(true);
  const Loss loss = loss_of(y, truth);
  loss.total.backward();
  for (const Tensor& scale : {y.base_color_error, y.roughness_error, y.slope_error})
    EXPECT_LT(scale.grad().abs().max().item<float>(), 1e-5f);
  EXPECT_NEAR(loss.parts.at("slope"), 0.3, 1e-6);
}

class MaterialTrainingTest : public testing::Test {
 protected:
  MaterialTrainingTest() {
    write_noise(work() / "training", 2, false);
    write_noise(work() / "held_out", 1, true);
    write_file(model() / prior::kMaterialConfigFile,
               std::string_view(R"({"channels": [8, 8], "norm_groups": 4})"));
    options_.run.minutes = 0.03, options_.run.warm_up_steps = 1;
    options_.batch = 2, options_.side = 32;
  }
  fs::path work() const { return folder_.path() / "work"; }
  fs::path model() const { return folder_.path() / "model"; }
  int64_t steps() const { return std::stoll(read_text_file(work() / "material.step")); }

  test::TemporaryFolder folder_;
  MaterialTraining options_;
};

TEST_F(MaterialTrainingTest, goes_on_where_it_stopped_and_begins_with_a_given_model) {
  train_material(work(), model(), options_);
  const int64_t first = steps();
  EXPECT_GT(first, 0);
  train_material(work(), model(), options_);
  EXPECT_GT(steps(), first);
  // Without its checkpoint, from the weights that were written.
  fs::remove(work() / "material.checkpoint"), fs::remove(work() / "material.step");
  const Evaluation before = evaluate(read_material_network(model()), Records(work() / "held_out"), {});
  options_.from_model = true, options_.run.rate = 1e-12;
  train_material(work(), model(), options_);
  const Evaluation after = evaluate(read_material_network(model()), Records(work() / "held_out"), {});
  EXPECT_NEAR(after.network.roughness, before.network.roughness, 1e-3);
}

TEST_F(MaterialTrainingTest, measures_clean_maps_as_right_where_nothing_changed) {
  train_material(work(), model(), options_);
  const Evaluation e = evaluate(read_material_network(model()), Records(work() / "held_out"), {});
  EXPECT_EQ(e.samples, 1);
  EXPECT_GT(e.clean.base_db, 90);
  EXPECT_EQ(e.clean.roughness, 0);
  EXPECT_EQ(e.clean.metallic_kept, 1);
  EXPECT_NE(table_of(e).find("| base colour, dB |"), std::string::npos);
}

}  // namespace
}  // namespace patina::train_material
