// The kettle's form: a lathed body with lid and knob, a swept spout, and an arched handle with a wooden grip.
// About 0.25 m high, standing on y = 0, the spout toward +X.
#pragma once

#include <vector>

#include "patch.h"

namespace patina::kettle {

/// Every patch faces outward and shows its island unmirrored; none lies hidden behind another but for the bit
/// under the spout.
std::vector<Patch> kettle_patches();

}  // namespace patina::kettle
