// Runs the CUDA kernel of sparse_merge on the CPU: every thread of a block is a fiber that executes
// merge_block itself, and the instructions that only a GPU has are done for a whole warp once its 32 threads
// have come to them, by the operand layouts of [PTX, Matrix Fragments]. What a GPU would leave to chance
// is chosen by Schedule, so that a missing barrier or wait shows.
#pragma once

#include <cstdint>
#include <vector>

#include "patina/attention/cuda/sparse_merge.h"

namespace patina::attention::test {

/// The two extremes between which a real machine lies.
struct Schedule {
  bool copies_arrive_late = true;  // when they are waited for, or at once
  bool last_warp_first = false;    // which warp runs ahead between barriers
};

uint16_t half_of_float(float value);  // IEEE binary16, to nearest even
float float_of_half(uint16_t half);

struct EmulationReport {
  int64_t conflicts = 0;        // matrix loads of which two rows fell on one bank
  int64_t multiplications = 0;  // matrix instructions
};

/// cuda::sparse_merge on host memory. Throws std::logic_error where the kernel misuses the machine: threads
/// of a warp apart at a collective instruction, addresses unaligned or out of shared memory, copies from
/// outside q, k and v (`q_size` etc. in elements).
struct Extents {
  int64_t q_size, k_size, v_size;
};
EmulationReport emulate_sparse_merge(const cuda::SparseMerge& merge, const Extents& extents,
                                     const Schedule& schedule);

}  // namespace patina::attention::test
