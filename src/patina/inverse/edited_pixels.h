// Where the views were edited. What shows no edit keeps its material: the light cache is never exact, and to
// explain its errors the fit would bend the normals of polished metal that nobody touched.
#pragma once

#include <span>
#include <vector>

#include "patina/inverse/light_cache.h"
#include "patina/inverse/sample_taps.h"

namespace patina::inverse {

/// Relative change of a pixel from `clean` to `edited`, both tone-mapped linear.
float edit_of(const vec3& clean, const vec3& edited);

/// Whether the surface around each pixel of `cache` was edited, [pixels] from 0 (no) to 1: by the root mean
/// square of the pixels' changes, so that relief, which brightens and darkens in turn, counts where its
/// brightness crosses the old one. `views`: whose pixels they are; only those of the same material count as
/// around. `clean`: the views before they were edited, sRGB [H,W,3].
std::vector<float> edited_pixels(const LightCache& cache, const views::ViewSet& views,
                                 std::span<const Image> clean);

/// TextureField::edited of a map of width × height texels that is seen through `taps`. Texels that no view
/// saw count as edited: they follow those around them.
Image edited_texels(const LightCache& cache, std::span<const float> edited, const SampleTaps& taps, int width,
                    int height);

}  // namespace patina::inverse
