#include "patina/inverse/texture_field.h"

#include <algorithm>
#include <cmath>

#include "patina/asset/texel_index.h"
#include "patina/base/check.h"
#include "patina/base/parallel.h"

namespace patina::inverse {
namespace {

std::vector<UpsampleTap> upsample_taps(int fine, int coarse, asset::Wrap wrap) {
  std::vector<UpsampleTap> taps(static_cast<size_t>(fine));
  for (int i = 0; i < fine; ++i) {
    const float x =
        (static_cast<float>(i) + 0.5f) * static_cast<float>(coarse) / static_cast<float>(fine) - 0.5f;
    const int a = static_cast<int>(std::floor(x));
    taps[static_cast<size_t>(i)] = {asset::texel_index(a, coarse, wrap),
                                    asset::texel_index(a + 1, coarse, wrap), x - std::floor(x)};
  }
  return taps;
}

struct Taps {
  std::vector<UpsampleTap> x, y;
};
Taps taps_between(const asset::Map& map, const Image& fine, const Image& coarse) {
  return {upsample_taps(fine.width, coarse.width, map.wrap_s),
          upsample_taps(fine.height, coarse.height, map.wrap_t)};
}

constexpr int64_t kRowsPerTask = 16;
constexpr int64_t kNumbersPerTask = 1 << 15;

// fine += upsampled coarse.
void add_upsampled(const asset::Map& map, const Image& coarse, Image& fine) {
  const Taps taps = taps_between(map, fine, coarse);
  const int channels = fine.channels;
  parallel_for(0, fine.height, kRowsPerTask, [&](int64_t begin, int64_t end) {
    std::vector<float> row(static_cast<size_t>(coarse.width) * static_cast<size_t>(channels));
    for (int y = static_cast<int>(begin); y < end; ++y) {
      const UpsampleTap& ty = taps.y[static_cast<size_t>(y)];
      const float *row_a = coarse.at(0, ty.a), *row_b = coarse.at(0, ty.b);
      for (size_t i = 0; i < row.size(); ++i) row[i] = row_a[i] + ty.weight_b * (row_b[i] - row_a[i]);
      float* out = fine.at(0, y);
      for (const UpsampleTap& tx : taps.x)
        for (int c = 0; c < channels; ++c) {
          const float a = row[static_cast<size_t>(tx.a * channels + c)],
                      b = row[static_cast<size_t>(tx.b * channels + c)];
          *out++ += a + tx.weight_b * (b - a);
        }
    }
  });
}

// coarse += transpose of add_upsampled applied to fine: first along the rows, then every coarse row gathers
// the fine rows that read it, in order.
void add_restricted(const asset::Map& map, const Image& fine, Image& coarse) {
  const Taps taps = taps_between(map, fine, coarse);
  const int channels = fine.channels;
  Image narrow(coarse.width, fine.height, channels);
  parallel_for(0, fine.height, kRowsPerTask, [&](int64_t begin, int64_t end) {
    for (int y = static_cast<int>(begin); y < end; ++y) {
      const float* in = fine.at(0, y);
      float* row = narrow.at(0, y);
      for (const UpsampleTap& tx : taps.x)
        for (int c = 0; c < channels; ++c) {
          const float value = *in++;
          row[tx.a * channels + c] += (1.0f - tx.weight_b) * value;
          row[tx.b * channels + c] += tx.weight_b * value;
        }
    }
  });
  struct Reader {
    int fine_row;
    float weight;
  };
  std::vector<std::vector<Reader>> readers(static_cast<size_t>(coarse.height));
  for (int y = 0; y < fine.height; ++y) {
    const UpsampleTap& ty = taps.y[static_cast<size_t>(y)];
    readers[static_cast<size_t>(ty.a)].push_back({y, 1.0f - ty.weight_b});
    readers[static_cast<size_t>(ty.b)].push_back({y, ty.weight_b});
  }
  const auto row_length = static_cast<size_t>(coarse.width) * static_cast<size_t>(channels);
  parallel_for(0, coarse.height, kRowsPerTask, [&](int64_t begin, int64_t end) {
    for (auto y = static_cast<size_t>(begin); y < static_cast<size_t>(end); ++y) {
      float* out = coarse.at(0, static_cast<int>(y));
      for (const Reader& reader : readers[y]) {
        const float* in = narrow.at(0, reader.fine_row);
        for (size_t i = 0; i < row_length; ++i) out[i] += reader.weight * in[i];
      }
    }
  });
}

}  // namespace

TextureField make_field(const asset::Map& map, int width, int height, int channels) {
  PATINA_CHECK(width > 0 && height > 0 && channels > 0);
  constexpr int kCoarsestSide = 8;
  TextureField field;
  field.delta.uv_set = map.uv_set;
  field.delta.uv_transform = map.uv_transform;
  field.delta.wrap_s = map.wrap_s;
  field.delta.wrap_t = map.wrap_t;
  field.delta.texels = Image(width, height, channels);
  for (int w = width, h = height;; w = (w + 1) / 2, h = (h + 1) / 2) {
    field.levels.emplace_back(w, h, channels);
    if (std::max(w, h) <= kCoarsestSide) break;
  }
  field.first_moment = field.levels;
  field.second_moment = field.levels;
  field.num_steps.assign(field.levels.size(), 0);
  return field;
}

void compose(TextureField& field) {
  Image sum = field.levels.back();
  for (size_t level = field.levels.size() - 1; level-- > 0;) {
    Image finer = field.levels[level];
    add_upsampled(field.delta, sum, finer);
    sum = std::move(finer);
  }
  field.delta.texels = std::move(sum);
}

std::vector<Image> restrict_to_levels(const TextureField& field, const Image& d_delta) {
  std::vector<Image> gradients;
  gradients.push_back(d_delta);
  for (size_t level = 1; level < field.levels.size(); ++level) {
    Image coarse(field.levels[level].width, field.levels[level].height, d_delta.channels);
    add_restricted(field.delta, gradients.back(), coarse);
    gradients.push_back(std::move(coarse));
  }
  return gradients;
}

void adam_step(TextureField& field, const std::vector<Image>& gradients, int finest,
               const AdamOptions& options) {
  PATINA_CHECK_EQ(gradients.size(), field.levels.size());
  for (size_t level = static_cast<size_t>(finest); level < field.levels.size(); ++level) {
    const std::vector<float>& gradient = gradients[level].pixels;
    std::vector<float>& m = field.first_moment[level].pixels;
    std::vector<float>& v = field.second_moment[level].pixels;
    std::vector<float>& x = field.levels[level].pixels;
    const auto step = static_cast<float>(++field.num_steps[level]);
    const float m_scale = 1.0f / (1.0f - std::pow(options.beta1, step));
    const float v_scale = 1.0f / (1.0f - std::pow(options.beta2, step));
    // Only texels that ever had a gradient count for the mean: most of a level may lie between the islands.
    // Sums go by blocks of one size, whatever the number of threads.
    struct BlockSum {
      double v = 0;
      size_t num_reached = 0;
    };
    const auto count = static_cast<int64_t>(x.size());
    const int64_t num_blocks = (count + kNumbersPerTask - 1) / kNumbersPerTask;
    std::vector<BlockSum> sums(static_cast<size_t>(num_blocks));
    const auto block_range = [&](int64_t block) {
      return std::pair(static_cast<size_t>(block * kNumbersPerTask),
                       static_cast<size_t>(std::min(count, (block + 1) * kNumbersPerTask)));
    };
    parallel_for(0, num_blocks, 1, [&](int64_t begin, int64_t end) {
      for (int64_t block = begin; block < end; ++block) {
        const auto [first, last] = block_range(block);
        BlockSum sum;
        for (size_t i = first; i < last; ++i) {
          m[i] = options.beta1 * m[i] + (1.0f - options.beta1) * gradient[i];
          v[i] = options.beta2 * v[i] + (1.0f - options.beta2) * gradient[i] * gradient[i];
          sum.v += v[i];
          sum.num_reached += v[i] > 0.0f;
        }
        sums[static_cast<size_t>(block)] = sum;
      }
    });
    BlockSum total;
    for (const BlockSum& sum : sums) total.v += sum.v, total.num_reached += sum.num_reached;
    if (total.num_reached == 0) continue;
    const float rms =
        std::sqrt(v_scale * static_cast<float>(total.v / static_cast<double>(total.num_reached)));
    const float epsilon = options.relative_epsilon * rms + 1e-20f;
    parallel_for(0, num_blocks, 1, [&](int64_t begin, int64_t end) {
      const size_t first = block_range(begin).first, last = block_range(end - 1).second;
      for (size_t i = first; i < last; ++i)
        x[i] -= options.learning_rate * m_scale * m[i] / (std::sqrt(v_scale * v[i]) + epsilon);
    });
  }
  compose(field);
}

}  // namespace patina::inverse
