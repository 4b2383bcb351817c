// The energy of a picture's finest octaves, against pictures of which it is known.
#include "mini_data/octaves.h"

#include <ATen/ATen.h>
#include <gtest/gtest.h>

namespace patina::mini_data {
namespace {

TEST(Octaves, flat_pictures_have_none) {
  const FineEnergy energy = fine_energy(at::full({1, 3, 16, 16}, 0.7));
  EXPECT_LT(energy.both.max().item<float>(), 1e-6f);
  EXPECT_GE(energy.both.min().item<float>(), 0.0f);
}

TEST(Octaves, a_checkerboard_is_all_in_the_finest) {
  const at::Tensor places = at::arange(16);
  const at::Tensor board = ((places.view({16, 1}) + places) % 2).to(at::kFloat).expand({1, 3, 16, 16});
  const FineEnergy energy = fine_energy(board);
  EXPECT_EQ(energy.both.sizes(), at::IntArrayRef({1, 1, 13, 13}));
  EXPECT_LT((energy.finest - 0.25).abs().max().item<float>(), 1e-6f);
  EXPECT_LT((energy.both - 0.25).abs().max().item<float>(), 1e-6f);
}

// Of white noise an octave of a Haar transform holds 3/4 of what is left.
TEST(Octaves, white_noise_has_three_quarters_in_each) {
  at::manual_seed(3);
  const FineEnergy energy = fine_energy(at::randn({4, 3, 128, 128}));
  EXPECT_NEAR(energy.finest.mean().item<double>(), 3.0 / 4, 0.01);
  EXPECT_NEAR(energy.both.mean().item<double>(), 15.0 / 16, 0.01);
}

TEST(Octaves, windows_lie_two_pixels_within_the_object) {
  at::Tensor coverage = at::zeros({1, 1, 20, 20});
  coverage.slice(2, 4, 16).slice(3, 5, 17).fill_(1);
  const at::Tensor inside = windows_inside(coverage);
  EXPECT_EQ(inside.sizes(), at::IntArrayRef({1, 1, 17, 17}));
  // Eight pixels a side are left, which hold five windows of four.
  EXPECT_EQ(inside.sum().item<int64_t>(), 25);
  EXPECT_EQ(inside[0][0].slice(0, 6, 11).slice(1, 7, 12).sum().item<int64_t>(), 25);
}

}  // namespace
}  // namespace patina::mini_data
