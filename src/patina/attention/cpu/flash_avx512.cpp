// The f32 kernel on AVX-512: sixteen lanes, thirty-two registers, one pass over the 64 lanes of a block.
#include <immintrin.h>

#include <cstdint>

#include "patina/attention/cpu/kernel.h"

namespace patina::attention {
namespace {

// Each stands on those above it.
#include "patina/attention/cpu/vec16.inl"

#include "patina/attention/cpu/exp2.inl"
#include "patina/attention/cpu/rows.inl"

#include "patina/attention/cpu/flash_f32.inl"

}  // namespace

Kernel avx512_kernel() {
  return {Packing::kF32, false, nullptr, attend<Vec16>};
}

}  // namespace patina::attention
