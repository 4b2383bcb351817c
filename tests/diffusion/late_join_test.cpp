// Differential diffusion: on a toy denoiser whose trajectories are known without masks, for every solver, and
// through the whole edit.
#include "patina/diffusion/late_join.h"

#include <cmath>

#include <gtest/gtest.h>

#include "patina/diffusion/edit.h"
#include "small_runs.h"

namespace patina::diffusion {
namespace {

constexpr Solver kSolvers[] = {Solver::kDdim,           Solver::kPndm,        Solver::kEuler,
                               Solver::kEulerAncestral, Solver::kDpmSolverPp, Solver::kUniPc};

const std::vector<float> kStart{0.5f, -1.25f, 2.0f, 0.0f}, kNoise{1.0f, -0.5f, 0.25f, 2.0f},
    kStepNoise{0.1f, -0.2f, 0.3f, -0.4f};

// Four pixels of one channel under a denoiser that looks at each pixel alone, from call `start` on.
std::vector<float> toy_run(const SchedulePlan& plan, int start, const LateJoin* late) {
  std::vector<float> x = add_noise(plan, start, kStart, kNoise);
  SchedulerState state;
  for (int i = start; i < plan.num_calls(); ++i) {
    if (late) hold_latents(*late, plan, i, x);
    std::vector<float> output = scale_model_input(plan, i, x);
    for (float& value : output) value = std::sin(3 * value) - 0.2f * static_cast<float>(i);
    if (late) hold_output(*late, plan, i, output);
    x = step(plan, state, i, output, x, kStepNoise);
  }
  if (late) restore_start(*late, plan, x);
  return x;
}

SchedulePlan plan_of(Solver solver, Prediction prediction) {
  SchedulerConfig config;
  config.solver = solver;
  config.prediction = prediction;
  return make_schedule(config, 20);
}

template <class Check>
void for_all_plans(Check check) {
  for (const Solver solver : kSolvers)
    for (const Prediction prediction : {Prediction::kEpsilon, Prediction::kV, Prediction::kSample}) {
      SCOPED_TRACE(testing::Message() << "solver " << static_cast<int>(solver) << " prediction "
                                      << static_cast<int>(prediction));
      check(plan_of(solver, prediction));
    }
}

TEST(LateJoin, pixels_of_strength_zero_end_as_the_start_image_and_of_one_as_without_a_mask) {
  for_all_plans([](const SchedulePlan& plan) {
    const int start = start_index(plan, 0.8);
    const LateJoin late{first_calls(plan, 0.8, std::vector<float>{0, 1, 0, 1}), kStart, kNoise};
    const std::vector<float> masked = toy_run(plan, start, &late), plain = toy_run(plan, start, nullptr);
    for (size_t i : {0, 2}) EXPECT_EQ(masked[i], kStart[i]);
    for (size_t i : {1, 3}) EXPECT_EQ(masked[i], plain[i]);
  });
}

// A pixel that joins late goes the way of a run that starts there. Solvers that remember are led along the
// noised start image before, so they may be better informed than one that starts afresh; the others are
// equal.
TEST(LateJoin, a_pixel_of_half_the_strength_is_a_run_of_half_the_strength) {
  for_all_plans([](const SchedulePlan& plan) {
    const Solver solver = plan.config.solver;
    if (solver == Solver::kPndm || solver == Solver::kDpmSolverPp || solver == Solver::kUniPc) return;
    const LateJoin late{first_calls(plan, 0.8, std::vector<float>{0.5f, 1, 0.25f, 0}), kStart, kNoise};
    const std::vector<float> masked = toy_run(plan, start_index(plan, 0.8), &late);
    EXPECT_EQ(masked[0], toy_run(plan, start_index(plan, 0.4), nullptr)[0]);
    EXPECT_EQ(masked[2], toy_run(plan, start_index(plan, 0.2), nullptr)[2]);
  });
}

// Until it joins, a pixel is the noised start image at every call, also inside solvers that remember. Not so
// PNDM, whose second call of a run repeats a time: there hold_latents leads back.
TEST(LateJoin, solvers_carry_held_pixels_along_the_noised_start_image) {
  for_all_plans([](const SchedulePlan& plan) {
    if (plan.config.solver == Solver::kPndm) return;
    const int start = start_index(plan, 0.8);
    const LateJoin late{std::vector<int>(4, plan.num_calls()), kStart, kNoise};
    std::vector<float> x = add_noise(plan, start, kStart, kNoise);
    SchedulerState state;
    for (int i = start; i + 1 < plan.num_calls(); ++i) {
      std::vector<float> output(4, 7.0f);
      hold_output(late, plan, i, output);
      if (needs_noise(plan, i)) return;  // fresh noise leaves the path; hold_latents leads back
      x = step(plan, state, i, output, x);
      const std::vector<float> expected = add_noise(plan, i + 1, kStart, kNoise);
      for (size_t e = 0; e < x.size(); ++e)
        EXPECT_NEAR(x[e], expected[e], 2e-4f * (1 + std::abs(expected[e]))) << "call " << i;
    }
  });
}

TEST(LateJoin, a_strength_that_leaves_no_step_never_joins) {
  const SchedulePlan plan = plan_of(Solver::kUniPc, Prediction::kEpsilon);
  const std::vector<int> calls = first_calls(plan, 0.8, std::vector<float>{0, 0.01f, 0.0625f, 0.5f, 1});
  EXPECT_EQ(calls, (std::vector<int>{20, 20, 19, 12, 4}));
}

TEST(LateJoin, a_latent_pixel_has_the_largest_strength_of_its_pixels_that_have_one) {
  Image view(16, 8, 1, 0.25f);
  *view.at(3, 5) = 0.75f;
  for (int y = 0; y < 8; ++y)
    for (int x = 8; x < 16; ++x) *view.at(x, y) = -1.0f;
  Image other(16, 8, 1, 0.0f);
  *other.at(8, 0) = -1.0f;
  const std::vector<float> strengths = latent_strengths(std::vector<Image>{view, other, other, view}, 2, 8);
  EXPECT_EQ(strengths, (std::vector<float>{0.75f, 1, 0, 0, 0, 0, 0.75f, 1}));
}

using test::made_inputs, test::short_options, test::tiny_model;

std::vector<Image> run(const EditInputs& inputs, const EditHooks& hooks = {}, const Progress& progress = {}) {
  return edit_views(tiny_model(), inputs, short_options(), hooks, progress);
}

TEST(LateJoin, views_that_are_white_are_edited_as_without_a_mask) {
  EditInputs inputs = made_inputs(1, 64);
  const Image plain = run(inputs)[0];
  inputs.strength_views = {Image(64, 64, 1, 1.0f)};
  for (int x = 0; x < 20; ++x) *inputs.strength_views[0].at(x, 3) = -1.0f;
  EXPECT_EQ(run(inputs)[0].pixels, plain.pixels);
  inputs.strength_views = {Image(32, 64, 1, 1.0f)};
  EXPECT_THROW(run(inputs), Error);
}

// The left half is held: its latents are the render's, so it decodes as the VAE shows the render, while the
// right half changes.
TEST(LateJoin, held_views_decode_as_the_render_does) {
  EditInputs inputs = made_inputs(1, 64);
  const Image plain = run(inputs)[0];
  Image strength(64, 64, 1);
  inputs.strength_views = {strength};
  const Image held = run(inputs)[0];
  for (int y = 0; y < 64; ++y)
    for (int x = 32; x < 64; ++x) *strength.at(x, y) = 1.0f;
  inputs.strength_views = {strength};
  const Image half = run(inputs)[0];
  // The VAE mixes neighbouring latents, so only what is far from the border is compared.
  double left = 0, right = 0, whole = 0;
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 64; ++x)
      for (int c = 0; c < 3; ++c) {
        const double change = std::abs(half.at(x, y)[c] - held.at(x, y)[c]);
        if (x < 8) left += change;
        if (x >= 40) right += change, whole += std::abs(plain.at(x, y)[c] - held.at(x, y)[c]);
      }
  EXPECT_LT(left, 0.2 * right) << left << ' ' << right;
  EXPECT_GT(right, 0.5 * whole) << right << ' ' << whole;
}

TEST(LateJoin, a_masked_run_resumes_to_the_bit) {
  EditInputs inputs = made_inputs(1, 64);
  Image strength(64, 64, 1, 0.5f);
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 20; ++x) *strength.at(x, y) = x < 10 ? 0.0f : 1.0f;
  inputs.strength_views = {strength};
  std::vector<Checkpoint> checkpoints;
  EditHooks hooks;
  hooks.on_checkpoint = [&](const Checkpoint& c) { checkpoints.push_back(c); };
  const Image whole = run(inputs, hooks)[0];
  ASSERT_GE(checkpoints.size(), 2u);
  EditHooks resumed;
  resumed.resume = checkpoints[checkpoints.size() / 2 - 1];
  EXPECT_EQ(run(inputs, resumed)[0].pixels, whole.pixels);
}

}  // namespace
}  // namespace patina::diffusion
