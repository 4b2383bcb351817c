#include "patina/inverse/fit_views.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "patina/base/parallel.h"
#include "patina/image/color.h"
#include "patina/inverse/alignment.h"
#include "patina/inverse/edited_pixels.h"
#include "patina/inverse/loss.h"

namespace patina::inverse {
namespace {

// The views are aligned with what they make together at these hundredths of the iterations: late enough that
// the textures show where things are, early enough that what was blurred becomes sharp again.
constexpr std::array<int, 4> kAlignments{15, 22, 30, 40};

// More than so much is no error of the light cache: the pixel shows something else.
constexpr float kMaxCalibration = 1.5f;
// Relative change of a pixel up to which the light cache is still off as it was before, and from which on its
// error at the start says nothing any more.
constexpr float kLeastEdit = 0.03f, kFullEdit = 0.1f;
// A pixel of which the light cache is that far off at the start counts half (decision 0024).
constexpr float kHalfTrusted = 0.05f;

}  // namespace

std::vector<Image> rendered_views(std::span<const vec3> radiance, std::span<const CachePixel> pixels,
                                  std::span<const Image> edited, float gain) {
  std::vector<Image> rendered;
  for (const Image& view : edited) rendered.emplace_back(view.width, view.height, 3);
  for (size_t i = 0; i < radiance.size(); ++i) {
    vec3 shown;
    for (int c = 0; c < 3; ++c) shown[c] = srgb_from_linear(reinhard(gain * radiance[i][c]));
    rendered[pixels[i].view].set_rgb(pixels[i].x, pixels[i].y, shown);
  }
  return rendered;
}

void calibrate(LightCache& cache, std::span<const vec3> of_samples, std::span<const Image> clean,
               float gain) {
  constexpr float kBlack = 1e-4f;  // keeps the ratio of two black pixels at one
  std::vector<Image> targets;
  for (const Image& view : clean) targets.push_back(loss_target(view));
  for (size_t i = 0; i < cache.pixels.size(); ++i) {
    CachePixel& pixel = cache.pixels[i];
    vec3 shown(0.0f);
    for (size_t s = cache.first_sample[i]; s < cache.first_sample[i + 1]; ++s)
      shown += cache.samples[s].share * of_samples[s];
    const vec3 mapped = targets[pixel.view].rgb(pixel.x, pixel.y);
    const float error = edit_of(mapped, gain * shown / (1.0f + gain * shown));
    pixel.weight /= 1.0f + square(error / kHalfTrusted);
    const float unedited = 1.0f - glm::smoothstep(kLeastEdit, kFullEdit, edit_of(mapped, pixel.target));
    for (int c = 0; c < 3; ++c) {
      if (mapped[c] >= kClippedTarget) continue;  // anything that bright
      const float rendered = mapped[c] / (1.0f - mapped[c]);
      const float ratio = std::clamp((rendered + kBlack) / (gain * shown[c] + kBlack), 1.0f / kMaxCalibration,
                                     kMaxCalibration);
      pixel.calibration[c] = std::pow(ratio, unedited);
    }
  }
}

bool is_aligned_at(int iteration, int iterations) {
  for (const int hundredths : kAlignments)
    if (iteration == (iterations * hundredths + 99) / 100) return true;
  return false;
}

void align(std::vector<Image>& displacements, std::span<const Image> rendered, std::span<const Image> edited,
           std::span<const Image> weights) {
  parallel_for(0, static_cast<int64_t>(edited.size()), 1, [&](int64_t begin, int64_t end) {
    for (auto v = static_cast<size_t>(begin); v < static_cast<size_t>(end); ++v)
      displacements[v] = estimate_displacement(rendered[v], edited[v], weights[v], displacements[v]);
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

float psnr_of(std::span<const CachePixel> pixels, std::span<const vec3> radiance, float gain) {
  double error = 0;
  for (size_t i = 0; i < radiance.size(); ++i) {
    const CachePixel& pixel = pixels[i];
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
