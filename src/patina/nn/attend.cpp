#include "patina/nn/attend.h"

#include <cmath>

#include <ATen/ATen.h>
#include <c10/core/GradMode.h>
#include <torch/version.h>

#include "patina/base/check.h"
#include "patina/base/error.h"
#include "patina/nn/attend_cuda.h"

namespace patina::nn {
namespace {

attention::Strides strides_of(const at::Tensor& x, int64_t head_dim) {
  return {x.stride(0), x.stride(1), head_dim};
}

// Attention over some keys and the logarithm of what their softmax was divided by.
struct Attended {
  at::Tensor out;          // [B,N,heads·d]
  at::Tensor log_sum_exp;  // [B,heads,N] f32; undefined unless asked for
};

Attended attend_cpu(const at::Tensor& q, const at::Tensor& k, const at::Tensor& v, int64_t num_heads,
                    const LevelBias& bias, bool with_sum) {
  PATINA_CHECK(q.scalar_type() == at::kFloat || q.scalar_type() == at::kBFloat16);
  const int64_t head_dim = q.size(2) / num_heads;
  at::Tensor out = at::empty(q.sizes(), q.options());
  attention::Arguments arguments;
  arguments.shape = {q.size(0), q.size(1), k.size(1), num_heads, head_dim};
  arguments.element = q.scalar_type() == at::kFloat ? attention::Element::kF32 : attention::Element::kBf16;
  arguments.q = q.data_ptr(), arguments.k = k.data_ptr(), arguments.v = v.data_ptr(),
  arguments.out = out.data_ptr();
  arguments.q_strides = strides_of(q, head_dim), arguments.k_strides = strides_of(k, head_dim);
  arguments.v_strides = strides_of(v, head_dim), arguments.out_strides = strides_of(out, head_dim);
  arguments.scale = 1.0f / std::sqrt(static_cast<float>(head_dim));
  arguments.buckets = bias.buckets;
  arguments.beta = bias.beta;
  at::Tensor log_sum_exp;
  if (with_sum) {
    log_sum_exp = at::empty({q.size(0), num_heads, q.size(1)}, q.options().dtype(at::kFloat));
    arguments.log_sum_exp = log_sum_exp.data_ptr<float>();
  }
  attention::attention_cpu(arguments);
  return {out, log_sum_exp};
}

at::Tensor attend_cpu(const at::Tensor& q, const at::Tensor& k, const at::Tensor& v, int64_t num_heads,
                      const LevelBias& bias, std::span<const ExtraKeys> extra) {
  Attended own = attend_cpu(q, k, v, num_heads, bias, !extra.empty());
  for (const ExtraKeys& keys : extra) {
    const Attended other = attend_cpu(q, keys.k, keys.v, num_heads, {}, true);
    const at::Tensor log_sum_exp = other.log_sum_exp + keys.log_weight;
    const at::Tensor share = at::sigmoid(log_sum_exp - own.log_sum_exp).transpose(1, 2).unsqueeze(3);
    const auto by_head = [&](const at::Tensor& x) { return x.unflatten(2, {num_heads, -1}); };
    own.out = at::lerp(by_head(own.out).to(at::kFloat), by_head(other.out).to(at::kFloat), share)
                  .to(q.scalar_type())
                  .flatten(2);
    own.log_sum_exp = at::logaddexp(own.log_sum_exp, log_sum_exp);
  }
  return own.out;
}

/// The plain formula, for training: the kernels record no gradients.
at::Tensor attend_recorded(const at::Tensor& q, const at::Tensor& k, const at::Tensor& v, int64_t num_heads) {
  const auto heads_first = [&](const at::Tensor& x) {
    return x.view({x.size(0), x.size(1), num_heads, x.size(2) / num_heads}).transpose(1, 2);
  };
  const at::Tensor q_heads = heads_first(q), k_heads = heads_first(k), v_heads = heads_first(v);
#if TORCH_VERSION_MAJOR >= 2
  const at::Tensor attended = at::scaled_dot_product_attention(q_heads, k_heads, v_heads);
#else
  const double scale = 1 / std::sqrt(static_cast<double>(q_heads.size(3)));
  const at::Tensor weights = at::softmax(at::matmul(q_heads * scale, k_heads.transpose(2, 3)), -1);
  const at::Tensor attended = at::matmul(weights, v_heads);
#endif
  return attended.transpose(1, 2).reshape(q.sizes());
}

}  // namespace

#ifndef PATINA_CUDA
std::shared_ptr<DeviceTilesCache> make_tiles_cache() {
  return nullptr;
}

at::Tensor attend_cuda(const at::Tensor&, const at::Tensor&, const at::Tensor&, int64_t, const LevelBias&,
                       std::span<const ExtraKeys>) {
  throw Error(
      ErrorCode::kDevice, "attention",
      "the tensors are on a CUDA device, and this patina was built without CUDA: build the cuda preset");
}
#endif

const attention::KeyBuckets* SelfAttentionBias::level(int64_t height, int64_t width) const {
  if (weight == 0) return nullptr;
  for (const attention::KeyBuckets& buckets : levels) {
    if (buckets.height() == height && buckets.width() == width) return &buckets;
  }
  return nullptr;
}

float SelfAttentionBias::beta(int64_t head_dim) const {
  return scaled_with_scores ? weight / std::sqrt(static_cast<float>(head_dim)) : weight;
}

LevelBias SelfAttentionBias::at(int64_t height, int64_t width, int64_t head_dim) const {
  const attention::KeyBuckets* buckets = level(height, width);
  return buckets ? LevelBias{buckets, beta(head_dim), tiles.get()} : LevelBias{};
}

at::Tensor attend(const at::Tensor& q, const at::Tensor& k, const at::Tensor& v, int64_t num_heads,
                  const LevelBias& bias, std::span<const ExtraKeys> extra) {
  PATINA_CHECK_EQ(q.dim(), 3);
  PATINA_CHECK_EQ(q.size(2) % num_heads, 0);
  PATINA_CHECK(k.size(2) == q.size(2) && v.sizes() == k.sizes() && q.size(0) == k.size(0));
  PATINA_CHECK(q.scalar_type() == k.scalar_type() && q.scalar_type() == v.scalar_type());
  PATINA_CHECK(q.device() == k.device() && q.device() == v.device());
  PATINA_CHECK(q.stride(2) == 1 && k.stride(2) == 1 && v.stride(2) == 1);
  if (c10::GradMode::is_enabled() && (q.requires_grad() || k.requires_grad() || v.requires_grad())) {
    PATINA_CHECK(!bias.buckets && extra.empty());
    return attend_recorded(q, k, v, num_heads);
  }
  return q.is_cuda() ? attend_cuda(q, k, v, num_heads, bias, extra)
                     : attend_cpu(q, k, v, num_heads, bias, extra);
}

}  // namespace patina::nn
