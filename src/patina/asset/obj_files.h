// Files that OBJ and MTL statements name: libraries and pictures, found although their names were written on
// another machine.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "patina/base/math.h"

namespace patina::asset {

/// A file that was found inside the asset's folder.
struct FoundFile {
  std::filesystem::path relative;  // to the asset's folder, without '..'
  bool as_written = true;          // false: under another spelling or in another folder than the name says
};

/// Looks for the file that `rest` (of a statement) names, `base` being the folder that names are relative to
/// (relative to `folder`, the asset's). Tried in turn: the name as it stands, without quotes or a comment
/// behind it, with '/' for '\'; then its last part alone (absolute paths of another machine), in `base` and
/// in `folder`, in any case of letters. Nothing outside of `folder` is looked at.
std::optional<FoundFile> find_named_file(const std::filesystem::path& folder,
                                         const std::filesystem::path& base, std::string_view rest);

/// A texture statement of an MTL file: options, then the file.
struct TextureStatement {
  vec2 scale{1.0f}, offset{0.0f};  // -s, -o
  bool clamp = false;              // -clamp on
  float bump_scale = 1.0f;         // -bm
  char channel = 'r';              // -imfchan: r, g, b, m (alpha), l (luminance) or z
  std::string options;             // as written, up to the file's name
  std::string file;                // as written; empty where the statement names none
};

/// Whether a keyword (lower case) names a picture: map_*, bump, norm, disp, decal, refl.
bool names_picture(std::string_view keyword);

/// Reads what follows the keyword. An option that is not known is taken as the beginning of the file's name.
TextureStatement texture_statement(std::string_view rest);

}  // namespace patina::asset
