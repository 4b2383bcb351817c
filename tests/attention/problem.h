// Attention problems for tests: tensors in several layouts, buckets, the float64 truth and a plain
// same-precision version.
#pragma once

#include <cstdint>
#include <iosfwd>
#include <optional>
#include <vector>

#include "patina/attention/attention.h"

namespace patina::attention::test {

enum class Layout {
  kTokens,  // [batch, tokens, heads, dim]
  kHeads,   // [batch, heads, tokens, dim]
  kFused,   // q, k, v side by side in one row, with unused elements between rows
};

/// How keys fall into cells.
enum class Landing { kNone, kProjected, kEverywhere };

struct BucketSpec {
  int grid = 1, view_width = 1, view_height = 1, radius = 0;
  Landing landing = Landing::kProjected;
  float beta = 0;
};

struct Spec {
  int64_t batch = 1, heads = 1, queries = 1, keys = 1, dim = 1;
  Layout layout = Layout::kTokens;
  float score_deviation = 1;          // standard deviation of q·k/√d
  std::optional<BucketSpec> buckets;  // then queries = keys = its pixels
};
void PrintTo(const Spec& spec, std::ostream* out);  // for GoogleTest

/// Projected: every key lands in one random cell of about two thirds of the other views (of its own view
/// where there is one only).
KeyBuckets make_buckets(const BucketSpec& spec, uint64_t seed);

/// Inputs of one problem. Values are representable in bf16 if element is kBf16, so that `f32` holds them
/// exactly.
struct Problem {
  Spec spec;
  Element element = Element::kF32;
  std::vector<float> q, k, v;           // f32, laid out by the strides
  std::vector<uint16_t> q16, k16, v16;  // the same in bf16, for kBf16
  Strides q_strides, k_strides, out_strides;
  KeyBuckets buckets;

  /// Arguments on the stored tensors in `element` (or f32); out and log_sum_exp are the caller's.
  Arguments arguments(Element as, void* out, float* log_sum_exp) const;
  size_t out_size() const;  // elements that out_strides span
  int64_t num_rows() const { return spec.batch * spec.heads * spec.queries; }
  /// Offset in `out` of row (batch, head, query), counted in that order.
  int64_t out_offset(int64_t row) const;
};
Problem make_problem(const Spec& spec, Element element, uint64_t seed);

/// Output rows [batch · heads · queries][dim] and log-sum-exp [batch · heads · queries], in f64.
struct Result {
  std::vector<double> out, log_sum_exp;
};
/// attention_reference, on the exact f32 inputs.
Result truth(const Problem& problem);
/// The plain version that an error is measured against: f32 throughout in natural order; for bf16,
/// probabilities and outputs rounded to bf16.
Result plain(const Problem& problem);
/// attention_cpu on one instruction set. Output elements between rows must stay untouched.
Result run(const Problem& problem, CpuIsa isa);

/// Largest absolute difference, and root of the mean square.
struct Difference {
  double max = 0, rms = 0;
};
Difference difference(const std::vector<double>& a, const std::vector<double>& b);

}  // namespace patina::attention::test
