// Which of the asked classes an edit looks like, from the pixels on the object that it changed.
#pragma once

#include <span>
#include <vector>

#include "discriminant.h"
#include "patina/image/image.h"

namespace patina::bench {

/// What the judge is shown of one view: sRGB before and after [H,W,3], and the object's coverage [H,W,1].
struct JudgedView {
  const Image* before = nullptr;
  const Image* after = nullptr;
  const Image* coverage = nullptr;
};

/// Scores of the asked classes, most likely first. Every window on the object votes with its probabilities,
/// and its vote weighs as much as its colour changed (ΔE up to kFullChange): a window that did not change
/// says nothing about the prompt. Windows that look untouched vote for no asked class.
inline constexpr float kFullChange = 30.0f;
inline constexpr float kTemperature = 3.0f;
struct Ranking {
  std::vector<int> classes;   // into asked_classes(), all of them
  std::vector<float> scores;  // [classes], in the order of asked_classes(); sums to at most 1
  /// 0 for the first place; behind all others with the same score, so that an unchanged view ranks last.
  int place_of(int asked) const;
};
Ranking judge_edit(const Discriminant& classifier, std::span<const JudgedView> views);

}  // namespace patina::bench
