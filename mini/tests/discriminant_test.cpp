// Against Gaussians whose best possible classifier is known in closed form.
#include "bench_mini/discriminant.h"

#include <cmath>

#include <gtest/gtest.h>

#include "patina/base/random.h"

namespace patina::bench {
namespace {

struct Cloud {
  std::vector<std::vector<float>> features;
  std::vector<LabelledPoint> points;

  // Correlated: x = centre.x + 2 g0, y = centre.y + g0 + 0.5 g1.
  void add(vec2 centre, int label, const std::string& source, int count, RandomStream& random) {
    for (int i = 0; i < count; ++i) {
      const float g0 = random.gaussian(), g1 = random.gaussian();
      features.push_back({centre.x + 2 * g0, centre.y + g0 + 0.5f * g1});
      points.push_back({{}, label, source});
    }
  }
  std::span<const LabelledPoint> all() {
    for (size_t i = 0; i < points.size(); ++i) points[i].features = features[i];
    return points;
  }
};

double right_share(const Discriminant& d, Cloud& cloud) {
  double right = 0;
  for (const LabelledPoint& p : cloud.all()) {
    const auto probability = class_probabilities(d, p.features, 1);
    right += probability[static_cast<size_t>(p.label)] > 0.5f;
  }
  return right / static_cast<double>(cloud.points.size());
}

TEST(Discriminant, tells_the_probabilities_of_two_gaussians) {
  RandomStream random(3, RandomPurpose::kTest, 0);
  Cloud cloud;
  const vec2 a(0, 0), b(1, 1.5f);
  cloud.add(a, 0, "a", 40000, random);
  cloud.add(b, 1, "b", 10000, random);
  const Discriminant d = train_discriminant(cloud.all(), 2, 1e-4f);
  // Bayes with equal priors: the log-odds are differences of Mahalanobis distances, with the inverse of
  // [[4, 2], [2, 1.25]].
  const auto distance = [](vec2 v) { return 1.25f * v.x * v.x - 4 * v.x * v.y + 4 * v.y * v.y; };
  for (const vec2 x : {vec2(0, 0), vec2(1, 1), vec2(-2, 0), vec2(2, 1.5f), vec2(0.5f, 0.75f)}) {
    const float expected = 1 / (1 + std::exp(0.5f * (distance(x - b) - distance(x - a))));
    EXPECT_NEAR(class_probabilities(d, std::vector<float>{x.x, x.y}, 1)[1], expected, 0.02)
        << x.x << " " << x.y;
  }
}

TEST(Discriminant, knows_a_class_of_two_centres_on_either_side_of_another) {
  RandomStream random(4, RandomPurpose::kTest, 0);
  const auto cloud_of = [&](bool told_apart) {
    Cloud cloud;
    cloud.add({-20, 0}, 0, "left", 500, random);
    cloud.add({20, 0}, 0, told_apart ? "right" : "left", 500, random);
    cloud.add({0, 0}, 1, "middle", 500, random);
    return cloud;
  };
  Cloud known = cloud_of(true), unknown = cloud_of(false);
  EXPECT_GT(right_share(train_discriminant(known.all(), 2, 0.01f), known), 0.99);
  EXPECT_LT(right_share(train_discriminant(unknown.all(), 2, 0.01f), unknown), 0.8);
}

TEST(Discriminant, does_not_count_how_many_points_a_source_has) {
  RandomStream random(5, RandomPurpose::kTest, 0);
  Cloud once;
  once.add({0, 0}, 0, "a", 50, random);
  once.add({3, 0}, 0, "b", 50, random);
  once.add({0, 4}, 1, "c", 50, random);
  Cloud twice = once;
  for (size_t i = 0; i < 50; ++i) {
    twice.features.push_back(once.features[i]);
    twice.points.push_back(once.points[i]);
  }
  const Discriminant d = train_discriminant(once.all(), 2, 0.1f),
                     e = train_discriminant(twice.all(), 2, 0.1f);
  for (const std::vector<float>& x : once.features)
    EXPECT_NEAR(class_probabilities(d, x, 1)[0], class_probabilities(e, x, 1)[0], 1e-4);
}

TEST(Discriminant, is_the_same_after_json) {
  RandomStream random(6, RandomPurpose::kTest, 0);
  Cloud cloud;
  cloud.add({0, 0}, 0, "a", 30, random);
  cloud.add({1, 1}, 2, "b", 30, random);
  const Discriminant d = train_discriminant(cloud.all(), 3, 0.1f);
  const Discriminant e = discriminant_from_json(nlohmann::json::parse(to_json(d).dump()));
  for (const std::vector<float>& x : cloud.features)
    EXPECT_EQ(class_probabilities(d, x, 2), class_probabilities(e, x, 2));
  EXPECT_EQ(class_probabilities(d, cloud.features[0], 1)[1], 0) << "a class without points";
}

}  // namespace
}  // namespace patina::bench
