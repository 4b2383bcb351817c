// OBJ material libraries: statements that a metallic-roughness material can honour.
#pragma once

#include <map>
#include <optional>

#include "patina/asset/source_document.h"

namespace patina::asset {

/// A texture statement: the file inside the asset's folder, and its options.
struct MtlTexture {
  std::filesystem::path path;
  vec2 scale{1.0f}, offset{0.0f};  // -s, -o
  bool clamp = false;              // -clamp on
  float bump_scale = 1.0f;         // -bm
};

struct MtlMaterial {
  Material material;  // factors; textures follow from the statements below
  std::optional<MtlTexture> base_color, normal, roughness, metallic, emissive;
  bool normal_may_be_height = false;  // map_Bump: some programs write a normal map here, some a height field
};

/// Reads one library. `folder` is the asset's; nothing outside of it is opened. Throws Error naming file and
/// line.
std::map<std::string, MtlMaterial> read_mtl(const std::string& asset_name,
                                            const std::filesystem::path& folder,
                                            const std::filesystem::path& path,
                                            std::vector<std::string>& warnings);

}  // namespace patina::asset
