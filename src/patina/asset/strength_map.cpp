#include "patina/asset/strength_map.h"

#include <algorithm>
#include <cmath>

#include "patina/asset/texel_raster.h"

namespace patina::asset {
namespace {

bool same_placement(const Map& a, const Map& b) {
  return a.uv_set == b.uv_set && a.uv_transform == b.uv_transform && a.wrap_s == b.wrap_s &&
         a.wrap_t == b.wrap_t;
}

// The source texels that target texel i overlaps on an axis: [first, last].
struct Overlap {
  int first, last;
};
Overlap overlap_of(int i, int from, int to) {
  const auto begin = static_cast<int64_t>(i) * from, end = begin + from;
  return {static_cast<int>(begin / to), static_cast<int>((end + to - 1) / to) - 1};
}

}  // namespace

float strength_at(const Map& strength, const vec2& uv_map) {
  if (strength.texels.num_pixels() == 1) return strength.texels.pixels[0];
  const BilinearTap tap = bilinear_tap(strength, uv_map);
  const auto nearest = std::max_element(tap.weight.begin(), tap.weight.end()) - tap.weight.begin();
  if (strength.texels.pixels[static_cast<size_t>(tap.texel[static_cast<size_t>(nearest)])] <= 0.0f)
    return 0.0f;
  return read1(strength, tap);
}

Map resized_strength(const Map& strength, int width, int height) {
  const Image& from = strength.texels;
  if (from.width == width && from.height == height) return strength;
  Map out = resized(strength, width, height);
  for (int y = 0; y < height; ++y) {
    const Overlap rows = overlap_of(y, from.height, height);
    for (int x = 0; x < width; ++x) {
      const Overlap columns = overlap_of(x, from.width, width);
      bool any = false;
      for (int v = rows.first; v <= rows.last && !any; ++v)
        for (int u = columns.first; u <= columns.last && !any; ++u) any = *from.at(u, v) > 0.0f;
      if (!any) *out.texels.at(x, y) = 0.0f;
    }
  }
  return out;
}

Image strength_of_texels(std::span<const Primitive* const> primitives, const Map& strength, const Map& like,
                         int width, int height, int material) {
  if (strength.texels.num_pixels() == 1) return Image(width, height, 1, strength.texels.pixels[0]);
  if (same_placement(strength, like)) return resized_strength(strength, width, height).texels;
  const Map blank = blank_map(like, width, height);
  Image out(width, height, 1, 1.0f);
  enum class Certainty : uint8_t { kNone, kBeside, kInside };
  std::vector<Certainty> known(out.num_pixels(), Certainty::kNone);
  const auto set = static_cast<size_t>(strength.uv_set);
  each_touched_texel(primitives, blank, material, [&](const TouchedTexel& touched) {
    const auto& uv = touched.primitive->uv;
    if (set >= uv.size() || uv[set].empty()) return;
    float& least = out.pixels[touched.texel];
    // A place that has the texel's centre counts before places half a texel beside it.
    const Certainty now = touched.inside ? Certainty::kInside : Certainty::kBeside;
    if (now < known[touched.texel]) return;
    if (now > known[touched.texel]) least = 1.0f;
    known[touched.texel] = now;
    least = std::min(least, strength_at(strength, map_uv(strength, touched.interpolated(uv[set]))));
  });
  return out;
}

}  // namespace patina::asset
