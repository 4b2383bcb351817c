// LibTorch's attention as a peer: the fastest of the ways in which a program would ask it.
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace patina::bench {

struct PeerAttention {
  double seconds = 0;           // wall clock, best of `runs`
  std::string way;              // which it was
  double worst_difference = 0;  // of its output from ours, over the largest output
};

/// Dense attention of q, k, v [heads, tokens, head_dim] bf16 on `threads` threads:
/// `scaled_dot_product_attention`, and softmax(q kᵀ) v by batched products over blocks of 256, 1024 and 4096
/// queries, each in bf16 and with scores in f32. ours: [heads, tokens, head_dim] bf16, to compare with.
PeerAttention libtorch_attention(std::span<const uint16_t> q, std::span<const uint16_t> k,
                                 std::span<const uint16_t> v, std::span<const uint16_t> ours, int64_t heads,
                                 int64_t tokens, int64_t head_dim, int threads, int runs);

/// GFLOP/s of LibTorch's bf16 matrix product of size x size matrices, best of some runs.
double libtorch_matmul_gflops(int64_t size, int threads);

std::string libtorch_version();

}  // namespace patina::bench
