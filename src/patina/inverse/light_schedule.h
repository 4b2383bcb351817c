// When a fit traces the light anew: light that surfaces throw on each other follows the textures.
#pragma once

#include <array>

namespace patina::inverse {

/// The light is traced before `hundredths` of the iterations, so many times a pixel. What is traced in
/// between only leads to maps that the last one is traced with, so it may be rougher.
struct LightTrace {
  int hundredths, traces;
};
inline constexpr std::array<LightTrace, 4> kLightTraces{{{0, 8}, {12, 4}, {25, 4}, {50, 8}}};

constexpr int light_trace_at(int trace, int iterations) {
  return (iterations * kLightTraces[static_cast<size_t>(trace)].hundredths + 99) / 100;
}

/// The index of the trace whose light iteration `iteration` sees.
constexpr int light_generation_at(int iteration, int iterations) {
  int generation = 0;
  for (int trace = 0; trace < static_cast<int>(kLightTraces.size()); ++trace)
    if (light_trace_at(trace, iterations) <= iteration) generation = trace;
  return generation;
}

constexpr bool is_light_traced_at(int iteration, int iterations) {
  return iteration == 0 ||
         light_generation_at(iteration, iterations) != light_generation_at(iteration - 1, iterations);
}

}  // namespace patina::inverse
