// Multi-head attention on tensors, through the kernels of patina/attention.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include <ATen/core/Tensor.h>

#include "patina/attention/attention.h"

namespace patina::nn {

/// Biased keys in a CUDA device's memory, kept between calls (attend_cuda.h). Made empty; null without CUDA.
class DeviceTilesCache;
std::shared_ptr<DeviceTilesCache> make_tiles_cache();

/// The bias of one self-attention.
struct LevelBias {
  const attention::KeyBuckets* buckets = nullptr;  // null: none
  float beta = 0;                                  // what is added inside the exponent
  DeviceTilesCache* tiles = nullptr;  // null: a device makes its copy of the buckets at each call
};

/// Which pairs of a network's self-attentions are favoured, and by how much. `levels` outlive it and do not
/// change.
struct SelfAttentionBias {
  std::span<const attention::KeyBuckets>
      levels;                      // one a resolution; a resolution that has none is not biased
  float weight = 0;                // w
  bool scaled_with_scores = true;  // softmax((QKᵀ + B)/√d), β = w/√d; else softmax(QKᵀ/√d + B), β = w
  std::shared_ptr<DeviceTilesCache> tiles = make_tiles_cache();  // of `levels`; copies share it

  /// The level of height × width latent pixels, or null.
  const attention::KeyBuckets* level(int64_t height, int64_t width) const;
  /// What is added inside the exponent.
  float beta(int64_t head_dim) const;
  /// Both, for attend().
  LevelBias at(int64_t height, int64_t width, int64_t head_dim) const;
};

/// Keys and values of another picture, which queries see beside their own.
struct ExtraKeys {
  at::Tensor k, v;        // [B,M,heads·d]
  at::Tensor log_weight;  // f32, broadcast to [B,1,N]: added to a query's scores of these keys; 0: they count
                          // like its own, -inf: not at all
};

/// softmax(q kᵀ/√d + β[j ∈ S_i]) v for q [B,N,heads·d], k and v [B,M,heads·d] -> [B,N,heads·d]; one dtype,
/// f32 or bf16, on CUDA fp16 too. With a bias N = M = its number of pixels, and on CUDA d is a multiple of 8
/// up to 256, the dtype bf16 or fp16 and β at least -1. Memory beyond the result is O(N + M). Where gradients
/// are recorded there must be no bias and no extra keys, and memory may be O(N M). `extra`: the softmax is
/// over their keys too.
at::Tensor attend(const at::Tensor& q, const at::Tensor& k, const at::Tensor& v, int64_t num_heads,
                  const LevelBias& bias = {}, std::span<const ExtraKeys> extra = {});

}  // namespace patina::nn
