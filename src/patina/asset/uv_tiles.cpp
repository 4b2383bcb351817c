#include "patina/asset/uv_tiles.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "patina/asset/source_document.h"
#include "patina/asset/uri.h"
#include "patina/base/text.h"

namespace patina::asset {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 3> kTokens{"<udim>", "%(udim)d", "<uvtile>"};
constexpr int kColumns = 10, kRows = 100;  // UDIM counts ten columns

struct Token {
  size_t begin = std::string::npos, size = 0;
};

Token token_in(std::string_view file) {
  const std::string low = lowered(std::string(file));
  for (const std::string_view token : kTokens)
    if (const size_t at = low.find(token); at != std::string::npos) return {at, token.size()};
  return {};
}

// The tile that holds all three corners; nothing where they lie in several, or beyond UDIM's range.
std::optional<int> tile_of(const std::array<vec2, 3>& corners) {
  constexpr float kSlack = 1e-4f;  // a corner on a border belongs to the tile of its triangle
  const vec2 middle = (corners[0] + corners[1] + corners[2]) / 3.0f;
  if (!(middle.x >= 0 && middle.x < kColumns && middle.y <= 1 && middle.y > 1 - kRows)) return std::nullopt;
  const float column = std::floor(middle.x), row = std::floor(1 - middle.y);
  for (const vec2& c : corners)
    if (c.x < column - kSlack || c.x > column + 1 + kSlack || 1 - c.y < row - kSlack ||
        1 - c.y > row + 1 + kSlack)
      return std::nullopt;
  return 1001 + static_cast<int>(column) + kColumns * static_cast<int>(row);
}

bool is_number(std::string_view text) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string_view::npos;
}

// Four digits, of which the first is a 1.
std::optional<int> tile_of_number(std::string_view text) {
  return text.size() == 4 && text[0] == '1' && is_number(text) ? parse_number<int>(text) : std::nullopt;
}

// The tile that u2_v1 tells, both counted from 1.
std::optional<int> tile_of_u_and_v(const std::string& text) {
  const std::string low = lowered(text);
  const size_t between = low.find("_v");
  if (!low.starts_with("u") || between == std::string::npos) return std::nullopt;
  const auto u = parse_number<int>(std::string_view(low).substr(1, between - 1));
  const auto v = parse_number<int>(std::string_view(low).substr(between + 2));
  if (!u || !v || *u < 1 || *u > kColumns || *v < 1 || *v > kRows) return std::nullopt;
  return 1000 + *u + kColumns * (*v - 1);
}

// Tiles in one folder of files that begin and end like this.
std::vector<int> tiles_in(const fs::path& folder, const std::string& front, const std::string& back,
                          bool by_u_and_v) {
  std::set<int> tiles;
  std::error_code failure;
  for (fs::directory_iterator it(folder.empty() ? "." : folder, failure), end; !failure && it != end;
       it.increment(failure)) {
    const std::string found = it->path().filename().string();
    if (found.size() <= front.size() + back.size() || !found.starts_with(front) || !found.ends_with(back))
      continue;
    const std::string middle = found.substr(front.size(), found.size() - front.size() - back.size());
    if (const auto tile = by_u_and_v ? tile_of_u_and_v(middle) : tile_of_number(middle)) tiles.insert(*tile);
  }
  return {tiles.begin(), tiles.end()};
}

// Where a tile's number stands in a file's name, with other letters around it; npos where there is none.
size_t place_of_number(const std::string& name) {
  for (size_t at = name.find('1'); at != std::string::npos; at = name.find('1', at + 1)) {
    const bool begins = at == 0 || !is_number(name.substr(at - 1, 1));
    const bool ends = !is_number(name.substr(std::min(at + 4, name.size()), 1));
    if (begins && ends && tile_of_number(name.substr(at, 4))) return at;
  }
  return std::string::npos;
}

// The texture as one by tiles if its file is that of one of them, wood.1001.png, and the files of others
// into which the UVs reach lie beside it.
std::optional<TiledTexture> numbered_tiles(const Asset& asset, int material, const TextureRef& texture) {
  const auto image = static_cast<size_t>(texture.image);
  if (!texture || image >= asset.source->image_files.size()) return std::nullopt;
  const std::string& file = asset.source->image_files[image];
  const fs::path path(file);
  std::string name = path.filename().string();
  const size_t at = place_of_number(name);
  if (at == std::string::npos) return std::nullopt;
  const int own = *tile_of_number(name.substr(at, 4));
  const std::vector<int> reached = uv_tiles(asset, material, texture.uv_set);
  if (reached.size() < 2) return std::nullopt;
  const std::string pattern = name.replace(at, 4, "<UDIM>");
  const std::vector<int> there =
      tiles_on_disk(asset.source->folder(), "", (path.parent_path() / pattern).string());
  const auto is_other = [&](int tile) {
    return tile != own && std::find(there.begin(), there.end(), tile) != there.end();
  };
  if (std::none_of(reached.begin(), reached.end(), is_other)) return std::nullopt;
  return TiledTexture{asset.materials[static_cast<size_t>(material)].name, file, there};
}

}  // namespace

bool names_tiles(std::string_view file) {
  return token_in(file).size > 0;
}

std::vector<int> uv_tiles(const Asset& asset, int material, int uv_set) {
  std::set<int> tiles;
  const auto set = static_cast<size_t>(uv_set);
  for (const Primitive& primitive : asset.primitives) {
    if (primitive.material != material || set >= primitive.uv.size()) continue;
    const std::vector<vec2>& uv = primitive.uv[set];
    for (const uvec3& t : primitive.triangles) {
      const auto tile = tile_of({uv[t.x], uv[t.y], uv[t.z]});
      if (!tile) return {};
      tiles.insert(*tile);
    }
  }
  if (tiles == std::set<int>{1001}) return {};
  return {tiles.begin(), tiles.end()};
}

std::vector<int> tiles_on_disk(const fs::path& folder, const fs::path& base, const std::string& file) {
  std::string slashed = file;
  std::replace(slashed.begin(), slashed.end(), '\\', '/');
  const fs::path given(slashed);
  const std::string name = given.filename().string();
  const Token token = token_in(name);
  if (token.size == 0) return {};
  const std::string front = name.substr(0, token.begin), back = name.substr(token.begin + token.size);
  const bool by_u_and_v = lowered(name.substr(token.begin, token.size)) == kTokens.back();
  // Like the files of other textures: where the name says, else beside the library, else beside the asset.
  for (const fs::path& at : {(base / given).parent_path(), base, fs::path()}) {
    try {
      const std::string inside = at.lexically_normal().string();
      const fs::path where = inside.empty() || inside == "." ? folder : resolve_inside(folder, inside, "");
      if (auto tiles = tiles_in(where, front, back, by_u_and_v); !tiles.empty()) return tiles;
    } catch (const Error&) {  // it leads out of the folder
      continue;
    }
  }
  return {};
}

std::vector<TiledTexture> tiled_textures(const Asset& asset) {
  if (!asset.source) return {};
  std::vector<TiledTexture> found = asset.source->tiled_textures;
  for (size_t m = 0; m < asset.materials.size(); ++m) {
    const Material& material = asset.materials[m];
    for (const TextureRef* texture :
         {&material.base_color, &material.metallic_roughness, &material.normal, &material.emissive})
      if (auto tiled = numbered_tiles(asset, static_cast<int>(m), *texture)) {
        found.push_back(*std::move(tiled));
        break;
      }
  }
  return found;
}

std::string tile_list(const std::vector<int>& tiles) {
  constexpr size_t kMost = 10;
  const std::vector<int> shown(tiles.begin(),
                               tiles.begin() + static_cast<std::ptrdiff_t>(std::min(tiles.size(), kMost)));
  return fmt::format("{}{}", fmt::join(shown, ", "), tiles.size() > kMost ? " and more" : "");
}

void refuse_tiled_textures(const Asset& asset) {
  const std::vector<TiledTexture> found = tiled_textures(asset);
  if (found.empty()) return;
  const TiledTexture& first = found.front();
  throw Error(
      ErrorCode::kUnsupported, asset.path.string(),
      fmt::format(
          "material '{}' has a picture for each UDIM tile, '{}' ({}), expected one picture; give each tile a "
          "material of its own with that tile's picture (in Blender: Edit Mode, select the faces of a tile, "
          "assign a new material) and export again",
          printable(first.material, 60), printable(first.file, 100),
          first.tiles.empty() ? "no tile's file was found" : "found: " + tile_list(first.tiles)));
}

}  // namespace patina::asset
