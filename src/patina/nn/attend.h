// Multi-head attention on tensors, through the kernels of patina/attention.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include <ATen/core/Tensor.h>

#include "patina/attention/attention.h"

namespace patina::nn {

/// Which pairs of a self-attention are favoured, and by how much.
struct SelfAttentionBias {
  std::span<const attention::KeyBuckets>
      levels;                      // one a resolution; a resolution that has none is not biased
  float weight = 0;                // w
  bool scaled_with_scores = true;  // softmax((QKᵀ + B)/√d), β = w/√d; else softmax(QKᵀ/√d + B), β = w

  /// The level of height × width latent pixels, or null.
  const attention::KeyBuckets* level(int64_t height, int64_t width) const;
  /// What is added inside the exponent.
  float beta(int64_t head_dim) const;
};

/// softmax(q kᵀ/√d + β[j ∈ S_i]) v for q [B,N,heads·d], k and v [B,M,heads·d] -> [B,N,heads·d]; f32 or bf16,
/// one dtype. `buckets` may be null; else N = M = its number of pixels. Memory beyond the result is O(N + M).
at::Tensor attend(const at::Tensor& q, const at::Tensor& k, const at::Tensor& v, int64_t num_heads,
                  const attention::KeyBuckets* buckets = nullptr, float beta = 0);

}  // namespace patina::nn
