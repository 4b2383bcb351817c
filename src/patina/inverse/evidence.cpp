#include "patina/inverse/evidence.h"

#include <algorithm>
#include <cmath>

#include "patina/asset/texel_raster.h"
#include "patina/base/parallel.h"
#include "patina/views/strength_views.h"

namespace patina::inverse {
namespace {

float cross2(const vec2& a, const vec2& b) {
  return a.x * b.y - a.y * b.x;
}

}  // namespace

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
    const uvec3 t = primitive.triangles[static_cast<size_t>(g.triangle[i])];
    const auto& p = primitive.p_world;
    const auto uv = [&](uint32_t vertex) { return asset::map_uv(map, primitive.uv[set][vertex]); };
    const float world_area = glm::length(glm::cross(p[t.y] - p[t.x], p[t.z] - p[t.x]));
    const float uv_area = std::abs(cross2(uv(t.y) - uv(t.x), uv(t.z) - uv(t.x)));
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

std::vector<SeenPoint> trace_seen_points(const render::Scene& scene, const views::ViewSet& views,
                                         std::span<const CachePixel> pixels) {
  constexpr int kSide = 2;
  constexpr size_t kPoints = kSide * kSide;
  std::vector<SeenPoint> points(pixels.size() * kPoints);
  parallel_for(0, static_cast<int64_t>(pixels.size()), 256, [&](int64_t begin, int64_t end) {
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i)
      for (size_t k = 0; k < kPoints; ++k) {
        const CachePixel& pixel = pixels[i];
        const vec2 position(static_cast<float>(pixel.x) + (static_cast<float>(k % kSide) + 0.5f) / kSide,
                            static_cast<float>(pixel.y) + (static_cast<float>(k / kSide) + 0.5f) / kSide);
        const render::Ray ray = views.views[pixel.view].camera.ray(position);
        const auto hit = scene.intersect(ray);
        SeenPoint& seen = points[i * kPoints + k];
        seen.weight = 0.0f;
        if (!hit) continue;
        const render::SurfacePoint surface = scene.surface(ray, *hit);
        seen.point =
            material_point(surface, -ray.direction, scene.materials()[static_cast<size_t>(surface.material)]);
        seen.weight = pixel.weight / kPoints;
      }
  });
  std::erase_if(points, [](const SeenPoint& seen) { return seen.weight <= 0.0f; });
  return points;
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
