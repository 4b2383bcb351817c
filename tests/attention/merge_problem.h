// Problems for sparse_merge, laid out in host memory: what the tests on the emulated GPU and on a real one
// share. The dense result that the merge starts from is the float64 one, rounded.
#pragma once

#include <cstdint>
#include <iosfwd>
#include <vector>

#include "patina/attention/cuda/sparse_merge.h"
#include "problem.h"

namespace patina::attention::test {

/// How a merge's tensors lie in memory: axes in the order named, or with unused elements between rows.
enum class Memory { kTokens, kHeads, kPadded };

struct MergeCase {
  Spec spec;
  cuda::Element16 element = cuda::Element16::kBf16;
  Memory memory = Memory::kTokens;
};
void PrintTo(const MergeCase& merge_case, std::ostream* out);  // for GoogleTest

/// Every compiled size, both types, all layouts, grids, windows, biases and score ranges that promise
/// trouble.
std::vector<MergeCase> merge_cases();

/// Self-attention of `heads` heads with a bias.
Spec merge_spec(int64_t batch, int64_t heads, int64_t dim, float score_deviation, const BucketSpec& buckets);

/// Inputs in a 16-bit type, exactly: a Problem whose f32 tensors hold rounded values.
Problem make_problem16(const Spec& spec, cuda::Element16 element, uint64_t seed);
Problem without_bias(Problem problem);

/// 16-byte aligned elements of 16 bits.
struct Aligned {
  explicit Aligned(int64_t count) : size(count), pieces(static_cast<size_t>(count + 7) / 8) {}
  uint16_t* data() { return pieces.data()->elements; }

  struct alignas(16) Piece {
    uint16_t elements[8] = {};
  };
  int64_t size;
  std::vector<Piece> pieces;
};

/// A merge whose pointers lead into the vectors beside it.
struct MergeBuffers {
  Aligned q, k, v, out;
  std::vector<float> log_sum_exp;
  cuda::BiasTiles tiles;
  cuda::SparseMerge merge;
};
MergeBuffers lay_out(const Problem& problem, const Result& dense, cuda::Element16 element, Memory memory);

struct Merged {
  Result result;               // rows in the order of Result
  std::vector<uint16_t> bits;  // of the output
};
/// What a merge left in the buffers; a failure if it wrote between the rows.
Merged read_back(const Problem& problem, MergeBuffers& buffers);

/// Error at most twice that of a plain version in the same type (f32 in natural order; probabilities and
/// output rounded), and the log-sum-exp right to a few units of f32.
void expect_twice_plain(const Problem& problem, const Result& found, cuda::Element16 element);

}  // namespace patina::attention::test
