// The multiply-add peak of one core: register-blocked loops without a memory access, one an instruction set.
#pragma once

#include "patina/attention/attention.h"

namespace patina::bench {

/// GFLOP/s of one core for the instruction that `isa`'s kernel is made of (f32 multiply-add, VDPBF16PS or
/// TDPBF16PS), by CPU time of this thread, best of several runs. The processor must support it
/// (attention::supported_isas).
double matrix_peak_gflops(attention::CpuIsa isa);

/// The same for TDPBF16PS on Gaussian operands that come from the first cache, as a blocked product's do:
/// each tile loaded feeds two products. Numbers that change cost power, and the clock sinks. Best of several
/// runs.
double loaded_tile_gflops();

/// CPU seconds of the calling thread, and of all threads of the process.
double thread_seconds();
double process_seconds();

}  // namespace patina::bench
