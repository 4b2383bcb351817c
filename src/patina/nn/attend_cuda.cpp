#include "patina/nn/attend_cuda.h"

#include <cmath>
#include <string>

#include <ATen/ATen.h>
#include <ATen/detail/CUDAHooksInterface.h>
#include <c10/cuda/CUDAGuard.h>
#include <c10/cuda/CUDAStream.h>
#include <cuda_runtime_api.h>

#include "patina/attention/cuda/sparse_merge.h"
#include "patina/base/check.h"
#include "patina/base/error.h"

namespace patina::nn {
namespace {

using attention::cuda::BiasTiles;
using attention::cuda::SparseMerge;

[[noreturn]] void refuse(const std::string& message) {
  throw Error(ErrorCode::kUsage, "attention on CUDA", message);
}

int compute_capability_major() {
  int device = 0, major = 0;
  if (cudaGetDevice(&device) != cudaSuccess ||
      cudaDeviceGetAttribute(&major, cudaDevAttrComputeCapabilityMajor, device) != cudaSuccess)
    throw Error(ErrorCode::kDevice, "attention on CUDA",
                std::string("cannot ask the device what it is: ") + cudaGetErrorString(cudaGetLastError()));
  return major;
}

bool is_16_bit(at::ScalarType dtype) {
  return dtype == at::kBFloat16 || dtype == at::kHalf;
}

/// Kernels read 16 bytes at a time: [B,N,C] on 16 bytes, with strides of 16 bytes; copied where it is not.
at::Tensor on_16_bytes(const at::Tensor& x) {
  const int64_t elements = 16 / x.element_size();
  const bool aligned = reinterpret_cast<uintptr_t>(x.data_ptr()) % 16 == 0 && x.stride(0) % elements == 0 &&
                       x.stride(1) % elements == 0;
  return aligned ? x : x.clone(at::MemoryFormat::Contiguous);
}

/// [B,N,heads·d] -> [B,heads,N,d], a view.
at::Tensor split_heads(const at::Tensor& x, int64_t num_heads) {
  return x.unflatten(2, {num_heads, -1}).transpose(1, 2);
}

template <class T>
at::Tensor upload(const std::vector<T>& values, at::ScalarType dtype, at::Device device) {
  const int64_t size = static_cast<int64_t>(values.size() * sizeof(T) / c10::elementSize(dtype));
  return at::from_blob(const_cast<T*>(values.data()), {size}, at::TensorOptions(dtype))
      .to(device, dtype, /*non_blocking=*/false, /*copy=*/true);
}

attention::Strides strides_of(const at::Tensor& x) {
  return {x.stride(0), x.stride(2), x.stride(1)};
}

}  // namespace

std::shared_ptr<DeviceTilesCache> make_tiles_cache() {
  return std::make_shared<DeviceTilesCache>();
}

DeviceTiles upload_tiles(const attention::KeyBuckets& buckets, at::Device device) {
  const BiasTiles tiles = attention::cuda::make_bias_tiles(buckets);
  return {upload(tiles.blocks, at::kByte, device), upload(tiles.keys, at::kInt, device),
          upload(tiles.masks, at::kInt, device), static_cast<int32_t>(tiles.blocks.size()), tiles.row_stride};
}

const DeviceTiles& DeviceTilesCache::of(const attention::KeyBuckets& buckets, at::Device device) {
  const std::lock_guard lock(mutex_);
  const auto key = std::pair(&buckets, device.index());
  const auto found = tiles_.find(key);
  return found != tiles_.end() ? found->second
                               : tiles_.emplace(key, upload_tiles(buckets, device)).first->second;
}

const char* name_of(DenseKernel kernel) {
  switch (kernel) {
    case DenseKernel::kCudnn:
      return "cudnn";
    case DenseKernel::kFlash:
      return "flash";
    case DenseKernel::kEfficient:
      return "efficient";
  }
  return "unknown";
}

bool takes(DenseKernel kernel, at::ScalarType dtype, int64_t head_dim) {
  const int major = compute_capability_major();
  switch (kernel) {
    case DenseKernel::kCudnn: {
      // cuDNN 9.0 is the first that takes any length; 256 dimensions came with 9.10 on Hopper.
      const long version =
          at::detail::getCUDAHooks().hasCuDNN() ? at::detail::getCUDAHooks().versionCuDNN() : 0;
      const int64_t most = major == 9 && version >= 91000 ? 256 : 128;
      return is_16_bit(dtype) && head_dim % 8 == 0 && head_dim <= most && major >= 8 && version >= 90000;
    }
    case DenseKernel::kFlash:
      return is_16_bit(dtype) && head_dim % 8 == 0 && head_dim <= 256 && major >= 8;
    case DenseKernel::kEfficient:
      return is_16_bit(dtype) ? head_dim % 8 == 0 : dtype == at::kFloat && head_dim % 4 == 0;
  }
  return false;
}

DenseKernel dense_kernel_for(at::ScalarType dtype, int64_t head_dim) {
  if (compute_capability_major() >= 9 && takes(DenseKernel::kCudnn, dtype, head_dim))
    return DenseKernel::kCudnn;
  for (const DenseKernel kernel : {DenseKernel::kFlash, DenseKernel::kEfficient})
    if (takes(kernel, dtype, head_dim)) return kernel;
  refuse(std::string("no kernel takes head_dim ") + std::to_string(head_dim) + " in " + c10::toString(dtype) +
         ": expected a multiple of 8 in bf16 or fp16, of 4 in f32");
}

DenseResult dense_attention(DenseKernel kernel, const at::Tensor& q, const at::Tensor& k, const at::Tensor& v,
                            float scale) {
  const double s = static_cast<double>(scale);
  DenseResult result;
  try {
    switch (kernel) {
      case DenseKernel::kCudnn: {
        const auto r =
            at::_scaled_dot_product_cudnn_attention(q, k, v, std::nullopt, true, 0.0, false, false, s);
        result = {std::get<0>(r), std::get<1>(r)};
        break;
      }
      case DenseKernel::kFlash: {
        const auto r = at::_scaled_dot_product_flash_attention(q, k, v, 0.0, false, false, s);
        result = {std::get<0>(r), std::get<1>(r)};
        break;
      }
      case DenseKernel::kEfficient: {
        const auto r =
            at::_scaled_dot_product_efficient_attention(q, k, v, std::nullopt, true, 0.0, false, s);
        result = {std::get<0>(r), std::get<1>(r)};
        break;
      }
    }
  } catch (const c10::Error& error) {
    throw Error(ErrorCode::kDevice, std::string("attention on CUDA, ") + name_of(kernel),
                error.what_without_backtrace());
  }
  // cuDNN's has a last axis of one; the memory-efficient kernel rounds the number of queries up.
  at::Tensor& log_sum_exp = result.log_sum_exp;
  if (log_sum_exp.dim() == 4) log_sum_exp = log_sum_exp.squeeze(3);
  PATINA_CHECK_EQ(log_sum_exp.dim(), 3);
  PATINA_CHECK_LE(q.size(2), log_sum_exp.size(2));
  log_sum_exp = log_sum_exp.narrow(2, 0, q.size(2));
  PATINA_CHECK(log_sum_exp.scalar_type() == at::kFloat && result.out.sizes() == q.sizes());
  return result;
}

void add_bias(const DenseResult& dense, const at::Tensor& q, const at::Tensor& k, const at::Tensor& v,
              float scale, const DeviceTiles& tiles, float beta) {
  SparseMerge merge;
  merge.shape = {q.size(0), q.size(2), k.size(2), q.size(1), q.size(3)};
  if (!is_16_bit(q.scalar_type()))
    refuse(std::string("a bias needs bf16 or fp16, and the tensors are ") + c10::toString(q.scalar_type()));
  merge.element =
      q.scalar_type() == at::kBFloat16 ? attention::cuda::Element16::kBf16 : attention::cuda::Element16::kF16;
  merge.q = q.data_ptr(), merge.k = k.data_ptr(), merge.v = v.data_ptr(), merge.out = dense.out.data_ptr();
  merge.log_sum_exp = dense.log_sum_exp.data_ptr<float>();
  merge.q_strides = strides_of(q), merge.k_strides = strides_of(k), merge.v_strides = strides_of(v);
  merge.out_strides = strides_of(dense.out);
  merge.log_sum_exp_strides = strides_of(dense.log_sum_exp);
  merge.scale = scale;
  merge.beta = beta;
  // No blocks, no pointers: an empty tensor has none.
  merge.blocks = reinterpret_cast<const attention::cuda::TiledBlock*>(tiles.blocks.data_ptr());
  merge.keys = tiles.keys.data_ptr<int32_t>();
  merge.masks = reinterpret_cast<const uint32_t*>(tiles.masks.data_ptr<int32_t>());
  merge.num_blocks = tiles.num_blocks, merge.row_stride = tiles.row_stride;
  attention::cuda::sparse_merge(merge, c10::cuda::getCurrentCUDAStream(q.device().index()).stream());
}

at::Tensor attend_cuda(const at::Tensor& q, const at::Tensor& k, const at::Tensor& v, int64_t num_heads,
                       const LevelBias& bias, std::span<const ExtraKeys> extra) {
  const c10::cuda::CUDAGuard guard(q.device());
  const int64_t head_dim = q.size(2) / num_heads;
  const float scale = 1.0f / std::sqrt(static_cast<float>(head_dim));
  const at::Tensor heads_q = split_heads(on_16_bytes(q), num_heads),
                   heads_k = split_heads(on_16_bytes(k), num_heads),
                   heads_v = split_heads(on_16_bytes(v), num_heads);
  const DenseKernel kernel = dense_kernel_for(q.scalar_type(), head_dim);
  DenseResult dense = dense_attention(kernel, heads_q, heads_k, heads_v, scale);
  // Before the bias, which is a correction of what all keys give together.
  for (const ExtraKeys& keys : extra) {
    const DenseResult other = dense_attention(kernel, heads_q, split_heads(on_16_bytes(keys.k), num_heads),
                                              split_heads(on_16_bytes(keys.v), num_heads), scale);
    const at::Tensor log_sum_exp = other.log_sum_exp + keys.log_weight.to(q.device());
    const at::Tensor share = at::sigmoid(log_sum_exp - dense.log_sum_exp).unsqueeze(3);
    dense.out =
        at::lerp(dense.out.to(at::kFloat), other.out.to(at::kFloat), share).to(q.scalar_type()).contiguous();
    dense.log_sum_exp = at::logaddexp(dense.log_sum_exp, log_sum_exp).contiguous();
  }
  if (bias.buckets && bias.beta != 0) {
    const int64_t num_pixels = bias.buckets->num_pixels();
    if (q.size(1) != num_pixels || k.size(1) != num_pixels)
      refuse("buckets of " + std::to_string(num_pixels) + " pixels for " + std::to_string(q.size(1)) +
             " queries and " + std::to_string(k.size(1)) + " keys");
    const DeviceTiles made = bias.tiles ? DeviceTiles{} : upload_tiles(*bias.buckets, q.device());
    add_bias(dense, heads_q, heads_k, heads_v, scale,
             bias.tiles ? bias.tiles->of(*bias.buckets, q.device()) : made, bias.beta);
  }
  return dense.out.transpose(1, 2).reshape(q.sizes());
}

}  // namespace patina::nn
