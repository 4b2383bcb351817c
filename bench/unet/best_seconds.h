// The shortest of several runs: the one that nothing else disturbed.
#pragma once

#include <algorithm>
#include <chrono>

namespace patina::bench {

template <class Work>
double best_seconds(int repeat, const Work& work) {
  double best = 1e30;
  for (int i = 0; i < repeat; ++i) {
    const auto start = std::chrono::steady_clock::now();
    work();
    best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  return best;
}

}  // namespace patina::bench
