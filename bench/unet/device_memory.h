// How much memory a measurement took at the most.
#pragma once

#include <cstdint>

#include <c10/core/Device.h>

namespace patina::bench {

/// On the processor what the process held of the machine's memory; on a CUDA device what tensors held of the
/// device's, as torch.cuda.max_memory_allocated counts it.
int64_t peak_bytes(c10::Device device);

}  // namespace patina::bench
