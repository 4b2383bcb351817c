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

constexpr int64_t kRowsPerTask = 16, kTexelsPerTask = 1 << 14;

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
      const float* in = row.data();
      float* out = fine.at(0, y);
      for (const UpsampleTap& tx : taps.x)
        for (int c = 0; c < channels; ++c) {
          const float a = in[tx.a * channels + c], b = in[tx.b * channels + c];
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

// What was not edited does not change.
void take_edited_share(const TextureField& field, Image& change) {
  const auto channels = static_cast<size_t>(change.channels);
  parallel_for(0, static_cast<int64_t>(field.edited.pixels.size()), kTexelsPerTask,
               [&](int64_t begin, int64_t end) {
                 for (auto t = static_cast<size_t>(begin); t < static_cast<size_t>(end); ++t)
                   for (size_t c = 0; c < channels; ++c)
                     change.pixels[t * channels + c] *= field.edited.pixels[t];
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
  field.levels.emplace_back(KindShares::kNumKinds, 1, channels);
  return field;
}

Image composed(const TextureField& field, std::span<const Image> levels) {
  const Image& of_kinds = levels.back();
  Image sum = levels[levels.size() - 2];
  for (size_t level = levels.size() - 2; level-- > 0;) {
    Image finer = levels[level];
    add_upsampled(field.delta, sum, finer);
    sum = std::move(finer);
  }
  const auto channels = static_cast<size_t>(sum.channels);
  parallel_for(0, static_cast<int64_t>(field.kinds.texels.size()), kTexelsPerTask,
               [&](int64_t begin, int64_t end) {
                 for (auto t = static_cast<size_t>(begin); t < static_cast<size_t>(end); ++t)
                   for (const auto& [kind, share] : field.kinds.texels[t])
                     for (size_t c = 0; c < channels; ++c)
                       sum.pixels[t * channels + c] += share * of_kinds.pixels[kind * channels + c];
               });
  take_edited_share(field, sum);
  return sum;
}

void compose(TextureField& field) {
  field.delta.texels = composed(field, field.levels);
}

std::vector<Image> restrict_to_levels(const TextureField& field, Image d_delta) {
  const int num_channels = d_delta.channels;
  take_edited_share(field, d_delta);
  std::vector<Image> gradients;
  gradients.push_back(std::move(d_delta));
  for (size_t level = 1; level + 1 < field.levels.size(); ++level) {
    Image coarse(field.levels[level].width, field.levels[level].height, num_channels);
    add_restricted(field.delta, gradients.back(), coarse);
    gradients.push_back(std::move(coarse));
  }
  // In double and block by block, in order: millions may belong to one kind.
  const auto channels = static_cast<size_t>(num_channels);
  const size_t num_texels = field.kinds.texels.size(), num_sums = KindShares::kNumKinds * channels,
               block_size = size_t{kTexelsPerTask}, num_blocks = (num_texels + block_size - 1) / block_size;
  std::vector<double> sums(num_blocks * num_sums);
  parallel_for(0, static_cast<int64_t>(num_blocks), 1, [&](int64_t begin, int64_t end) {
    for (auto block = static_cast<size_t>(begin); block < static_cast<size_t>(end); ++block)
      for (size_t t = block * block_size; t < std::min(num_texels, (block + 1) * block_size); ++t)
        for (const auto& [kind, share] : field.kinds.texels[t])
          for (size_t c = 0; c < channels; ++c)
            sums[block * num_sums + kind * channels + c] +=
                double{share} * gradients[0].pixels[t * channels + c];
  });
  gradients.emplace_back(KindShares::kNumKinds, 1, num_channels);
  for (size_t i = 0; i < num_sums; ++i) {
    double sum = 0;
    for (size_t block = 0; block < num_blocks; ++block) sum += sums[block * num_sums + i];
    gradients.back().pixels[i] = static_cast<float>(sum);
  }
  return gradients;
}

}  // namespace patina::inverse
