// Self-attention with a two-valued bias: the contract that every implementation fulfils. No Torch, no CUDA here.
//
//   O_i = Σ_j softmax_j( s_ij + β·[j ∈ S_i] ) v_j,   s_ij = q_i·k_j / √d
//
// is computed as ordinary attention with its log-sum-exp plus a correction over S_i alone (docs/architecture.md, Attention).
#pragma once

#include <cstdint>
#include <vector>

namespace patina::attention {

/// The biased keys of all queries of a view grid, in O(N) memory: each key lands in at most one cell of each other view,
/// and S_i is the union of the buckets of the cells in the window around i, clipped to i's view.
struct KeyBuckets {
  int grid = 1;                      // views a side
  int view_width = 0, view_height = 0;  // latent pixels of one view; N = grid² · view_width · view_height
  int window_radius = 0;             // window of (2r+1)² cells
  std::vector<int32_t> offsets;      // [N+1]: bucket of cell c is keys[offsets[c] .. offsets[c+1]); cells are row-major over the whole grid
  std::vector<int32_t> keys;         // key indices, row-major over the whole grid, ascending within a bucket

  int width() const { return grid * view_width; }
  int height() const { return grid * view_height; }
  int64_t num_pixels() const { return static_cast<int64_t>(width()) * height(); }
};

/// S_i in ascending order, without duplicates: the definition that all implementations are tested against.
std::vector<int32_t> biased_keys(const KeyBuckets& buckets, int64_t query);

/// Throws Error{kUsage} unless sizes, offsets and key indices are consistent.
void validate(const KeyBuckets& buckets);

enum class Element { kF32, kBf16 };

/// Strided views of q, k, v, out [batch, tokens, heads, head_dim] with head_dim contiguous. Strides count elements.
struct Shape {
  int64_t batch = 1, num_queries = 0, num_keys = 0, num_heads = 1, head_dim = 0;
};
struct Strides {
  int64_t batch = 0, token = 0, head = 0;
};
struct Arguments {
  Shape shape;
  Element element = Element::kF32;
  const void* q = nullptr;
  const void* k = nullptr;
  const void* v = nullptr;
  void* out = nullptr;                  // same element type
  float* log_sum_exp = nullptr;         // [batch, heads, queries] f32 of the *biased* scores, natural log; may be null
  Strides q_strides, k_strides, v_strides, out_strides;
  float scale = 0;                      // 1/√head_dim
  const KeyBuckets* buckets = nullptr;  // null: no bias. Else num_queries = num_keys = buckets->num_pixels()
  float beta = 0;                       // added to the exponent of biased pairs; 0 is bit-equal to no bias
};

/// The definition: float64 inside, plain loops, O(queries · keys) time. NaN in a row's inputs gives NaN in that row.
void attention_reference(const Arguments& arguments);

/// Blocked CPU attention with online softmax; memory O(tokens · head_dim). Picks the best instruction set at run time.
void attention_cpu(const Arguments& arguments);

/// Throws Error{kUsage} on null pointers, empty or negative sizes, or buckets that do not fit the shape.
void validate(const Arguments& arguments);

}  // namespace patina::attention
