// What only a program may do to its process, so that the peak of each stage is measured on its own.
#pragma once

namespace patina::app {

/// Gives freed memory back to the system and resets the kernel's mark of the largest resident memory (Linux:
/// by writing 5 to clear_refs). Where that is forbidden the mark stays, an upper bound.
void reset_peak_memory();

}  // namespace patina::app
