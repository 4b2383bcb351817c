#include "strip.h"

#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "patina/asset/material_maps.h"
#include "patina/image/color.h"
#include "patina/image/image_io.h"
#include "patina/report/report.h"

namespace patina::make_gallery {
namespace {

namespace fs = std::filesystem;

/// Share of numbers that differ visibly between two maps, the smaller enlarged.
double change(const asset::Map& before, const asset::Map& after) {
  constexpr float kVisible = 0.01f;
  const Image a = asset::resized(before, after.texels.width, after.texels.height).texels;
  double count = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i)
    if (std::abs(a.pixels[i] - after.texels.pixels[i]) > kVisible) ++count;
  return count / static_cast<double>(a.pixels.size());
}

/// Surface of a material, metres².
double area(const asset::Asset& asset, size_t material) {
  double sum = 0;
  for (const asset::Primitive& primitive : asset.primitives) {
    if (primitive.material != static_cast<int>(material)) continue;
    for (const uvec3& t : primitive.triangles) {
      const vec3 &a = primitive.p_world[t.x], &b = primitive.p_world[t.y], &c = primitive.p_world[t.z];
      sum += 0.5 * static_cast<double>(glm::length(glm::cross(b - a, c - a)));
    }
  }
  return sum;
}

Image shown(const asset::Map& map, int side) {
  return srgb_from_linear(asset::resized(map, side, side).texels);
}

}  // namespace

Image strip(const fs::path& run, const asset::Asset& before, const asset::Asset& after, int view,
            int other_view, int side) {
  const auto picture = [&](const char* pattern, int which) {
    return read_image(run / fmt::format(fmt::runtime(pattern), which));
  };
  std::vector<Image> pictures{picture("views/tile_{:02}.png", view), picture("detail/edited_{:02}.png", view),
                              picture("report/rendered_{:02}.png", view),
                              picture("report/rendered_{:02}.png", other_view)};
  const auto old_maps = asset::resolve_materials(before), new_maps = asset::resolve_materials(after);
  size_t most = 0;
  double largest = -1;
  for (size_t m = 0; m < new_maps.size(); ++m) {
    const double changed = area(before, m) * change(old_maps[m].base_color, new_maps[m].base_color);
    if (changed > largest) most = m, largest = changed;
  }
  pictures.push_back(shown(old_maps[most].base_color, side));
  pictures.push_back(shown(new_maps[most].base_color, side));
  return report::contact_sheet(pictures, static_cast<int>(pictures.size()), side);
}

}  // namespace patina::make_gallery
