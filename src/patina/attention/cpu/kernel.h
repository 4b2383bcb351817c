// What the driver hands to an instruction set's kernel: one block of queries of one head against all keys, or
// against one panel of them after the other, everything packed.
//
// A kernel computes transposed products, so that vector lanes are queries: Sᵀ = K Qᵀ, Oᵀ = Vᵀ Pᵀ. Maxima and
// sums of the softmax are then vertical, keys and values are broadcast from row-major memory, and any
// head_dim works without padding the lanes.
#pragma once

#include <cstdint>

#include "patina/attention/attention.h"
#include "patina/attention/query_blocks.h"

namespace patina::attention {

inline constexpr int kTileKeysMax = 128;  // bound of the kernels' tile lengths

/// How packed keys and values lie in memory; queries follow the keys' element. Padding is zero.
enum class Packing {
  kF32,        // q [d][64] f32 times scale·log2 e;   k [n][d] f32;        v [n][d] f32
  kBf16Pairs,  // q [d₂/2][64][2] bf16 unscaled;      k [n₁₆][d₂] bf16;    v [n₂/2][d][2] bf16
  kBf16Tiles,  // tiles of 1 KiB, bf16: q [64/16][d₃₂/32][16 pairs][16 lanes][2] unscaled;
               // k [n₁₂₈/16][d₃₂/32][16 keys][32];   v [n₁₂₈/32][r][16 dimensions][32 keys], r = d/16 + 1,
               // whose row d is 1 for each key: it sums the weights
};
// d₂, n₁₆: head_dim or number of keys rounded up to 2, to 16; and so on.

struct Block {
  const void* q = nullptr;
  const void* k = nullptr;
  const void* v = nullptr;
  int64_t num_keys = 0;
  int64_t begin_key = 0, end_key = 0;  // this call's panel; the last one ends at num_keys
  int head_dim = 0;
  int num_lanes = kBlockQueries;      // lanes beyond hold zeros and are not read back
  float score_scale = 1;              // bf16 packings: scale · log2 e, applied to the products; 1 for kF32
  float beta = 0;                     // β · log2 e
  const BiasedKey* biased = nullptr;  // ascending keys, ended by one with key = INT32_MAX
  uint64_t immoderate_lanes = 0;      // kBf16Tiles: lanes with a query, or all if a key or value is, NaN,
                                      // infinite or beyond kModerate
  float* state = nullptr;  // what a kernel that takes panels keeps of the block between them, 64-byte aligned
  float* scratch = nullptr;  // [kTileKeysMax][64] f32 and [kTileKeysMax][64] bf16 behind it, 64-byte aligned
  float* out = nullptr;      // [d₁₆][64] f32, divided by the sum; written with the last panel, as is
  float* log_sum_exp = nullptr;  // [64] natural log
};
inline constexpr int64_t kScratchFloats = kTileKeysMax * kBlockQueries * 3 / 2;
inline constexpr int kModerate = 20;  // moderate: below 2^20 in magnitude

struct Kernel {
  Packing packing;
  bool takes_panels;                      // else one call sees all keys
  int64_t (*state_floats)(int head_dim);  // of one block; null: none
  void (*attend)(const Block& block);
};

/// One translation unit each, compiled for its instruction set. They hold no function that another unit could
/// share: the linker must not pick an AVX-512 copy of an inline function for a machine without it.
Kernel generic_kernel();
#ifdef PATINA_X86_KERNELS
Kernel avx2_kernel();
Kernel avx512_kernel();
Kernel avx512_bf16_kernel();
Kernel amx_bf16_kernel();
#endif

/// Runs a kernel over all batches, heads and query blocks (driver.cpp).
void run_blocks(const Arguments& arguments, const Kernel& kernel);

}  // namespace patina::attention
