// Attention on a CUDA device: the framework's own dense kernels, which return their log-sum-exp, and patina's
// kernel that adds the bias to their result. Built by the cuda preset, against LibTorch 2.x.
#pragma once

#include <map>
#include <mutex>
#include <utility>

#include "patina/nn/attend.h"

namespace patina::nn {

/// attend() of tensors on one CUDA device; its arguments are checked there. Runs on the current stream.
at::Tensor attend_cuda(const at::Tensor& q, const at::Tensor& k, const at::Tensor& v, int64_t num_heads,
                       const LevelBias& bias, std::span<const ExtraKeys> extra);

/// attention::cuda::BiasTiles in device memory.
struct DeviceTiles {
  at::Tensor blocks;  // u8, the bytes of TiledBlock
  at::Tensor keys;    // i32 [tiles · 32]
  at::Tensor masks;   // i32 [tiles · 64]
  int32_t num_blocks = 0, row_stride = 0;
};
DeviceTiles upload_tiles(const attention::KeyBuckets& buckets, at::Device device);

/// Each level's tiles on each device, made and uploaded when first asked for. Buckets are known by their
/// address. Several threads may ask.
class DeviceTilesCache {
 public:
  const DeviceTiles& of(const attention::KeyBuckets& buckets, at::Device device);

 private:
  std::mutex mutex_;
  std::map<std::pair<const attention::KeyBuckets*, at::DeviceIndex>, DeviceTiles> tiles_;
};

/// The framework's attention kernels that need no N² memory and return the log-sum-exp.
enum class DenseKernel { kCudnn, kFlash, kEfficient };
const char* name_of(DenseKernel kernel);

/// Whether the kernel takes 16-bit or f32 inputs of this head dimension on the current device.
bool takes(DenseKernel kernel, at::ScalarType dtype, int64_t head_dim);

/// The kernel that attend() uses: on Hopper and newer cuDNN's where it takes the shape, else flash, else the
/// memory-efficient one. A rule and not a measurement, so that a run repeats bit for bit. Throws
/// Error{kUsage} where none takes it.
DenseKernel dense_kernel_for(at::ScalarType dtype, int64_t head_dim);

struct DenseResult {
  at::Tensor out;          // [B,heads,N,d], dense in memory, in the order of q's axes
  at::Tensor log_sum_exp;  // [B,heads,N] f32, natural log; any strides
};
/// softmax(q kᵀ · scale) v for q [B,heads,N,d], k and v [B,heads,M,d]. Throws Error{kDevice} with the
/// framework's reason.
DenseResult dense_attention(DenseKernel kernel, const at::Tensor& q, const at::Tensor& k, const at::Tensor& v,
                            float scale);

/// Adds the bias to `dense` in place (attention/cuda/sparse_merge.h). q, k, v as dense_attention had them.
void add_bias(const DenseResult& dense, const at::Tensor& q, const at::Tensor& k, const at::Tensor& v,
              float scale, const DeviceTiles& tiles, float beta);

}  // namespace patina::nn
