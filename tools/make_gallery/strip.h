// The pictures of one result in a row.
#pragma once

#include <filesystem>

#include "patina/asset/asset.h"
#include "patina/image/image.h"

namespace patina::make_gallery {

/// View `view` of a run of patina enhance as it was rendered, as it was edited and with the new textures,
/// another view with the new textures, and the base colour of the material of which most surface changed,
/// before and after; each `side` pixels wide. [side, 6·side, 3] about, sRGB. Throws Error.
Image strip(const std::filesystem::path& run, const asset::Asset& before, const asset::Asset& after, int view,
            int other_view, int side);

}  // namespace patina::make_gallery
