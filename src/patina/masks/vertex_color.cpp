#include "patina/masks/vertex_color.h"

#include <algorithm>

#include "patina/asset/texel_raster.h"
#include "patina/masks/padding.h"

namespace patina::masks {

std::optional<asset::Map> vertex_color_strength(std::span<const asset::Primitive* const> primitives,
                                                const asset::Map& like, int width, int height, int material) {
  const bool any = std::any_of(primitives.begin(), primitives.end(), [&](const asset::Primitive* p) {
    return p->material == material && !p->color.empty();
  });
  if (!any) return std::nullopt;
  asset::Map map = asset::blank_map(like, width, height);
  Image covered(width, height, 1);
  asset::each_touched_texel(primitives, map, material, [&](const asset::TouchedTexel& touched) {
    const auto& colors = touched.primitive->color;
    const vec4 color = colors.empty() ? vec4(1.0f) : touched.interpolated(colors);
    const float grey = std::clamp((color.r + color.g + color.b) / 3.0f, 0.0f, 1.0f);
    // A place that has the texel's centre counts before places half a texel beside it.
    const float certainty = touched.inside ? 1.0f : 0.5f;
    float &value = map.texels.pixels[touched.texel], &known = covered.pixels[touched.texel];
    if (certainty < known) return;
    value = certainty > known ? grey : std::max(value, grey);
    known = certainty;
  });
  map.texels = asset::dilated(map, covered, kPaddingTexels);
  return map;
}

}  // namespace patina::masks
