#include "patina/inverse/fit_views.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "patina/base/parallel.h"
#include "patina/image/color.h"
#include "patina/inverse/alignment.h"
#include "patina/inverse/loss.h"

namespace patina::inverse {
namespace {

// The views are aligned with what they make together at these hundredths of the iterations: late enough that
// the textures show where things are, early enough that what was blurred becomes sharp again.
constexpr std::array<int, 4> kAlignments{15, 22, 30, 40};

}  // namespace

std::vector<Image> rendered_views(const FitState& state, std::span<const CachePixel> pixels,
                                  std::span<const Image> edited, float gain) {
  std::vector<Image> rendered;
  for (const Image& view : edited) rendered.emplace_back(view.width, view.height, 3);
  for (size_t i = 0; i < pixels.size(); ++i) {
    vec3 radiance(0.0f);
    for (const auto& of_cache : state.cache_radiance)
      radiance += of_cache[i] / static_cast<float>(state.cache_radiance.size());
    vec3 shown;
    for (int c = 0; c < 3; ++c) shown[c] = srgb_from_linear(reinhard(gain * radiance[c]));
    rendered[pixels[i].view].set_rgb(pixels[i].x, pixels[i].y, shown);
  }
  return rendered;
}

bool is_aligned_at(int iteration, int iterations) {
  for (const int hundredths : kAlignments)
    if (iteration == (iterations * hundredths + 99) / 100) return true;
  return false;
}

void align(FitState& state, std::span<const CachePixel> pixels, std::span<const Image> edited,
           std::span<const Image> weights, float gain) {
  const std::vector<Image> rendered = rendered_views(state, pixels, edited, gain);
  parallel_for(0, static_cast<int64_t>(edited.size()), 1, [&](int64_t begin, int64_t end) {
    for (auto v = static_cast<size_t>(begin); v < static_cast<size_t>(end); ++v)
      state.displacements[v] =
          estimate_displacement(rendered[v], edited[v], weights[v], state.displacements[v]);
  });
}

void retarget(std::vector<CachePixel>& pixels, std::span<const Image> edited,
              std::span<const Image> displacements) {
  std::vector<Image> targets(edited.size());
  parallel_for(0, static_cast<int64_t>(edited.size()), 1, [&](int64_t begin, int64_t end) {
    for (auto v = static_cast<size_t>(begin); v < static_cast<size_t>(end); ++v)
      targets[v] = loss_target(displaced(edited[v], displacements[v]));
  });
  for (CachePixel& pixel : pixels) pixel.target = targets[pixel.view].rgb(pixel.x, pixel.y);
}

float psnr_of(const LightCache& cache, std::span<const vec3> radiance, float gain) {
  double error = 0;
  for (size_t i = 0; i < radiance.size(); ++i) {
    const CachePixel& pixel = cache.pixels[i];
    for (int c = 0; c < 3; ++c) {
      const double difference =
          srgb_from_linear(reinhard(gain * radiance[i][c])) - srgb_from_linear(pixel.target[c]);
      error += difference * difference;
    }
  }
  const double mean = error / std::max<double>(1.0, 3.0 * static_cast<double>(radiance.size()));
  return static_cast<float>(mean > 0 ? -10.0 * std::log10(mean) : 100.0);
}

}  // namespace patina::inverse
