// make_kettle OUT.glb: makes the example asset, the same bytes every time.
#include <array>
#include <cstdio>
#include <exception>

#include "atlas.h"
#include "glb.h"
#include "patina/base/files.h"
#include "shape.h"

int main(int argc, char** argv) {
  using namespace patina::kettle;
  if (argc != 2) {
    std::fprintf(stderr, "usage: make_kettle OUT.glb\n");
    return 2;
  }
  try {
    // Texels a side, so that a metre of each material gets about 2000 texels.
    constexpr std::array kSizes{1024, 512, 256};
    constexpr double kPadding = 8.0 / 512;
    std::vector<Patch> patches = kettle_patches();
    pack_islands(patches, kPadding);
    std::array<Textures, kNumMaterials> textures;
    for (int m = 0; m < kNumMaterials; ++m)
      textures[static_cast<size_t>(m)] =
          make_textures(patches, static_cast<MaterialId>(m), kSizes[static_cast<size_t>(m)]);
    const auto bytes = kettle_glb(patches, textures);
    patina::write_file(argv[1], std::span<const uint8_t>(bytes));
    return 0;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "make_kettle: %s\n", e.what());
    return 1;
  }
}
