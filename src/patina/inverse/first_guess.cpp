#include "patina/inverse/first_guess.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "patina/base/parallel.h"
#include "patina/image/color.h"
#include "patina/inverse/loss.h"
#include "patina/inverse/shade.h"

namespace patina::inverse {
namespace {

constexpr std::array<float, 6> kRoughnesses{0.1f, 0.2f, 0.35f, 0.55f, 0.75f, 0.95f};
// Another guess has to leave less than this share of the starting values' loss (decision 0025), and to win at
// least so much for each fully weighted pixel.
constexpr double kMuchBetter = 0.4, kLeastGain = 0.005;
// Of one pixel: what cannot be explained at all counts no more.
constexpr float kMaxLoss = 1.0f;
// Enough to tell kinds apart. Of more rows, whole texels are left out.
constexpr size_t kEnoughRows = 1 << 16;

// A row of the taps that takes part, and the texel that it shows most of.
struct Row {
  uint32_t sample, texel;
  uint16_t kind;
};

std::vector<Row> chosen_rows(const LightCache& cache, const SampleTaps& taps,
                             std::span<const uint16_t> kinds) {
  const size_t stride = std::max<size_t>(1, taps.samples.size() / kEnoughRows);
  std::vector<Row> rows;
  for (size_t r = 0; r < taps.samples.size(); ++r) {
    // A pixel that shows several surfaces says little about one of them.
    if (cache.samples[taps.samples[r]].share < 1.0f) continue;
    Row row{taps.samples[r], 0, kinds[r]};
    float most = -1;
    for (uint32_t k = taps.row_begin[r]; k < taps.row_begin[r + 1]; ++k)
      if (taps.texel_taps[k].weight > most)
        most = taps.texel_taps[k].weight, row.texel = taps.texel_taps[k].index;
    if (((row.texel * 2654435761u) >> 12) % stride == 0) rows.push_back(row);
  }
  return rows;
}

// What a kind starts with: means over its pixels.
struct KindStart {
  double weight = 0, roughness = 0, metallic = 0;
};
std::vector<KindStart> starts_of(const LightCache& cache, std::span<const Row> rows, size_t num_kinds) {
  std::vector<KindStart> starts(num_kinds);
  for (const Row& row : rows) {
    const CacheSample& sample = cache.samples[row.sample];
    const double weight = cache.pixels[sample.pixel].weight;
    KindStart& start = starts[row.kind];
    start.weight += weight;
    start.roughness += weight * sample.base.roughness;
    start.metallic += weight * sample.base.metallic;
  }
  for (KindStart& start : starts)
    if (start.weight > 0) start.roughness /= start.weight, start.metallic /= start.weight;
  return starts;
}

struct Guess {
  float roughness, metallic;
};

// A row's residual as a line over its texel's base colour: slope · colour − wanted, of each channel.
struct Line {
  vec3 slope{0.0f}, wanted{0.0f};
};
std::vector<Line> lines_of(const LightCache& cache, render::BsdfModel model, float gain,
                           std::span<const Row> rows, const std::optional<Guess>& guess) {
  std::vector<Line> lines(rows.size());
  parallel_for(0, static_cast<int64_t>(rows.size()), 256, [&](int64_t begin, int64_t end) {
    Shader shader(model);
    for (auto r = static_cast<size_t>(begin); r < static_cast<size_t>(end); ++r) {
      const CacheSample& sample = cache.samples[rows[r].sample];
      const CachePixel& pixel = cache.pixels[sample.pixel];
      MapValues values = sample.base;
      if (guess) values.roughness = guess->roughness, values.metallic = guess->metallic;
      const auto shaded = [&](float color) {
        values.base_color = vec3(color);
        const Shading shading = shade_values(sample.point, values);
        return pixel.calibration * shader.shade(sample, shading, cache.lights_of(rows[r].sample));
      };
      const vec3 black = shaded(0.0f), white = shaded(1.0f);
      for (int c = 0; c < 3; ++c) {
        const float target = pixel.target[c];
        if (target >= kClippedTarget) continue;
        const float radiance = target / (1.0f - target) / gain;
        const float scale = gain * d_reinhard(gain * radiance) *
                            std::sqrt(pixel.weight / (3.0f * (target * target + kLossEpsilon)));
        lines[r].slope[c] = scale * (white[c] - black[c]);
        lines[r].wanted[c] = scale * (radiance - black[c]);
      }
    }
  });
  return lines;
}

// The loss of each kind where every texel has the colour that is best for all rows that show it.
std::vector<double> losses_of(std::span<const Row> rows, std::span<const Line> lines, size_t num_texels,
                              size_t num_kinds) {
  std::vector<vec3> squared(num_texels, vec3(0.0f)), crossed(num_texels, vec3(0.0f));
  for (size_t r = 0; r < rows.size(); ++r) {
    squared[rows[r].texel] += lines[r].slope * lines[r].slope;
    crossed[rows[r].texel] += lines[r].slope * lines[r].wanted;
  }
  std::vector<double> losses(num_kinds);
  for (size_t r = 0; r < rows.size(); ++r) {
    const vec3 color = glm::clamp(crossed[rows[r].texel] / glm::max(squared[rows[r].texel], vec3(1e-12f)),
                                  vec3(0.0f), vec3(1.0f));
    const vec3 residual = lines[r].slope * color - lines[r].wanted;
    losses[rows[r].kind] += std::min(kMaxLoss, glm::dot(residual, residual));
  }
  return losses;
}

}  // namespace

std::vector<std::optional<KindChange>> guess_changes(const LightCache& cache, render::BsdfModel model,
                                                     float gain, const SampleTaps& taps,
                                                     std::span<const uint16_t> kinds, size_t num_kinds) {
  const std::vector<Row> rows = chosen_rows(cache, taps, kinds);
  const std::vector<KindStart> starts = starts_of(cache, rows, num_kinds);
  std::vector<std::optional<KindChange>> changes(num_kinds);
  if (std::none_of(starts.begin(), starts.end(), [](const KindStart& start) { return start.metallic > 0.5; }))
    return changes;
  const auto losses = [&](const std::optional<Guess>& guess) {
    return losses_of(rows, lines_of(cache, model, gain, rows, guess), taps.texel_begin.size() - 1, num_kinds);
  };
  const std::vector<double> of_start = losses({});
  std::vector<double> least = of_start;
  std::vector<Guess> best(num_kinds);
  for (const float metallic : {0.0f, 1.0f})
    for (const float roughness : kRoughnesses) {
      const std::vector<double> loss = losses(Guess{roughness, metallic});
      for (size_t k = 0; k < num_kinds; ++k)
        if (loss[k] < least[k]) least[k] = loss[k], best[k] = {roughness, metallic};
    }

  for (size_t k = 0; k < num_kinds; ++k) {
    const bool is_better =
        least[k] < kMuchBetter * of_start[k] && of_start[k] - least[k] > kLeastGain * starts[k].weight;
    const double roughness = best[k].roughness - starts[k].roughness,
                 metallic = best[k].metallic - starts[k].metallic;
    if (is_better && metallic < -0.5)
      changes[k] = {static_cast<float>(roughness), static_cast<float>(metallic)};
  }
  return changes;
}

}  // namespace patina::inverse
