// The judge with a classifier of three colours, on pictures whose parts are known.
#include "bench_mini/judge.h"

#include <gtest/gtest.h>

#include "bench_mini/asked.h"
#include "bench_mini/texture_features.h"
#include "patina/base/random.h"

namespace patina::bench {
namespace {

constexpr int kSide = 192;
constexpr int kRust = 0, kMoss = 1, kMud = 2;
const vec3 kColors[] = {{0.6f, 0.3f, 0.1f}, {0.2f, 0.5f, 0.1f}, {0.4f, 0.35f, 0.3f}};

// A speckled colour from column `left` to column `right`.
void paint(Image& picture, const vec3& color, int left, int right, uint64_t seed) {
  RandomStream random(seed, RandomPurpose::kTest, 0);
  for (int y = 0; y < kSide; ++y)
    for (int x = left; x < right; ++x) picture.set_rgb(x, y, color + vec3(0.05f * random.gaussian()));
}
Image painted(int kind, uint64_t seed) {
  Image out(kSide, kSide, 3);
  paint(out, kColors[kind], 0, kSide, seed);
  return out;
}

const Image kCovered(kSide, kSide, 1, 1.0f);

const Discriminant& classifier() {
  static const Discriminant trained = [] {
    std::vector<std::vector<float>> features;
    std::vector<int> labels;
    for (const int kind : {kRust, kMoss, kMud}) {
      const TexturePlanes planes = texture_planes(painted(kind, 10 + static_cast<uint64_t>(kind)), kCovered);
      for (const Window& window : windows_on_object(planes, kWindowSide, kLeastValid)) {
        features.push_back(texture_features(planes, window));
        labels.push_back(kind);
      }
    }
    std::vector<LabelledPoint> points;
    for (size_t i = 0; i < features.size(); ++i) points.push_back({features[i], labels[i], ""});
    return train_discriminant(points, static_cast<int>(asked_classes().size()) + 1, 0.2f);
  }();
  return trained;
}

Ranking judged(const Image& before, const Image& after) {
  const JudgedView view{&before, &after, &kCovered};
  return judge_edit(classifier(), {&view, 1});
}

TEST(Judge, goes_by_what_changed_and_not_by_what_was_there) {
  const Image before = painted(kMoss, 1);
  Image after = before;
  paint(after, kColors[kRust], 0, kSide / 3, 2);
  const Ranking ranking = judged(before, after);
  EXPECT_EQ(ranking.place_of(kRust), 0);
  EXPECT_EQ(ranking.place_of(kMoss), 1) << "the border's windows show both";
}

TEST(Judge, gives_no_place_to_an_edit_of_nothing) {
  const Image picture = painted(kRust, 3);
  const Ranking ranking = judged(picture, picture);
  for (int c = 0; c < static_cast<int>(asked_classes().size()); ++c) EXPECT_GE(ranking.place_of(c), 3);
}

TEST(Judge, sees_all_views) {
  const Image before = painted(kMud, 4), rusty = painted(kRust, 5), mossy = painted(kMoss, 6);
  const JudgedView views[] = {
      {&before, &rusty, &kCovered}, {&before, &mossy, &kCovered}, {&before, &mossy, &kCovered}};
  const Ranking ranking = judge_edit(classifier(), views);
  EXPECT_EQ(ranking.classes[0], kMoss);
  EXPECT_EQ(ranking.classes[1], kRust);
}

TEST(AskedClasses, are_at_least_fifteen_of_five_wordings_each) {
  EXPECT_GE(asked_classes().size(), 15u);
  for (const AskedClass& asked : asked_classes()) {
    EXPECT_EQ(asked.prompts.size(), 5u) << asked.name;
    EXPECT_FALSE(asked.recipes.empty()) << asked.name;
    for (size_t i = 0; i < asked.prompts.size(); ++i)
      EXPECT_NE(prompt_of(asked, "kettle", i).find("kettle"), std::string::npos);
  }
}

}  // namespace
}  // namespace patina::bench
