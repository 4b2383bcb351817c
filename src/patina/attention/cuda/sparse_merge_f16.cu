// The kernel for fp16.
#include "patina/attention/cuda/sparse_merge.cuh"

namespace patina::attention::cuda {

cudaError_t launch_merge_f16(const SparseMerge& merge, const MergeConstants& constants, cudaStream_t stream) {
  return launch_merge<Element16::kF16>(merge, constants, stream);
}

}  // namespace patina::attention::cuda
