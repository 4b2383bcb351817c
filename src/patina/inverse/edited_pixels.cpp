#include "patina/inverse/edited_pixels.h"

#include <algorithm>
#include <cmath>

#include "patina/base/parallel.h"
#include "patina/inverse/loss.h"

namespace patina::inverse {
namespace {

// Change of a surface up to which it was not edited, and from which on it was. A mean over many pixels: the
// noise of a single one, which calibrate() judges, is larger.
constexpr float kNoEdit = 0.007f, kFullEdit = 0.02f;
// The window around a pixel reaches the side of a view divided by this, each way.
constexpr int kReachesPerSide = 64;

}  // namespace

float edit_of(const vec3& clean, const vec3& edited) {
  constexpr float kDark = 0.05f;
  return max_component(glm::abs(edited - clean) / (glm::max(edited, clean) + kDark));
}

std::vector<float> edited_pixels(const LightCache& cache, const views::ViewSet& views,
                                 std::span<const Image> clean) {
  std::vector<Image> changes;  // [H,W,2] squared change and one where a pixel counts
  for (const Image& view : clean) changes.emplace_back(view.width, view.height, 2);
  std::vector<Image> targets;
  for (const Image& view : clean) targets.push_back(loss_target(view));
  for (const CachePixel& pixel : cache.pixels) {
    float* change = changes[pixel.view].at(pixel.x, pixel.y);
    change[0] = square(edit_of(targets[pixel.view].rgb(pixel.x, pixel.y), pixel.target));
    change[1] = 1.0f;
  }
  std::vector<float> edited(cache.pixels.size());
  parallel_for(0, static_cast<int64_t>(edited.size()), 256, [&](int64_t begin, int64_t end) {
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      const CachePixel& pixel = cache.pixels[i];
      const Image& change = changes[pixel.view];
      const std::vector<int32_t>& material = views.views[pixel.view].gbuffer.material;
      const auto at = [&](int x, int y) { return static_cast<size_t>(y) * change.width + x; };
      const int reach = std::max(1, change.width / kReachesPerSide);
      float squared = 0, count = 0;
      for (int y = std::max(0, pixel.y - reach); y <= std::min(change.height - 1, pixel.y + reach); ++y)
        for (int x = std::max(0, pixel.x - reach); x <= std::min(change.width - 1, pixel.x + reach); ++x) {
          if (material[at(x, y)] != material[at(pixel.x, pixel.y)]) continue;
          squared += change.at(x, y)[0], count += change.at(x, y)[1];
        }
      edited[i] = glm::smoothstep(kNoEdit, kFullEdit, std::sqrt(squared / count));
    }
  });
  return edited;
}

Image edited_texels(const LightCache& cache, std::span<const float> edited, const SampleTaps& taps, int width,
                    int height) {
  std::vector<float> values(2 * cache.samples.size());  // how much a sample was edited, and that there is one
  for (size_t s = 0; s < cache.samples.size(); ++s)
    values[2 * s] = edited[cache.samples[s].pixel], values[2 * s + 1] = 1.0f;
  Image seen(width, height, 2), out(width, height, 1, 1.0f);
  gather_from_samples(taps, values.data(), 2, seen);
  for (size_t t = 0; t < out.num_pixels(); ++t)
    if (seen.pixels[2 * t + 1] > 0.0f) out.pixels[t] = seen.pixels[2 * t] / seen.pixels[2 * t + 1];
  return out;
}

}  // namespace patina::inverse
