// The memory of this process and of the machine, in bytes, as Linux counts it; 0 where it gives no figure.
#pragma once

#include <cstdint>

namespace patina {

int64_t resident_bytes();       // of this process, now
int64_t peak_resident_bytes();  // of this process, the most so far
int64_t available_bytes();      // of the machine, before it has to swap
int64_t total_bytes();          // of the machine

}  // namespace patina
