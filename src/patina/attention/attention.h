// Self-attention with a two-valued bias: the contract that every implementation fulfils. No Torch, no CUDA
// here.
//
//   O_i = Σ_j softmax_j( s_ij + β·[j ∈ S_i] ) v_j,   s_ij = q_i·k_j / √d
//
// A device whose dense attention is a vendor's computes it as that, with its log-sum-exp, plus a correction
// over S_i alone; the CPU kernels add β inside their tiles (docs/attention.md says why).
#pragma once

#include <cstdint>
#include <vector>

namespace patina::attention {

/// The biased keys of all queries of a view grid, in O(N) memory: each key lands in at most one cell of each
/// other view, and S_i is the union of the buckets of the cells in the window around i, clipped to i's view.
struct KeyBuckets {
  int grid = 1;                         // views a side
  int view_width = 0, view_height = 0;  // latent pixels of one view; N = grid² · view_width · view_height
  int window_radius = 0;                // window of (2r+1)² cells
  std::vector<int32_t> offsets;  // [N+1]: bucket of cell c is keys[offsets[c] .. offsets[c+1]); cells are
                                 // row-major over the whole grid
  std::vector<int32_t> keys;     // key indices, row-major over the whole grid, ascending within a bucket

  int width() const { return grid * view_width; }
  int height() const { return grid * view_height; }
  int64_t num_pixels() const { return static_cast<int64_t>(width()) * height(); }
};

/// S_i in ascending order, without duplicates: the definition that all implementations are tested against.
std::vector<int32_t> biased_keys(const KeyBuckets& buckets, int64_t query);

/// Throws Error{kUsage} unless sizes, offsets and key indices are consistent.
void validate(const KeyBuckets& buckets);

enum class Element { kF32, kBf16 };

/// Strided views of q, k, v, out [batch, tokens, heads, head_dim] with head_dim contiguous. Strides count
/// elements.
struct Shape {
  int64_t batch = 1, num_queries = 0, num_keys = 0, num_heads = 1, head_dim = 0;
};
struct Strides {
  int64_t batch = 0, token = 0, head = 0;
};
inline constexpr float kMaxBeta =
    1e4f;  // there f32 keeps a score's first three decimals; e^20 already outweighs any dense grid

struct Arguments {
  Shape shape;
  Element element = Element::kF32;
  const void* q = nullptr;
  const void* k = nullptr;
  const void* v = nullptr;
  void* out = nullptr;  // same element type
  float* log_sum_exp =
      nullptr;  // [batch, heads, queries] f32 of the *biased* scores, natural log; may be null. As exact as
                // f32, but for kAmxBf16, which sums rounded weights: within 2⁻⁷, 2⁻¹² over many keys
  Strides q_strides, k_strides, v_strides, out_strides;
  float scale = 0;                      // 1/√head_dim
  const KeyBuckets* buckets = nullptr;  // null: no bias. Else num_queries = num_keys = buckets->num_pixels()
  float beta = 0;                       // added to the exponent of biased pairs; 0 is bit-equal to no bias
};

/// The definition: float64 inside, plain loops, O(queries · keys) time. NaN in a row's inputs gives NaN in
/// that row, as do a score of +inf and a row whose scores are all -inf; any other score of -inf has weight 0.
void attention_reference(const Arguments& arguments);

/// Blocked CPU attention with online softmax; memory O(tokens · head_dim). Picks the best instruction set at
/// run time. A row's result depends on that row's query alone, not on batch, order, tiling or threads. Scores
/// are f32: like any kernel that adds β to a score, it keeps |s + β| · 2⁻²⁴ of them.
void attention_cpu(const Arguments& arguments);

/// The CPU kernels, slowest first. All are compiled in on x86-64; kGeneric runs everywhere.
enum class CpuIsa { kGeneric, kAvx2, kAvx512, kAvx512Bf16, kAmxBf16 };
const char* name_of(CpuIsa isa);

/// Those that this processor (and operating system) runs for `element`, slowest first; never empty.
/// kAvx512Bf16 and kAmxBf16 take bf16 only; the others widen bf16 to f32 and round the result once.
std::vector<CpuIsa> supported_isas(Element element);

/// attention_cpu on one instruction set. Throws Error{kDevice} if it is not among supported_isas.
void attention_cpu(const Arguments& arguments, CpuIsa isa);

/// Throws Error{kUsage} on null pointers, empty or negative sizes, a scale that is not positive, |beta| above
/// kMaxBeta or NaN, outputs that share elements, or buckets that do not fit the shape. Every entry point
/// calls it.
void validate(const Arguments& arguments);

}  // namespace patina::attention
