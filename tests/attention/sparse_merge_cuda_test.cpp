// sparse_merge on a real CUDA device, over the cases of the emulated one. Built by the cuda preset; skipped
// where there is no device.
#include <cuda_runtime_api.h>

#include <gtest/gtest.h>

#include "merge_problem.h"
#include "patina/attention/cuda/sparse_merge.h"

namespace patina::attention::test {
namespace {

using cuda::Element16;

bool has_device() {
  int count = 0;
  return cudaGetDeviceCount(&count) == cudaSuccess && count > 0;
}
#define PATINA_REQUIRE_DEVICE() \
  if (!has_device()) GTEST_SKIP() << "no CUDA device here"

#define PATINA_EXPECT_CUDA(call) EXPECT_EQ(call, cudaSuccess) << cudaGetErrorString(cudaGetLastError())

/// A copy of host memory on the device; freed with the object.
class OnDevice {
 public:
  OnDevice(const void* host, size_t bytes) : bytes_(bytes) {
    if (bytes == 0) return;
    PATINA_EXPECT_CUDA(cudaMalloc(&memory_, bytes));
    PATINA_EXPECT_CUDA(cudaMemcpy(memory_, host, bytes, cudaMemcpyHostToDevice));
  }
  ~OnDevice() { cudaFree(memory_); }
  OnDevice(const OnDevice&) = delete;
  OnDevice& operator=(const OnDevice&) = delete;

  template <class T>
  T* as() const {
    return static_cast<T*>(memory_);
  }
  void copy_back(void* host) const {
    PATINA_EXPECT_CUDA(cudaMemcpy(host, memory_, bytes_, cudaMemcpyDeviceToHost));
  }

 private:
  void* memory_ = nullptr;
  size_t bytes_;
};

Merged merge_on_device(const Problem& p, const Result& dense, Element16 element, Memory memory) {
  MergeBuffers buffers = lay_out(p, dense, element, memory);
  const auto upload = [](const auto& vector) {
    return OnDevice(vector.data(), vector.size() * sizeof(*vector.data()));
  };
  const OnDevice q = upload(buffers.q.pieces), k = upload(buffers.k.pieces), v = upload(buffers.v.pieces),
                 out = upload(buffers.out.pieces), log_sum_exp = upload(buffers.log_sum_exp);
  const OnDevice blocks = upload(buffers.tiles.blocks), keys = upload(buffers.tiles.keys),
                 masks = upload(buffers.tiles.masks);
  cuda::SparseMerge m = buffers.merge;
  m.q = q.as<void>(), m.k = k.as<void>(), m.v = v.as<void>(), m.out = out.as<void>();
  m.log_sum_exp = log_sum_exp.as<float>();
  m.blocks = blocks.as<cuda::TiledBlock>(), m.keys = keys.as<int32_t>(), m.masks = masks.as<uint32_t>();
  cuda::sparse_merge(m, nullptr);
  PATINA_EXPECT_CUDA(cudaDeviceSynchronize());
  out.copy_back(buffers.out.data());
  log_sum_exp.copy_back(buffers.log_sum_exp.data());
  return read_back(p, buffers);
}

class SparseMergeOnDevice : public testing::TestWithParam<MergeCase> {};
INSTANTIATE_TEST_SUITE_P(All, SparseMergeOnDevice, testing::ValuesIn(merge_cases()),
                         [](const auto& test_info) { return std::to_string(test_info.index); });

TEST_P(SparseMergeOnDevice, error_is_at_most_twice_that_of_a_plain_version) {
  PATINA_REQUIRE_DEVICE();
  const auto& [spec, element, memory] = GetParam();
  const Problem p = make_problem16(spec, element, 1);
  const Result dense = truth(without_bias(p));
  const Merged merged = merge_on_device(p, dense, element, memory);
  expect_twice_plain(p, merged.result, element);
  EXPECT_EQ(merge_on_device(p, dense, element, memory).bits, merged.bits) << "two runs differ";
}

TEST(SparseMergeDevice, keeps_every_bit_where_beta_is_zero) {
  PATINA_REQUIRE_DEVICE();
  const Problem p =
      make_problem16(merge_spec(1, 2, 40, 1, {2, 9, 7, 2, Landing::kProjected, 0}), Element16::kBf16, 3);
  const Result dense = truth(without_bias(p));
  MergeBuffers untouched = lay_out(p, dense, Element16::kBf16, Memory::kTokens);
  EXPECT_EQ(merge_on_device(p, dense, Element16::kBf16, Memory::kTokens).bits, read_back(p, untouched).bits);
}

}  // namespace
}  // namespace patina::attention::test
