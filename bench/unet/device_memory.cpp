#include "device_memory.h"

#include "patina/base/memory.h"

#ifdef PATINA_CUDA
#include <c10/cuda/CUDACachingAllocator.h>
#include <c10/cuda/CUDAFunctions.h>
#endif

namespace patina::bench {

int64_t peak_bytes([[maybe_unused]] c10::Device device) {
#ifdef PATINA_CUDA
  if (device.is_cuda()) {
    const auto all = static_cast<size_t>(c10::CachingAllocator::StatType::AGGREGATE);
    return c10::cuda::CUDACachingAllocator::getDeviceStats(c10::cuda::current_device())
        .allocated_bytes[all]
        .peak;
  }
#endif
  return peak_resident_bytes();
}

}  // namespace patina::bench
