#include "patina/attention/cuda/sparse_merge.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "patina/base/error.h"

namespace patina::attention::cuda {
namespace {

void require(bool condition, const std::string& message) {
  if (!condition) throw Error(ErrorCode::kUsage, "attention on CUDA", message);
}

void require_aligned(const char* name, const void* pointer, const Strides& strides) {
  require(pointer != nullptr, std::string(name) + " is null");
  require(reinterpret_cast<uintptr_t>(pointer) % 16 == 0,
          std::string(name) + " does not lie on 16 bytes: copy the tensor");
  require(strides.batch % 8 == 0 && strides.token % 8 == 0 && strides.head % 8 == 0,
          std::string(name) + " has strides [batch " + std::to_string(strides.batch) + ", token " +
              std::to_string(strides.token) + ", head " + std::to_string(strides.head) +
              "], expected multiples of 8 elements: copy the tensor");
}

}  // namespace

void validate(const SparseMerge& merge) {
  const Shape& shape = merge.shape;
  require(shape.batch >= 1 && shape.num_heads >= 1 && shape.num_queries >= 1, "empty sizes");
  require(shape.num_queries == shape.num_keys, "the bias is of self-attention, and there are " +
                                                   std::to_string(shape.num_queries) + " queries and " +
                                                   std::to_string(shape.num_keys) + " keys");
  require(shape.num_keys <= std::numeric_limits<int32_t>::max(), "more than 2^31 - 1 keys");
  require(shape.batch <= 65535, "batch is " + std::to_string(shape.batch) + ", expected at most 65535");
  require(shape.head_dim >= 8 && shape.head_dim <= kMaxHeadDim && shape.head_dim % 8 == 0,
          "head_dim is " + std::to_string(shape.head_dim) + ", expected a multiple of 8 up to " +
              std::to_string(kMaxHeadDim));
  require_aligned("q", merge.q, merge.q_strides);
  require_aligned("k", merge.k, merge.k_strides);
  require_aligned("v", merge.v, merge.v_strides);
  require_aligned("out", merge.out, merge.out_strides);
  require(merge.log_sum_exp != nullptr, "log_sum_exp is null");
  require(
      merge.scale >= 1e-20f && merge.scale <= 1e20f,
      "scale is " + std::to_string(merge.scale) + ", expected a positive number such as 1/sqrt(head_dim)");
  require(merge.beta >= kMinBeta && merge.beta <= kMaxBeta,
          "beta is " + std::to_string(merge.beta) + ", expected -1 to 1e4; the CPU takes any from -1e4");
  require(merge.num_blocks == 0 || (merge.blocks && merge.keys && merge.masks && merge.row_stride >= 1),
          "the tiles of the bias are null");
  require(merge.num_blocks >= 0 &&
              merge.num_blocks * shape.num_heads <= int64_t{std::numeric_limits<int32_t>::max()},
          "more than 2^31 - 1 query blocks and heads");
}

MergeConstants merge_constants(float scale, float beta) {
  const double b = static_cast<double>(beta);
  // ln |e^β − 1|, where e^β itself would overflow or cancel.
  const double weight = b > 1 ? b + std::log1p(-std::exp(-b)) : std::log(std::abs(std::expm1(b)));
  return {static_cast<float>(static_cast<double>(scale) * std::numbers::log2e),
          static_cast<float>(weight * std::numbers::log2e), beta < 0 ? -1.0f : 1.0f};
}

}  // namespace patina::attention::cuda
