// make_kettle OUT.glb: makes the example asset, the same bytes every time.
#include <array>
#include <filesystem>

#include "atlas.h"
#include "console/program.h"
#include "glb.h"
#include "patina/base/files.h"
#include "shape.h"

namespace {

using namespace patina::kettle;

void make(const std::filesystem::path& out) {
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
  patina::write_file(out, std::span<const uint8_t>(bytes));
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App program("Makes the example asset, the same bytes every time.", "make_kettle");
  std::filesystem::path out;
  program.add_option("OUT.glb", out, "File to write")->required();
  return patina::tools::run_program(program, argc, argv, [&] { make(out); });
}
