#include <immintrin.h>

#include "patina/nn/winograd_kernel.h"

#define PATINA_INLINE inline __attribute__((always_inline))

namespace patina::nn::winograd {
namespace {

PATINA_INLINE __m512 load16(const Bf16* from) {
  const __m256i bits = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from));
  return _mm512_castsi512_ps(_mm512_slli_epi32(_mm512_cvtepu16_epi32(bits), 16));
}

PATINA_INLINE void store16(__m512 values, void* to) {
  _mm256_storeu_si256(static_cast<__m256i*>(to), reinterpret_cast<__m256i>(_mm512_cvtneps_pbh(values)));
}

/// One axis of Bᵀ d B.
PATINA_INLINE void transform4(__m512& a, __m512& b, __m512& c, __m512& d) {
  const __m512 sum = _mm512_add_ps(b, c), difference = _mm512_sub_ps(c, b);
  a = _mm512_sub_ps(a, c);
  d = _mm512_sub_ps(b, d);
  b = sum, c = difference;
}

/// R tiles by 16·C output channels.
template <int R, int C>
PATINA_INLINE void multiply_rows(const uint32_t* v, const uint32_t* u, int64_t pairs, float* m) {
  __m512 sum[R][C];
  for (int r = 0; r < R; ++r)
    for (int c = 0; c < C; ++c) sum[r][c] = _mm512_setzero_ps();
  for (int64_t i = 0; i < pairs; ++i) {
    __m512bh column[C];
    for (int c = 0; c < C; ++c)
      column[c] = reinterpret_cast<__m512bh>(_mm512_loadu_si512(u + i * kPanel + c * 16));
#pragma GCC unroll 8
    for (int r = 0; r < R; ++r) {
      const auto pair = reinterpret_cast<__m512bh>(_mm512_set1_epi32(static_cast<int>(v[r * pairs + i])));
      for (int c = 0; c < C; ++c) sum[r][c] = _mm512_dpbf16_ps(sum[r][c], pair, column[c]);
    }
  }
  for (int r = 0; r < R; ++r)
    for (int c = 0; c < C; ++c) _mm512_storeu_ps(m + r * kPanel + c * 16, sum[r][c]);
}

template <int C>
void multiply_columns(const uint32_t* v, const uint32_t* u, int64_t count, int64_t pairs, float* m) {
  constexpr int kRows = 6;  // by four columns: 24 of 32 registers accumulate
  int64_t row = 0;
  for (; row + kRows <= count; row += kRows)
    multiply_rows<kRows, C>(v + row * pairs, u, pairs, m + row * kPanel);
  for (; row + 2 <= count; row += 2) multiply_rows<2, C>(v + row * pairs, u, pairs, m + row * kPanel);
  for (; row < count; ++row) multiply_rows<1, C>(v + row * pairs, u, pairs, m + row * kPanel);
}

}  // namespace

void transform_input(const Bf16* x, const Tiles& tiles, int64_t channels, uint32_t* v) {
  const int64_t across = (tiles.width + 1) / 2;
  for (int64_t t = 0; t < tiles.count; ++t) {
    const int64_t top = (tiles.first + t) / across * 2 - 1, left = (tiles.first + t) % across * 2 - 1;
    const Bf16* pixels[16];  // null outside the image
    for (int64_t i = 0; i < 16; ++i) {
      const int64_t row = top + i / 4, column = left + i % 4;
      const bool inside = row >= 0 && row < tiles.height && column >= 0 && column < tiles.width;
      pixels[i] = inside ? x + (row * tiles.width + column) * channels : nullptr;
    }
    for (int64_t c = 0; c < channels; c += 16) {
      __m512 d[16];
      for (int i = 0; i < 16; ++i) d[i] = pixels[i] ? load16(pixels[i] + c) : _mm512_setzero_ps();
      for (int i = 0; i < 4; ++i) transform4(d[i], d[4 + i], d[8 + i], d[12 + i]);
      for (int i = 0; i < 16; i += 4) transform4(d[i], d[i + 1], d[i + 2], d[i + 3]);
      for (int i = 0; i < 16; ++i) store16(d[i], v + ((i * tiles.count + t) * channels + c) / 2);
    }
  }
}

void multiply(const uint32_t* v, const uint32_t* u, int64_t count, int64_t pairs, int64_t out, float* m) {
  for (int64_t f = 0; f < kFrequencies; ++f) {
    const uint32_t* rows = v + f * count * pairs;
    const uint32_t* columns = u + f * pairs * kPanel;
    float* sums = m + f * count * kPanel;
    switch (out / 16) {
      case 1:
        multiply_columns<1>(rows, columns, count, pairs, sums);
        break;
      case 2:
        multiply_columns<2>(rows, columns, count, pairs, sums);
        break;
      case 3:
        multiply_columns<3>(rows, columns, count, pairs, sums);
        break;
      default:
        multiply_columns<4>(rows, columns, count, pairs, sums);
    }
  }
}

void transform_output(const float* m, const Tiles& tiles, const float* bias, int64_t out, int64_t first,
                      int64_t channels, Bf16* y) {
  const int64_t across = (tiles.width + 1) / 2;
  for (int64_t t = 0; t < tiles.count; ++t) {
    const int64_t top = (tiles.first + t) / across * 2, left = (tiles.first + t) % across * 2;
    const bool below = top + 1 < tiles.height, beside = left + 1 < tiles.width;
    Bf16* const corner = y + (top * tiles.width + left) * channels + first;
    for (int64_t c = 0; c < out; c += 16) {
      // Aᵀ m A, columns first.
      __m512 upper[4], lower[4];
      for (int i = 0; i < 4; ++i) {
        const auto at = [&](int row) {
          return _mm512_loadu_ps(m + ((4 * row + i) * tiles.count + t) * kPanel + c);
        };
        const __m512 m1 = at(1), m2 = at(2);
        upper[i] = _mm512_add_ps(at(0), _mm512_add_ps(m1, m2));
        lower[i] = _mm512_sub_ps(_mm512_sub_ps(m1, m2), at(3));
      }
      const __m512 b = _mm512_loadu_ps(bias + c);
      const auto left_of = [&](const __m512(&h)[4]) {
        return _mm512_add_ps(_mm512_add_ps(h[0], _mm512_add_ps(h[1], h[2])), b);
      };
      const auto right_of = [&](const __m512(&h)[4]) {
        return _mm512_add_ps(_mm512_sub_ps(_mm512_sub_ps(h[1], h[2]), h[3]), b);
      };
      store16(left_of(upper), corner + c);
      if (beside) store16(right_of(upper), corner + channels + c);
      if (below) store16(left_of(lower), corner + tiles.width * channels + c);
      if (below && beside) store16(right_of(lower), corner + (tiles.width + 1) * channels + c);
    }
  }
}

}  // namespace patina::nn::winograd
