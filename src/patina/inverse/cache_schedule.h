// Which light caches live at which iteration. Iterations take turns over a few caches, each with its own
// points and directions, and the oldest is traced anew with the current materials now and then: no fixed
// noise is there long enough to be fitted. Many caches of few directions find more than few caches of many:
// for the same rays they also give the pixel more points (docs/decisions/0005).
#pragma once

#include <algorithm>
#include <cstddef>

namespace patina::inverse {

/// Generations of light caches: the first kPlaces are traced at the start, then one every few iterations in
/// the place of the oldest.
class CacheSchedule {
 public:
  static constexpr int kPlaces = 4;
  static constexpr int kRefreshes = 36;  // in a fit
  /// Generations that no iteration sees: this one and the next.
  static constexpr int kJudge = kPlaces + kRefreshes + 1;

  explicit CacheSchedule(int iterations)
      : interval_(std::max(1, (iterations + kRefreshes) / (kRefreshes + 1))) {}

  static size_t place_of(int generation) { return static_cast<size_t>(generation % kPlaces); }
  /// Whether a new generation is traced before `iteration` looks at it.
  bool begins_at(int iteration) const { return iteration > 0 && iteration % interval_ == 0; }
  /// The newest generation while `iteration` runs; the other places hold those just before it.
  int newest_at(int iteration) const { return kPlaces - 1 + iteration / interval_; }
  /// The place that `iteration` looks at: a new cache at once, else they take turns.
  size_t place_at(int iteration) const {
    return place_of(begins_at(iteration) ? newest_at(iteration) : iteration);
  }

 private:
  int interval_;  // iterations between two new generations
};

}  // namespace patina::inverse
