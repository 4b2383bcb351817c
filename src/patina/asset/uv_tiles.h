// UDIM: UVs that lie in several unit tiles, and textures of which each tile has a file of its own. Tile
// 1001 + column + 10 · row, rows counted upwards from v = 0 at the bottom.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "patina/asset/asset.h"

namespace patina::asset {

/// The tiles, in order, where every triangle of a material keeps to one of them and not all lie in 1001; else
/// nothing, as for UVs that repeat a texture.
std::vector<int> uv_tiles(const Asset& asset, int material, int uv_set);

/// A texture of which each tile has a file of its own.
struct TiledTexture {
  std::string material;    // that uses it
  std::string file;        // as written: wood.<UDIM>.png, or wood.1001.png
  std::vector<int> tiles;  // those whose files are there, in order
};

/// Whether a file's name holds <UDIM>, %(UDIM)d or <UVTILE>, in any case of letters.
bool names_tiles(std::string_view file);

/// The tiles of `file`, a name with such a token, whose files are there. It is relative to `base`, and that
/// to `folder`; nothing outside of the latter is looked at.
std::vector<int> tiles_on_disk(const std::filesystem::path& folder, const std::filesystem::path& base,
                               const std::string& file);

/// Of the materials that the asset's meshes use: where the file's name has such a token; and where it has the
/// number of a tile, the material's UVs keep to several tiles, and files of those lie beside it. UVs that
/// merely repeat a texture are neither.
std::vector<TiledTexture> tiled_textures(const Asset& asset);

/// Throws Error{kUnsupported} that names the first of them, its tiles, and what to do.
void refuse_tiled_textures(const Asset& asset);

/// Tiles for a reader: "1001, 1002", at most ten.
std::string tile_list(const std::vector<int>& tiles);

}  // namespace patina::asset
