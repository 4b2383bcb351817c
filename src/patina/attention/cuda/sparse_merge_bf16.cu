// The kernel for bf16, and the entry point.
#include <string>

#include "patina/attention/cuda/sparse_merge.cuh"
#include "patina/base/error.h"

namespace patina::attention::cuda {

cudaError_t launch_merge_bf16(const SparseMerge& merge, const MergeConstants& constants,
                              cudaStream_t stream) {
  return launch_merge<Element16::kBf16>(merge, constants, stream);
}

void sparse_merge(const SparseMerge& merge, void* stream) {
  validate(merge);
  if (merge.beta == 0 || merge.num_blocks == 0) return;
  const auto launch = merge.element == Element16::kBf16 ? launch_merge_bf16 : launch_merge_f16;
  const cudaError_t error =
      launch(merge, merge_constants(merge.scale, merge.beta), static_cast<cudaStream_t>(stream));
  if (error != cudaSuccess)
    throw Error(ErrorCode::kDevice, "attention on CUDA",
                std::string("the kernel did not start: ") + cudaGetErrorString(error));
}

}  // namespace patina::attention::cuda
