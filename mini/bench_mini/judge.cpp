#include "judge.h"

#include <algorithm>
#include <numeric>

#include "asked.h"
#include "patina/base/check.h"
#include "texture_features.h"

namespace patina::bench {

int Ranking::place_of(int asked) const {
  const float own = scores[static_cast<size_t>(asked)];
  return static_cast<int>(std::count_if(scores.begin(), scores.end(), [&](float s) { return s >= own; })) - 1;
}

Ranking judge_edit(const Discriminant& classifier, std::span<const JudgedView> views) {
  const size_t num_asked = asked_classes().size();
  PATINA_CHECK_EQ(static_cast<size_t>(classifier.num_classes), num_asked + 1);
  std::vector<double> votes(num_asked, 0.0);
  double total = 1e-9;  // an edit that changes nothing has no windows that count
  for (const JudgedView& view : views) {
    const TexturePlanes before = texture_planes(*view.before, *view.coverage);
    const TexturePlanes after = texture_planes(*view.after, *view.coverage);
    const std::vector<float> change = color_difference(before, after);
    for (const Window& window : windows_on_object(after, kWindowSide, kLeastValid)) {
      const double weight = std::min(mean_over(after, window, change), kFullChange);
      const auto probability = class_probabilities(classifier, texture_features(after, window), kTemperature);
      for (size_t c = 0; c < num_asked; ++c) votes[c] += weight * probability[c];
      total += weight;
    }
  }
  Ranking out;
  for (const double vote : votes) out.scores.push_back(static_cast<float>(vote / total));
  out.classes.resize(num_asked);
  std::iota(out.classes.begin(), out.classes.end(), 0);
  std::stable_sort(out.classes.begin(), out.classes.end(), [&](int a, int b) {
    return out.scores[static_cast<size_t>(a)] > out.scores[static_cast<size_t>(b)];
  });
  return out;
}

}  // namespace patina::bench
