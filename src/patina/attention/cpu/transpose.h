// Transposes of small matrices, for packing; blocks of 8 × 8 or 4 × 4 in registers where the processor has
// them.
#pragma once

#include <cstdint>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace patina::attention {

#if defined(__SSE2__)
/// The named size's block: to[c][r] = from[r][c], strides in elements.
inline void transpose_block(const uint16_t* from, int64_t from_stride, uint16_t* to, int64_t to_stride) {
  __m128i a[8], b[8];
  for (int r = 0; r < 8; ++r)
    a[r] = _mm_loadu_si128(reinterpret_cast<const __m128i*>(from + r * from_stride));
  for (int r = 0; r < 4; ++r) {  // rows r and r + 4 interleave
    b[2 * r] = _mm_unpacklo_epi16(a[r], a[r + 4]);
    b[2 * r + 1] = _mm_unpackhi_epi16(a[r], a[r + 4]);
  }
  for (int round = 0; round < 2; ++round) {  // twice more, and columns are rows
    for (int r = 0; r < 4; ++r) {
      a[2 * r] = _mm_unpacklo_epi16(b[r], b[r + 4]);
      a[2 * r + 1] = _mm_unpackhi_epi16(b[r], b[r + 4]);
    }
    for (int r = 0; r < 8; ++r) b[r] = a[r];
  }
  for (int c = 0; c < 8; ++c) _mm_storeu_si128(reinterpret_cast<__m128i*>(to + c * to_stride), b[c]);
}
inline void transpose_block(const uint32_t* from, int64_t from_stride, uint32_t* to, int64_t to_stride) {
  __m128i a[4];
  for (int r = 0; r < 4; ++r)
    a[r] = _mm_loadu_si128(reinterpret_cast<const __m128i*>(from + r * from_stride));
  const __m128i b0 = _mm_unpacklo_epi32(a[0], a[2]), b1 = _mm_unpackhi_epi32(a[0], a[2]),
                b2 = _mm_unpacklo_epi32(a[1], a[3]), b3 = _mm_unpackhi_epi32(a[1], a[3]);
  const __m128i columns[4] = {_mm_unpacklo_epi32(b0, b2), _mm_unpackhi_epi32(b0, b2),
                              _mm_unpacklo_epi32(b1, b3), _mm_unpackhi_epi32(b1, b3)};
  for (int c = 0; c < 4; ++c) _mm_storeu_si128(reinterpret_cast<__m128i*>(to + c * to_stride), columns[c]);
}
#endif

/// to[c · to_stride + r] = from[r · from_stride + c] for rows × columns elements of 16 or 32 bits; strides in
/// elements.
template <class T>
void transpose(const T* from, int64_t from_stride, int64_t rows, int64_t columns, T* to, int64_t to_stride) {
  int64_t block_rows = 0, block_columns = 0;
#if defined(__SSE2__)
  constexpr int64_t kSide = 16 / static_cast<int64_t>(sizeof(T));
  block_rows = rows / kSide * kSide, block_columns = columns / kSide * kSide;
  for (int64_t r = 0; r < block_rows; r += kSide)
    for (int64_t c = 0; c < block_columns; c += kSide)
      transpose_block(from + r * from_stride + c, from_stride, to + c * to_stride + r, to_stride);
#endif
  for (int64_t r = 0; r < rows; ++r)
    for (int64_t c = r < block_rows ? block_columns : 0; c < columns; ++c)
      to[c * to_stride + r] = from[r * from_stride + c];
}

}  // namespace patina::attention
