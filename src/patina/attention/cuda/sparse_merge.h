// The bias of attention.h on a CUDA device: given ordinary attention and its log-sum-exp, from whatever
// kernel is fastest there, adds to each row what its biased keys are worth more, in place. Exact, O(N)
// memory; docs/attention.md has the identity. Pointers and sizes only; no CUDA or Torch type passes here.
#pragma once

#include "patina/attention/attention.h"
#include "patina/attention/cuda/bias_tiles.h"

namespace patina::attention::cuda {

enum class Element16 { kBf16, kF16 };

/// Below it the merge would subtract nearly all of a row that is nearly all biased: the rounding of the dense
/// result grows by up to e^-β, here 2.7.
inline constexpr float kMinBeta = -1;
inline constexpr int64_t kMaxHeadDim = 256;

/// All pointers are device memory. q, k, v and out are 16-byte aligned, their strides multiples of 8
/// elements, head_dim a multiple of 8 up to kMaxHeadDim.
struct SparseMerge {
  Shape shape;  // num_queries = num_keys = the tiles' num_queries
  Element16 element = Element16::kBf16;
  const void* q = nullptr;
  const void* k = nullptr;
  const void* v = nullptr;
  void* out = nullptr;           // before: ordinary attention of q, k, v; after: biased
  float* log_sum_exp = nullptr;  // before: natural log of Σ e^s; after: with the bias
  Strides q_strides, k_strides, v_strides, out_strides;
  Strides log_sum_exp_strides;
  float scale = 0;  // 1/√head_dim, as the dense kernel was given
  float beta = 0;   // kMinBeta to attention::kMaxBeta; 0 leaves every bit as it is

  // BiasTiles, copied to the device.
  const TiledBlock* blocks = nullptr;
  const int32_t* keys = nullptr;
  const uint32_t* masks = nullptr;
  int32_t num_blocks = 0, row_stride = 0;
};

/// Throws Error{kUsage} if the above does not hold.
void validate(const SparseMerge& merge);

/// Enqueues the kernel on `stream` (a cudaStream_t) of the current device; compute capability 8.0 or newer.
/// Rows without biased keys keep every bit. NaN in a row's inputs gives NaN in that row, as does a score of
/// +inf of a biased key. Throws Error{kDevice} with CUDA's reason. Defined where CUDA is built in.
void sparse_merge(const SparseMerge& merge, void* stream);

/// What the kernel makes of scale and beta. A pair's weight is (e^β − 1) e^s, and the softmax works in powers
/// of 2.
struct MergeConstants {
  float score_scale;  // scale · log2 e
  float log2_weight;  // log2 |e^β − 1|
  float dense_sign;   // of e^β − 1: where it is negative, the dense result is negated instead, and the
                      // quotient is the same
};
MergeConstants merge_constants(float scale, float beta);

}  // namespace patina::attention::cuda
