#include "patina/nn/pointwise.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <vector>

#include "patina/base/parallel.h"
#include "patina/base/vector_clones.h"

#define PATINA_INLINE inline __attribute__((always_inline))

namespace patina::nn {
namespace {

constexpr int64_t kNumbersAShare = 1 << 15;  // of a thread at least

PATINA_INLINE float load(float x) {
  return x;
}
PATINA_INLINE float load(Bf16 x) {
  return std::bit_cast<float>(static_cast<uint32_t>(x.bits) << 16);
}
PATINA_INLINE void store(float value, float& to) {
  to = value;
}
/// To the nearest, ties to even; not-a-number stays one.
PATINA_INLINE void store(float value, Bf16& to) {
  const auto bits = std::bit_cast<uint32_t>(value);
  const uint32_t rounded = (bits + 0x7FFFu + ((bits >> 16) & 1u)) >> 16;
  to.bits = static_cast<uint16_t>((bits & 0x7FFFFFFFu) > 0x7F800000u ? 0x7FC0u : rounded);
}

/// eˣ to 2e-7 of itself for x in [-87, 88], clamped beyond: 2ⁿ times a polynomial on half a power of two
/// around zero. Without branches, so that compilers make vectors of it.
PATINA_INLINE float exponential(float x) {
  constexpr float kLog2E = 1.44269504f, kLn2High = 0.693359375f, kLn2Low = -2.12194440e-4f;
  constexpr float kRounding = 12582912.0f;  // 1.5 · 2²³: adding it leaves the nearest integer in the low bits
  const float clamped = std::min(std::max(x, -87.0f), 88.0f);
  const float shifted = clamped * kLog2E + kRounding;
  const float n = shifted - kRounding;
  const float r = (clamped - n * kLn2High) - n * kLn2Low;
  float p = 1.0f / 720.0f;
  p = p * r + 1.0f / 120.0f;
  p = p * r + 1.0f / 24.0f;
  p = p * r + 1.0f / 6.0f;
  p = p * r + 0.5f;
  p = p * r + 1.0f;
  p = p * r + 1.0f;
  const uint32_t scale = (std::bit_cast<uint32_t>(shifted) << 23) + 0x3F800000u;
  return p * std::bit_cast<float>(scale);
}

PATINA_INLINE float silu(float x) {
  return x / (1.0f + exponential(-x));
}

PATINA_INLINE float gelu(float x) {
  const float z = std::abs(x) * 0.707106781f, t = 1.0f / (1.0f + 0.3275911f * z);
  float p = 1.061405429f;
  p = p * t - 1.453152027f;
  p = p * t + 1.421413741f;
  p = p * t - 0.284496736f;
  p = p * t + 0.254829592f;
  const float tail = p * t * exponential(-z * z);  // 1 − erf(z)
  return x >= 0 ? x - 0.5f * x * tail : 0.5f * x * tail;
}

/// Σ (x − pivot) and Σ (x − pivot)² of every channel over `rows` rows.
template <class T>
PATINA_INLINE void sums_inline(const T* x, int64_t rows, int64_t channels, const float* pivot, float* sum,
                               float* square) {
  std::fill_n(sum, channels, 0.0f);
  std::fill_n(square, channels, 0.0f);
  for (int64_t row = 0; row < rows; ++row, x += channels) {
    for (int64_t c = 0; c < channels; ++c) {
      const float d = load(x[c]) - pivot[c];
      sum[c] += d;
      square[c] += d * d;
    }
  }
}

template <class T>
PATINA_INLINE void affine_inline(const T* x, T* y, int64_t rows, int64_t channels, const float* scale,
                                 const float* offset, bool activated) {
  for (int64_t row = 0; row < rows; ++row, x += channels, y += channels) {
    if (activated) {
      for (int64_t c = 0; c < channels; ++c) store(silu(load(x[c]) * scale[c] + offset[c]), y[c]);
    } else {
      for (int64_t c = 0; c < channels; ++c) store(load(x[c]) * scale[c] + offset[c], y[c]);
    }
  }
}

template <class T>
PATINA_INLINE void layer_norm_inline(const T* x, T* y, int64_t rows, int64_t channels, const NormWeights& w) {
  constexpr int kLanes = 16;
  const auto reduced = [&](auto term) {
    float lanes[kLanes] = {};
    int64_t c = 0;
    for (; c + kLanes <= channels; c += kLanes)
      for (int k = 0; k < kLanes; ++k) lanes[k] += term(c + k);
    float total = 0;
    for (; c < channels; ++c) total += term(c);
    for (const float lane : lanes) total += lane;
    return total;
  };
  const float count = static_cast<float>(channels);
  for (int64_t row = 0; row < rows; ++row, x += channels, y += channels) {
    const float mean = reduced([&](int64_t c) { return load(x[c]); }) / count;
    const float variance = reduced([&](int64_t c) {
                             const float d = load(x[c]) - mean;
                             return d * d;
                           }) /
                           count;
    const float scale = 1.0f / std::sqrt(variance + w.epsilon);
    for (int64_t c = 0; c < channels; ++c) store((load(x[c]) - mean) * scale * w.gain[c] + w.bias[c], y[c]);
  }
}

template <class T>
PATINA_INLINE void geglu_inline(const T* x, T* y, int64_t rows, int64_t channels) {
  for (int64_t row = 0; row < rows; ++row, x += 2 * channels, y += channels)
    for (int64_t c = 0; c < channels; ++c) store(load(x[c]) * gelu(load(x[channels + c])), y[c]);
}

// One function a number type: clones cannot be templates.
PATINA_VECTOR_CLONES void sums(const float* x, int64_t rows, int64_t channels, const float* pivot, float* sum,
                               float* square) {
  sums_inline(x, rows, channels, pivot, sum, square);
}
PATINA_VECTOR_CLONES void sums(const Bf16* x, int64_t rows, int64_t channels, const float* pivot, float* sum,
                               float* square) {
  sums_inline(x, rows, channels, pivot, sum, square);
}
PATINA_VECTOR_CLONES void affine(const float* x, float* y, int64_t rows, int64_t channels, const float* scale,
                                 const float* offset, bool activated) {
  affine_inline(x, y, rows, channels, scale, offset, activated);
}
PATINA_VECTOR_CLONES void affine(const Bf16* x, Bf16* y, int64_t rows, int64_t channels, const float* scale,
                                 const float* offset, bool activated) {
  affine_inline(x, y, rows, channels, scale, offset, activated);
}
PATINA_VECTOR_CLONES void layer_norm_rows(const float* x, float* y, int64_t rows, int64_t channels,
                                          const NormWeights& weights) {
  layer_norm_inline(x, y, rows, channels, weights);
}
PATINA_VECTOR_CLONES void layer_norm_rows(const Bf16* x, Bf16* y, int64_t rows, int64_t channels,
                                          const NormWeights& weights) {
  layer_norm_inline(x, y, rows, channels, weights);
}
PATINA_VECTOR_CLONES void geglu_rows(const float* x, float* y, int64_t rows, int64_t channels) {
  geglu_inline(x, y, rows, channels);
}
PATINA_VECTOR_CLONES void geglu_rows(const Bf16* x, Bf16* y, int64_t rows, int64_t channels) {
  geglu_inline(x, y, rows, channels);
}

int64_t rows_a_share(int64_t channels) {
  return std::max<int64_t>(1, kNumbersAShare / std::max<int64_t>(1, channels));
}

/// Per channel of one image: y = scale · x + offset is its group norm.
template <class T>
void norm_as_affine(const T* x, int64_t pixels, int64_t channels, int64_t groups, const NormWeights& weights,
                    float* scale, float* offset) {
  // Sums about the first pixel, so that a mean that is large against the spread costs no digits; in shares of
  // fixed size, so that the result does not depend on the number of threads.
  std::vector<float> pivot(static_cast<size_t>(channels));
  for (int64_t c = 0; c < channels; ++c) pivot[static_cast<size_t>(c)] = load(x[c]);
  const int64_t share = rows_a_share(channels), shares = (pixels + share - 1) / share;
  std::vector<float> partial(static_cast<size_t>(2 * shares * channels));
  parallel_for(0, shares, 1, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      float* sum = partial.data() + 2 * i * channels;
      sums(x + i * share * channels, std::min(share, pixels - i * share), channels, pivot.data(), sum,
           sum + channels);
    }
  });
  const int64_t width = channels / groups;
  const auto count = static_cast<double>(pixels);
  std::vector<double> sum(static_cast<size_t>(channels)), square(static_cast<size_t>(channels));
  for (int64_t i = 0; i < shares; ++i) {
    for (int64_t c = 0; c < channels; ++c) {
      sum[static_cast<size_t>(c)] += partial[static_cast<size_t>(2 * i * channels + c)];
      square[static_cast<size_t>(c)] += partial[static_cast<size_t>((2 * i + 1) * channels + c)];
    }
  }
  for (int64_t g = 0; g < groups; ++g) {
    const auto of_group = [&](auto term) {
      double total = 0;
      for (int64_t c = g * width; c < (g + 1) * width; ++c) total += term(static_cast<size_t>(c));
      return total / (count * static_cast<double>(width));
    };
    const double mean = of_group([&](size_t c) { return count * pivot[c] + sum[c]; });
    const double variance = of_group([&](size_t c) {
      const double d = pivot[c] - mean;
      return square[c] + 2 * d * sum[c] + count * d * d;
    });
    const double factor = 1 / std::sqrt(variance + static_cast<double>(weights.epsilon));
    for (int64_t c = g * width; c < (g + 1) * width; ++c) {
      scale[c] = static_cast<float>(factor * weights.gain[c]);
      offset[c] = static_cast<float>(weights.bias[c] - mean * factor * weights.gain[c]);
    }
  }
}

}  // namespace

template <class T>
void group_norm(const T* x, T* y, int64_t batch, int64_t pixels, int64_t channels, int64_t groups,
                const NormWeights& weights, Activation activation) {
  std::vector<float> scale(static_cast<size_t>(channels)), offset(static_cast<size_t>(channels));
  for (int64_t image = 0; image < batch; ++image) {
    const T* from = x + image * pixels * channels;
    T* to = y + image * pixels * channels;
    norm_as_affine(from, pixels, channels, groups, weights, scale.data(), offset.data());
    parallel_for(0, pixels, rows_a_share(channels), [&](int64_t begin, int64_t end) {
      affine(from + begin * channels, to + begin * channels, end - begin, channels, scale.data(),
             offset.data(), activation == Activation::kSilu);
    });
  }
}

template <class T>
void layer_norm(const T* x, T* y, int64_t rows, int64_t channels, const NormWeights& weights) {
  parallel_for(0, rows, rows_a_share(channels), [&](int64_t begin, int64_t end) {
    layer_norm_rows(x + begin * channels, y + begin * channels, end - begin, channels, weights);
  });
}

template <class T>
void geglu(const T* x, T* y, int64_t rows, int64_t channels) {
  parallel_for(0, rows, rows_a_share(2 * channels), [&](int64_t begin, int64_t end) {
    geglu_rows(x + 2 * begin * channels, y + begin * channels, end - begin, channels);
  });
}

template void group_norm(const float*, float*, int64_t, int64_t, int64_t, int64_t, const NormWeights&,
                         Activation);
template void group_norm(const Bf16*, Bf16*, int64_t, int64_t, int64_t, int64_t, const NormWeights&,
                         Activation);
template void layer_norm(const float*, float*, int64_t, int64_t, const NormWeights&);
template void layer_norm(const Bf16*, Bf16*, int64_t, int64_t, const NormWeights&);
template void geglu(const float*, float*, int64_t, int64_t);
template void geglu(const Bf16*, Bf16*, int64_t, int64_t);

}  // namespace patina::nn
