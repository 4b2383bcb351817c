#include "bench_mini/structure.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

namespace patina::bench {
namespace {

constexpr int kSide = 64;

// Dark left of column `x`, bright from there on.
Image step_at(int x) {
  Image out(kSide, kSide, 3, 0.2f);
  for (int y = 0; y < kSide; ++y)
    for (int u = x; u < kSide; ++u) out.set_rgb(u, y, vec3(0.7f));
  return out;
}

const std::vector<uint8_t> kEverywhere(kSide* kSide, 1);

EdgeMatch matched(const Image& edited, const Image& original) {
  return match_edges(edge_map(edited), edge_map(original), kEverywhere, kSide);
}

TEST(EdgeMap, is_one_pixel_wide_beside_a_step) {
  const auto edges = edge_map(step_at(20));
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x) {
      if (edges[static_cast<size_t>(y * kSide + x)]) {
        EXPECT_TRUE(x == 19 || x == 20) << x << ", " << y;
      }
    }
  EXPECT_EQ(std::count(edges.begin(), edges.end(), 1), kSide);
}

TEST(EdgeMap, finds_none_in_a_gentle_ramp) {
  Image ramp(kSide, kSide, 3);
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x) ramp.set_rgb(x, y, vec3(0.01f * static_cast<float>(x)));
  const auto edges = edge_map(ramp);
  EXPECT_EQ(std::count(edges.begin(), edges.end(), 1), 0);
}

TEST(EdgeMatch, forgives_two_pixels_and_no_more) {
  EXPECT_DOUBLE_EQ(matched(step_at(20), step_at(20)).f_score(), 1);
  EXPECT_DOUBLE_EQ(matched(step_at(22), step_at(20)).f_score(), 1);
  EXPECT_DOUBLE_EQ(matched(step_at(23), step_at(20)).f_score(), 0);
}

TEST(EdgeMatch, new_edges_cost_precision_and_lost_ones_recall) {
  Image both = step_at(20);
  for (int y = 0; y < kSide; ++y)
    for (int x = 44; x < kSide; ++x) both.set_rgb(x, y, vec3(0.1f));
  const EdgeMatch added = matched(both, step_at(20));
  EXPECT_DOUBLE_EQ(added.recall(), 1);
  EXPECT_DOUBLE_EQ(added.precision(), 0.5);
  EXPECT_NEAR(added.f_score(), 2.0 / 3, 1e-12);
  const EdgeMatch lost = matched(step_at(20), both);
  EXPECT_DOUBLE_EQ(lost.recall(), 0.5);
  EXPECT_DOUBLE_EQ(lost.precision(), 1);
}

TEST(EdgeMatch, counts_only_where_asked_but_matches_across_the_border) {
  std::vector<uint8_t> right(kEverywhere.size(), 0);
  for (int y = 0; y < kSide; ++y)
    for (int x = 21; x < kSide; ++x) right[static_cast<size_t>(y * kSide + x)] = 1;
  const EdgeMatch match = match_edges(edge_map(step_at(22)), edge_map(step_at(20)), right, kSide);
  EXPECT_EQ(match.num_edited, kSide);
  EXPECT_EQ(match.edited_matched, kSide);
  EXPECT_EQ(match.num_original, 0);
}

TEST(EdgeMatch, is_no_number_without_edges) {
  const Image flat(kSide, kSide, 3, 0.5f);
  EXPECT_TRUE(std::isnan(matched(flat, flat).f_score()));
}

TEST(Ring, holds_the_squares_around_a_pixel) {
  std::vector<uint8_t> one(kSide * kSide, 0);
  one[30 * kSide + 30] = 1;
  const auto size_of = [&](int nearest, int farthest) {
    const auto marks = ring(one, kSide, nearest, farthest);
    return std::count(marks.begin(), marks.end(), 1);
  };
  EXPECT_EQ(size_of(0, 0), 1);
  EXPECT_EQ(size_of(0, 2), 25);
  EXPECT_EQ(size_of(1, 2), 24);
  EXPECT_EQ(size_of(2, 3), 49 - 9);
}

TEST(MeanChange, is_that_of_marked_pixels_alone) {
  const Image a(kSide, kSide, 3, 0.5f);
  Image b = a;
  b.set_rgb(3, 0, {0.5f, 0.8f, 0.5f});
  std::vector<uint8_t> marks(kSide * kSide, 0);
  EXPECT_TRUE(std::isnan(mean_change(a, b, marks)));
  marks[3] = marks[4] = 1;
  EXPECT_NEAR(mean_change(a, b, marks), 0.3 / 6, 1e-7);
}

}  // namespace
}  // namespace patina::bench
