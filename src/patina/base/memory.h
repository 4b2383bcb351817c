// What this process holds of the machine's memory, as the kernel counts it. Zero where it does not tell.
#pragma once

#include <cstdint>

namespace patina {

int64_t resident_bytes();       // now
int64_t peak_resident_bytes();  // at the most so far
int64_t available_bytes();      // what may be taken before the machine has to swap

}  // namespace patina
