// OBJ material libraries: statements that a metallic-roughness material can honour.
#pragma once

#include <map>
#include <optional>

#include "patina/asset/obj_files.h"
#include "patina/asset/source_document.h"

namespace patina::asset {

/// A texture statement whose file was found.
struct MtlTexture {
  std::filesystem::path path;  // inside the asset's folder
  TextureStatement statement;
};

struct MtlMaterial {
  Material material;  // factors; textures follow from the statements below
  std::optional<MtlTexture> base_color, normal, roughness, metallic, emissive;
  std::optional<TiledTexture> tiled;  // the first one that is by tiles, and so not read
  bool normal_may_be_height = false;  // map_Bump: some programs write a normal map here, some a height field
};

struct MtlLibrary {
  std::map<std::string, MtlMaterial> materials;  // by name as the file spells it
  std::vector<std::string> references;           // pictures that were found, relative to the asset's folder
  std::vector<std::string> notes;
};

/// Reads one library, `relative` to the asset's folder; nothing outside of that is opened. A statement that
/// cannot be understood, and a picture that is not there, are left out with a note.
MtlLibrary read_mtl(const std::string& asset_name, const std::filesystem::path& folder,
                    const std::filesystem::path& relative);

/// Text of a library: UTF-16 turned to UTF-8, else its bytes.
std::string read_mtl_text(const std::filesystem::path& path);

}  // namespace patina::asset
