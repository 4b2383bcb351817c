#include "libtorch_attention.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include <ATen/ATen.h>
#include <ATen/Parallel.h>
#include <c10/core/GradMode.h>
#include <torch/version.h>

namespace patina::bench {
namespace {

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

at::Tensor tensor_of(std::span<const uint16_t> values, int64_t heads, int64_t tokens, int64_t head_dim) {
  return at::from_blob(const_cast<uint16_t*>(values.data()), {heads, tokens, head_dim},
                       at::TensorOptions().dtype(at::kBFloat16));
}

at::Tensor sdpa(const at::Tensor& q, const at::Tensor& k, const at::Tensor& v) {
#if TORCH_VERSION_MAJOR >= 2
  return at::scaled_dot_product_attention(q.unsqueeze(0), k.unsqueeze(0), v.unsqueeze(0)).squeeze(0);
#else
  return std::get<0>(at::_scaled_dot_product_attention(q, k, v));
#endif
}

at::Tensor blocks(const at::Tensor& q, const at::Tensor& k, const at::Tensor& v, int64_t block, bool f32) {
  const double scale = 1 / std::sqrt(static_cast<double>(q.size(2)));
  at::Tensor out = at::empty_like(q);
  const at::Tensor kt = k.transpose(1, 2);
  for (int64_t begin = 0; begin < q.size(1); begin += block) {
    const int64_t count = std::min(block, q.size(1) - begin);
    const at::Tensor scores = at::bmm(q.narrow(1, begin, count), kt);
    const at::Tensor weights = f32 ? at::softmax(scores.to(at::kFloat).mul_(scale), 2).to(at::kBFloat16)
                                   : at::softmax(scores.mul(scale), 2);
    out.narrow(1, begin, count).copy_(at::bmm(weights, v));
  }
  return out;
}

}  // namespace

PeerAttention libtorch_attention(std::span<const uint16_t> q_values, std::span<const uint16_t> k_values,
                                 std::span<const uint16_t> v_values, std::span<const uint16_t> ours,
                                 int64_t heads, int64_t tokens, int64_t head_dim, int threads, int runs) {
  const c10::NoGradGuard no_grad;
  at::set_num_threads(threads);
  const at::Tensor q = tensor_of(q_values, heads, tokens, head_dim),
                   k = tensor_of(k_values, heads, tokens, head_dim),
                   v = tensor_of(v_values, heads, tokens, head_dim),
                   expected = tensor_of(ours, heads, tokens, head_dim).to(at::kFloat);
  PeerAttention best;
  best.seconds = std::numeric_limits<double>::infinity();
  const auto attempt = [&](const std::string& way, const auto& run) {
    for (int i = 0; i < runs; ++i) {
      const double start = now();
      const at::Tensor out = run();
      const double seconds = now() - start;
      if (seconds >= best.seconds) continue;
      const double largest = expected.abs().max().item<double>();
      best = {seconds, way, (out.to(at::kFloat) - expected).abs().max().item<double>() / largest};
    }
  };
  // It may hold all scores at once: 8 bytes each with the softmax's copy.
  constexpr int64_t kMostScores = int64_t{1} << 29;
  if (heads * tokens * tokens <= kMostScores)
    attempt("scaled_dot_product_attention", [&] { return sdpa(q, k, v); });
  for (const int64_t block : {256, 1024, 4096}) {
    if (heads * block * tokens > kMostScores) continue;
    attempt("blocks of " + std::to_string(block) + " queries, bf16",
            [&] { return blocks(q, k, v, block, false); });
    attempt("blocks of " + std::to_string(block) + " queries, scores in f32",
            [&] { return blocks(q, k, v, block, true); });
  }
  return best;
}

double libtorch_matmul_gflops(int64_t size, int threads) {
  const c10::NoGradGuard no_grad;
  at::set_num_threads(threads);
  const at::Tensor a = at::randn({size, size}).to(at::kBFloat16),
                   b = at::randn({size, size}).to(at::kBFloat16);
  double best = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 8; ++i) {
    const double start = now();
    const at::Tensor product = at::mm(a, b);
    best = std::min(best, now() - start);
  }
  return 2e-9 * std::pow(static_cast<double>(size), 3) / best;
}

std::string libtorch_version() {
  return TORCH_VERSION;
}

}  // namespace patina::bench
