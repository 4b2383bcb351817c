// The example asset with textures an eighth as wide, for tests that run whole stages: reading, fitting and
// showing its own textures takes most of a small run.
#pragma once

#include <filesystem>

namespace patina::test {

/// examples/kettle.glb with textures of 128, 64 and 32 texels a side. Made once a test program.
std::filesystem::path small_kettle();

}  // namespace patina::test
