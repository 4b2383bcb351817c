// patina's attention on CUDA as torch operators, for bench_attention_cuda.py, which compiles this file and
// loads it: torch.ops.patina_bench.*. Errors arrive in Python as RuntimeError.
#include <cmath>
#include <string>

#include <ATen/ATen.h>
#include <torch/custom_class.h>
#include <torch/library.h>

#include "emulated_gpu/emulated_gpu.h"
#include "patina/attention/cuda/sparse_merge.h"
#include "patina/base/error.h"
#include "patina/nn/attend_cuda.h"

namespace {

using namespace patina;

std::vector<int32_t> to_vector(const at::Tensor& x) {
  const at::Tensor flat = x.to(at::kInt).contiguous();
  return {flat.data_ptr<int32_t>(), flat.data_ptr<int32_t>() + flat.numel()};
}

/// KeyBuckets with its tiles on the devices.
struct Bias : torch::CustomClassHolder {
  /// offsets i32 [N+1], keys i32, on the CPU.
  Bias(int64_t grid, int64_t view_width, int64_t view_height, int64_t window_radius,
       const at::Tensor& offsets, const at::Tensor& keys)
      : buckets{static_cast<int>(grid),          static_cast<int>(view_width), static_cast<int>(view_height),
                static_cast<int>(window_radius), to_vector(offsets),           to_vector(keys)} {
    attention::validate(buckets);
  }
  /// Makes the tiles, as the first call on a device does, and counts them: blocks, tiles, bytes.
  std::vector<int64_t> tile_counts() const {
    const attention::cuda::BiasTiles tiles = attention::cuda::make_bias_tiles(buckets);
    return {static_cast<int64_t>(tiles.blocks.size()), tiles.num_tiles(),
            static_cast<int64_t>(tiles.blocks.size() * sizeof(attention::cuda::TiledBlock) +
                                 4 * (tiles.keys.size() + tiles.masks.size()))};
  }
  at::Tensor biased_keys(int64_t query) const {
    const std::vector<int32_t> keys = attention::biased_keys(buckets, query);
    return at::tensor(at::IntArrayRef(std::vector<int64_t>(keys.begin(), keys.end())), at::kLong);
  }

  attention::KeyBuckets buckets;
  nn::DeviceTilesCache tiles;
};
using BiasPointer = c10::intrusive_ptr<Bias>;

nn::DenseKernel kernel_named(const std::string& name) {
  for (const nn::DenseKernel kernel :
       {nn::DenseKernel::kCudnn, nn::DenseKernel::kFlash, nn::DenseKernel::kEfficient})
    if (name == nn::name_of(kernel)) return kernel;
  throw Error(ErrorCode::kUsage, "kernel", name + ", expected cudnn, flash or efficient");
}

/// nn::attend on the device: q, k, v [B,N,heads·d].
at::Tensor attend(const at::Tensor& q, const at::Tensor& k, const at::Tensor& v, int64_t num_heads,
                  const std::optional<BiasPointer>& bias, double beta) {
  return nn::attend_cuda(
      q, k, v, num_heads,
      bias ? nn::LevelBias{&(*bias)->buckets, static_cast<float>(beta), &(*bias)->tiles} : nn::LevelBias{});
}

/// q, k, v [B,heads,N,d] -> output and log-sum-exp.
std::tuple<at::Tensor, at::Tensor> dense(const std::string& kernel, const at::Tensor& q, const at::Tensor& k,
                                         const at::Tensor& v, double scale) {
  const nn::DenseResult result =
      nn::dense_attention(kernel_named(kernel), q, k, v, static_cast<float>(scale));
  return {result.out, result.log_sum_exp};
}

void add_bias(const at::Tensor& out, const at::Tensor& log_sum_exp, const at::Tensor& q, const at::Tensor& k,
              const at::Tensor& v, double scale, const BiasPointer& bias, double beta) {
  nn::add_bias({out, log_sum_exp}, q, k, v, static_cast<float>(scale),
               bias->tiles.of(bias->buckets, q.device()), static_cast<float>(beta));
}

std::string rule(const at::Tensor& q) {
  return nn::name_of(nn::dense_kernel_for(q.scalar_type(), q.size(-1)));
}

bool takes(const std::string& kernel, const at::Tensor& q) {
  return nn::takes(kernel_named(kernel), q.scalar_type(), q.size(-1));
}

/// add_bias on the CPU, every thread of every block emulated: contiguous bf16 or fp16 tensors [B,heads,N,d].
/// Returns the number of matrix loads with bank conflicts.
int64_t emulate_add_bias(const at::Tensor& out, const at::Tensor& log_sum_exp, const at::Tensor& q,
                         const at::Tensor& k, const at::Tensor& v, double scale, const BiasPointer& bias,
                         double beta) {
  const attention::cuda::BiasTiles tiles = attention::cuda::make_bias_tiles(bias->buckets);
  attention::cuda::SparseMerge merge;
  merge.shape = {q.size(0), q.size(2), k.size(2), q.size(1), q.size(3)};
  merge.element =
      q.scalar_type() == at::kBFloat16 ? attention::cuda::Element16::kBf16 : attention::cuda::Element16::kF16;
  merge.q = q.data_ptr(), merge.k = k.data_ptr(), merge.v = v.data_ptr(), merge.out = out.data_ptr();
  merge.log_sum_exp = log_sum_exp.data_ptr<float>();
  const auto strides_of = [](const at::Tensor& x) {
    return attention::Strides{x.stride(0), x.stride(2), x.stride(1)};
  };
  merge.q_strides = strides_of(q), merge.k_strides = strides_of(k), merge.v_strides = strides_of(v);
  merge.out_strides = strides_of(out), merge.log_sum_exp_strides = strides_of(log_sum_exp);
  merge.scale = static_cast<float>(scale), merge.beta = static_cast<float>(beta);
  merge.blocks = tiles.blocks.data(), merge.keys = tiles.keys.data(), merge.masks = tiles.masks.data();
  merge.num_blocks = static_cast<int32_t>(tiles.blocks.size()), merge.row_stride = tiles.row_stride;
  return attention::test::emulate_sparse_merge(merge, {q.numel(), k.numel(), v.numel()}, {}).conflicts;
}

}  // namespace

TORCH_LIBRARY(patina_bench, m) {
  m.class_<Bias>("Bias")
      .def(torch::init<int64_t, int64_t, int64_t, int64_t, const at::Tensor&, const at::Tensor&>())
      .def("tile_counts", &Bias::tile_counts)
      .def("biased_keys", &Bias::biased_keys);
  m.def("attend", &attend);
  m.def("dense", &dense);
  m.def("add_bias", &add_bias);
  m.def("rule", &rule);
  m.def("takes", &takes);
  m.def("emulate_add_bias", &emulate_add_bias);
}
