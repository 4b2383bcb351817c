// What the processor is called.
#pragma once

#include <string>

namespace patina {

/// "Intel(R) Xeon(R) Processor @ 2.70GHz", as Linux tells it; "unknown processor" where it does not.
std::string processor_name();

}  // namespace patina
