#include "patina/views/strength_views.h"

#include <algorithm>
#include <cmath>

#include "patina/asset/strength_map.h"
#include "patina/base/check.h"
#include "patina/base/parallel.h"
#include "patina/render/triangle.h"

namespace patina::views {
namespace {

constexpr int kRaysPerSide = 2;

// A map and its halves: level n has a texel for 2ⁿ of the first, a side.
using Levels = std::vector<asset::Map>;

Levels levels_of(const asset::Map& map) {
  Levels levels{map};
  while (levels.back().texels.num_pixels() > 1) {
    const Image& texels = levels.back().texels;
    levels.push_back(asset::resized_strength(levels.back(), std::max(1, texels.width / 2),
                                             std::max(1, texels.height / 2)));
  }
  return levels;
}

// Texels of `map`, a side, that a square of `side` pixels shows at a hit.
float texels_across(const render::Camera& camera, const render::Ray& ray, const render::Hit& hit,
                    const asset::Primitive& primitive, const asset::Map& map, float side) {
  const render::Triangle triangle = render::triangle_of(primitive, hit.triangle);
  const float area = triangle.area(), uv_area = render::uv_area(primitive, hit.triangle, map);
  if (!(area > 0.0f && uv_area > 0.0f)) return 1.0f;
  const float cosine = std::max(0.5f * std::abs(glm::dot(triangle.cross(), ray.direction)) / area, 0.05f);
  const float width = side * hit.t / camera.focal_pixels();
  return std::sqrt(static_cast<float>(map.texels.num_pixels()) * uv_area / area * width * width / cosine);
}

// Strength that one ray meets; below 0 where it meets nothing of the asset.
float strength_along(const render::Scene& scene, const render::Camera& camera, const render::Ray& ray,
                     std::span<const Levels> strengths) {
  const auto hit = scene.intersect(ray);
  if (!hit || static_cast<int>(hit->primitive) >= scene.num_asset_primitives()) return -1.0f;
  const asset::Primitive& primitive = *scene.primitives()[hit->primitive];
  const Levels& levels = strengths[static_cast<size_t>(primitive.material)];
  const asset::Map& finest = levels.front();
  const auto set = static_cast<size_t>(finest.uv_set);
  if (finest.texels.num_pixels() == 1) return finest.texels.pixels[0];
  if (set >= primitive.uv.size() || primitive.uv[set].empty()) return 0.0f;  // carries no texture
  const float across = texels_across(camera, ray, *hit, primitive, finest, 1.0f / kRaysPerSide);
  const auto level = static_cast<size_t>(std::max(0.0f, std::floor(std::log2(across))));
  const asset::Map& map = levels[std::min(level, levels.size() - 1)];
  const uvec3& corner = primitive.triangles[hit->triangle];
  const auto& uv = primitive.uv[set];
  const vec2& w = hit->barycentric;
  return asset::strength_at(
      map, asset::map_uv(map, (1.0f - w.x - w.y) * uv[corner.x] + w.x * uv[corner.y] + w.y * uv[corner.z]));
}

// Pixels that no ray met but that lie beside the asset may still show a sliver of it: they follow their
// neighbours.
void fill_rim(Image& view) {
  const Image met = view;
  for (int y = 0; y < view.height; ++y)
    for (int x = 0; x < view.width; ++x) {
      if (*met.at(x, y) >= 0.0f) continue;
      for (int v = std::max(y - 1, 0); v <= std::min(y + 1, view.height - 1); ++v)
        for (int u = std::max(x - 1, 0); u <= std::min(x + 1, view.width - 1); ++u)
          *view.at(x, y) = std::max(*view.at(x, y), *met.at(u, v));
    }
}

Image strength_view(const render::Scene& scene, const render::Camera& camera,
                    std::span<const Levels> strengths) {
  Image view(camera.width, camera.height, 1, -1.0f);
  parallel_for(0, camera.height, 4, [&](int64_t begin, int64_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
      for (int x = 0; x < camera.width; ++x) {
        float sum = 0.0f, count = 0.0f;
        for (int k = 0; k < kRaysPerSide * kRaysPerSide; ++k) {
          const vec2 offset(static_cast<float>(k % kRaysPerSide) + 0.5f,
                            static_cast<float>(k / kRaysPerSide) + 0.5f);
          const render::Ray ray =
              camera.ray(vec2(static_cast<float>(x), static_cast<float>(y)) + offset / vec2(kRaysPerSide));
          const float met = strength_along(scene, camera, ray, strengths);
          if (met < 0.0f) continue;
          sum += met, count += 1.0f;
        }
        if (count > 0.0f) *view.at(x, y) = std::min(sum / count, 1.0f);
      }
  });
  fill_rim(view);
  return view;
}

}  // namespace

std::vector<Image> strength_views(const render::Scene& scene, std::span<const render::Camera> cameras,
                                  std::span<const asset::Map> strengths) {
  PATINA_CHECK_EQ(static_cast<int>(strengths.size()), scene.num_asset_materials());
  std::vector<Levels> levels;
  for (const asset::Map& map : strengths) levels.push_back(levels_of(map));
  std::vector<Image> views;
  for (const render::Camera& camera : cameras) views.push_back(strength_view(scene, camera, levels));
  return views;
}

}  // namespace patina::views
