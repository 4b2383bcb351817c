#include "patina/inverse/evidence.h"

#include <algorithm>
#include <cmath>

#include "patina/asset/texel_raster.h"
#include "patina/render/triangle.h"
#include "patina/views/strength_views.h"

namespace patina::inverse {

float texels_per_pixel(const render::Scene& scene, const views::ViewSet& views,
                       std::span<const CachePixel> pixels, const asset::Map& map, int material) {
  std::vector<float> across;
  const auto set = static_cast<size_t>(map.uv_set);
  const auto texels = static_cast<float>(map.texels.num_pixels());
  for (const CachePixel& pixel : pixels) {
    const views::View& view = views.views[pixel.view];
    const views::GBuffer& g = view.gbuffer;
    const size_t i = static_cast<size_t>(pixel.y) * static_cast<size_t>(g.width) + pixel.x;
    if (g.material[i] != material) continue;
    const asset::Primitive& primitive = *scene.primitives()[static_cast<size_t>(g.primitive[i])];
    if (set >= primitive.uv.size() || primitive.uv[set].empty()) continue;
    const auto triangle = static_cast<uint32_t>(g.triangle[i]);
    const float world_area = render::triangle_of(primitive, triangle).area();
    const float uv_area = render::uv_area(primitive, triangle, map);
    if (!(world_area > 0.0f && uv_area > 0.0f)) continue;
    const float pixel_area =
        square(g.depth[i] / view.camera.focal_pixels()) / std::max(g.view_cosine[i], 0.05f);
    across.push_back(std::sqrt(texels * uv_area / world_area * pixel_area));
  }
  if (across.empty()) return 0.0f;
  const auto quarter = across.begin() + static_cast<std::ptrdiff_t>(across.size() / 4);
  std::nth_element(across.begin(), quarter, across.end());
  return *quarter;
}

Image evidence_of(const asset::Map& map, int width, int height, asset::MapSlot slot, int material,
                  std::span<const SeenPoint> points) {
  asset::Map evidence = asset::blank_map(map, width, height);
  for (const SeenPoint& seen : points) {
    if (seen.point.material != material) continue;
    const asset::BilinearTap tap = asset::bilinear_tap(evidence, seen.point.uv[index_of(slot)]);
    for (size_t t = 0; t < 4; ++t)
      evidence.texels.pixels[static_cast<size_t>(tap.texel[t])] += seen.weight * tap.weight[t];
  }
  return std::move(evidence.texels);
}

SurfaceTexels surface_texels(const render::Scene& scene, const asset::Map& map, int width, int height,
                             int material) {
  SurfaceTexels surface{Image(width, height, 1), {}};
  surface.p_world.assign(surface.covered.num_pixels(), vec3(0.0f));
  asset::each_touched_texel(views::asset_primitives(scene), asset::blank_map(map, width, height), material,
                            [&](const asset::TouchedTexel& touched) {
                              surface.covered.pixels[touched.texel] = 1.0f;
                              surface.p_world[touched.texel] =
                                  touched.interpolated(touched.primitive->p_world);
                            });
  return surface;
}

}  // namespace patina::inverse
