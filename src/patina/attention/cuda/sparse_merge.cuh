// merge_block on a real GPU: its instructions as PTX, the kernel, and its launch for one element type.
// Compute capability 8.0 or newer: asynchronous copies and m16n8k16 products of 16-bit operands.
#pragma once

#include <cuda_bf16.h>
#include <cuda_fp16.h>
#include <cuda_runtime.h>

#include "patina/attention/cuda/merge_block.h"

namespace patina::attention::cuda {

/// The `Gpu` of merge_block, for the thread that runs it. kElement decides what 16 bits mean.
template <Element16 kElement>
struct DeviceThread {
  static constexpr unsigned kWholeWarp = 0xffffffff;
  uint32_t shared;  // where dynamic shared memory begins, as shared-memory instructions count

  __device__ DeviceThread() {
    extern __shared__ __align__(128) unsigned char patina_shared[];
    shared = static_cast<uint32_t>(__cvta_generic_to_shared(patina_shared));
  }

  PATINA_DEVICE int thread() const { return static_cast<int>(threadIdx.x); }
  PATINA_DEVICE void barrier() { __syncthreads(); }
  PATINA_DEVICE uint32_t shuffle(uint32_t value, int source) {
    return __shfl_sync(kWholeWarp, value, source);
  }
  PATINA_DEVICE float exchange(float value, int distance) {
    return __shfl_xor_sync(kWholeWarp, value, distance);
  }
  PATINA_DEVICE bool any(bool condition) { return __any_sync(kWholeWarp, condition); }

  // The copy skips the first cache: rows are shared by blocks on other multiprocessors, in the second.
  PATINA_DEVICE void copy16(uint32_t to, const void* from, bool exists) {
    const int bytes = exists ? 16 : 0;  // the rest becomes zeros
    asm volatile("cp.async.cg.shared.global [%0], [%1], 16, %2;\n" ::"r"(shared + to), "l"(from), "r"(bytes)
                 : "memory");
  }
  PATINA_DEVICE void commit_copies() { asm volatile("cp.async.commit_group;\n" ::: "memory"); }
  template <int kPending>
  PATINA_DEVICE void wait_copies() {
    asm volatile("cp.async.wait_group %0;\n" ::"n"(kPending) : "memory");
  }

  PATINA_DEVICE void load_matrices(uint32_t (&m)[4], uint32_t address) {
    asm volatile("ldmatrix.sync.aligned.m8n8.x4.shared.b16 {%0, %1, %2, %3}, [%4];\n"
                 : "=r"(m[0]), "=r"(m[1]), "=r"(m[2]), "=r"(m[3])
                 : "r"(shared + address)
                 : "memory");
  }
  PATINA_DEVICE void load_transposed(uint32_t (&m)[4], uint32_t address) {
    asm volatile("ldmatrix.sync.aligned.m8n8.x4.trans.shared.b16 {%0, %1, %2, %3}, [%4];\n"
                 : "=r"(m[0]), "=r"(m[1]), "=r"(m[2]), "=r"(m[3])
                 : "r"(shared + address)
                 : "memory");
  }

  PATINA_DEVICE void multiply16(float (&c)[4], const uint32_t (&a)[4], uint32_t b0, uint32_t b1) {
    if constexpr (kElement == Element16::kBf16)
      asm("mma.sync.aligned.m16n8k16.row.col.f32.bf16.bf16.f32 {%0, %1, %2, %3}, {%4, %5, %6, %7}, {%8, %9}, "
          "{%0, %1, %2, %3};\n"
          : "+f"(c[0]), "+f"(c[1]), "+f"(c[2]), "+f"(c[3])
          : "r"(a[0]), "r"(a[1]), "r"(a[2]), "r"(a[3]), "r"(b0), "r"(b1));
    else
      asm("mma.sync.aligned.m16n8k16.row.col.f32.f16.f16.f32 {%0, %1, %2, %3}, {%4, %5, %6, %7}, {%8, %9}, "
          "{%0, %1, %2, %3};\n"
          : "+f"(c[0]), "+f"(c[1]), "+f"(c[2]), "+f"(c[3])
          : "r"(a[0]), "r"(a[1]), "r"(a[2]), "r"(a[3]), "r"(b0), "r"(b1));
  }
  PATINA_DEVICE void multiply8(float (&c)[4], uint32_t a0, uint32_t a1, uint32_t b0) {
    if constexpr (kElement == Element16::kBf16)
      asm("mma.sync.aligned.m16n8k8.row.col.f32.bf16.bf16.f32 {%0, %1, %2, %3}, {%4, %5}, {%6}, "
          "{%0, %1, %2, %3};\n"
          : "+f"(c[0]), "+f"(c[1]), "+f"(c[2]), "+f"(c[3])
          : "r"(a0), "r"(a1), "r"(b0));
    else
      asm("mma.sync.aligned.m16n8k8.row.col.f32.f16.f16.f32 {%0, %1, %2, %3}, {%4, %5}, {%6}, "
          "{%0, %1, %2, %3};\n"
          : "+f"(c[0]), "+f"(c[1]), "+f"(c[2]), "+f"(c[3])
          : "r"(a0), "r"(a1), "r"(b0));
  }

  PATINA_DEVICE void load_pair(const uint16_t* from, float (&two)[2]) const {
    const uint32_t bits = *reinterpret_cast<const uint32_t*>(from);
    float2 pair;
    if constexpr (kElement == Element16::kBf16)
      pair = __bfloat1622float2(reinterpret_cast<const __nv_bfloat162&>(bits));
    else
      pair = __half22float2(reinterpret_cast<const __half2&>(bits));
    two[0] = pair.x, two[1] = pair.y;
  }
  PATINA_DEVICE void store_pair(uint16_t* to, float first, float second) const {
    *reinterpret_cast<uint32_t*>(to) = pack(first, second);
  }
  PATINA_DEVICE uint32_t pack(float first, float second) const {
    if constexpr (kElement == Element16::kBf16) {
      const __nv_bfloat162 pair = __floats2bfloat162_rn(first, second);
      return reinterpret_cast<const uint32_t&>(pair);
    } else {
      const __half2 pair = __floats2half2_rn(first, second);
      return reinterpret_cast<const uint32_t&>(pair);
    }
  }

  PATINA_DEVICE static float exp2(float x) {
    float y;
    asm("ex2.approx.ftz.f32 %0, %1;\n" : "=f"(y) : "f"(x));  // to 2 units in the last place
    return y;
  }
  PATINA_DEVICE static float log2(float x) { return log2f(x); }
  PATINA_DEVICE static float max(float x, float y) { return fmaxf(x, y); }
  PATINA_DEVICE static float multiply_add(float x, float y, float z) { return fmaf(x, y, z); }
  PATINA_DEVICE static float infinity() { return __int_as_float(0x7f800000); }
};

/// Blocks a multiprocessor that the compiler must leave registers for (65,536 registers, 128 threads a
/// block).
template <int kPieces>
constexpr int kResidentBlocks = kPieces <= 5    ? 5
                                : kPieces <= 10 ? 4
                                : kPieces <= 20 ? 3
                                                : 2;

/// Heads of one query block run side by side: they share its list, and their keys share cache lines.
template <Element16 kElement, int kPieces>
__global__ void __launch_bounds__(kThreads, kResidentBlocks<kPieces>)
    sparse_merge_kernel(const __grid_constant__ SparseMerge merge,
                        const __grid_constant__ MergeConstants constants) {
  DeviceThread<kElement> gpu;
  const int num_heads = static_cast<int>(merge.shape.num_heads);
  merge_block<kPieces>(gpu, merge, constants, static_cast<int>(blockIdx.x) / num_heads,
                       static_cast<int>(blockIdx.x) % num_heads, static_cast<int>(blockIdx.y));
}

/// Enqueues the kernel of one element type. Each type is a translation unit, compiled beside the other.
template <Element16 kElement>
cudaError_t launch_merge(const SparseMerge& merge, const MergeConstants& constants, cudaStream_t stream) {
  cudaError_t error = cudaSuccess;
  dispatch_pieces(merge.shape.head_dim, [&]<int kPieces>() {
    constexpr int kBytes = SharedLayout<kPieces>::kBytes;
    const auto kernel = sparse_merge_kernel<kElement, kPieces>;
    if (kBytes > 48 << 10)  // what a block gets without asking
      error = cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, kBytes);
    if (error != cudaSuccess) return;
    const dim3 grid(static_cast<unsigned>(merge.num_blocks * merge.shape.num_heads),
                    static_cast<unsigned>(merge.shape.batch));
    kernel<<<grid, kThreads, kBytes, stream>>>(merge, constants);
    error = cudaGetLastError();
  });
  return error;
}

cudaError_t launch_merge_bf16(const SparseMerge& merge, const MergeConstants& constants, cudaStream_t stream);
cudaError_t launch_merge_f16(const SparseMerge& merge, const MergeConstants& constants, cudaStream_t stream);

}  // namespace patina::attention::cuda
