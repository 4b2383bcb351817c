#include "patina/inverse/evidence.h"

#include <algorithm>
#include <cmath>

#include "patina/base/parallel.h"

namespace patina::inverse {
namespace {

// `map`'s layout with width × height texels: only size and wrap modes matter to a look-up.
asset::Map layout(const asset::Map& map, int width, int height) {
  asset::Map out;
  out.uv_set = map.uv_set;
  out.uv_transform = map.uv_transform;
  out.wrap_s = map.wrap_s;
  out.wrap_t = map.wrap_t;
  out.texels = Image(width, height, 1);
  return out;
}

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
  asset::Map evidence = layout(map, width, height);
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
  const asset::Map target = layout(map, width, height);
  SurfaceTexels surface{Image(width, height, 1), {}};
  surface.p_world.assign(surface.covered.num_pixels(), vec3(0.0f));
  const auto set = static_cast<size_t>(map.uv_set);
  const vec2 size(static_cast<float>(width), static_cast<float>(height));
  for (int p = 0; p < scene.num_asset_primitives(); ++p) {
    const asset::Primitive& primitive = *scene.primitives()[static_cast<size_t>(p)];
    if (primitive.material != material || set >= primitive.uv.size() || primitive.uv[set].empty()) continue;
    for (const uvec3& triangle : primitive.triangles) {
      // Texel coordinates with centres at whole numbers; a texel counts if its centre is within half a texel
      // of the triangle.
      const vec2 a = asset::map_uv(map, primitive.uv[set][triangle.x]) * size - 0.5f;
      const vec2 b = asset::map_uv(map, primitive.uv[set][triangle.y]) * size - 0.5f;
      const vec2 c = asset::map_uv(map, primitive.uv[set][triangle.z]) * size - 0.5f;
      const vec3 &p_a = primitive.p_world[triangle.x], &p_b = primitive.p_world[triangle.y],
                 &p_c = primitive.p_world[triangle.z];
      const vec2 low = glm::floor(glm::min(a, glm::min(b, c)) - 0.5f),
                 high = glm::ceil(glm::max(a, glm::max(b, c)) + 0.5f);
      // A triangle that spans the whole texture several times over covers every texel.
      if (!(high.x - low.x < 4.0f * size.x && high.y - low.y < 4.0f * size.y)) {
        for (size_t i = 0; i < surface.p_world.size(); ++i)
          if (surface.covered.pixels[i] <= 0.0f) surface.p_world[i] = (p_a + p_b + p_c) / 3.0f;
        std::fill(surface.covered.pixels.begin(), surface.covered.pixels.end(), 1.0f);
        return surface;
      }
      const float area = cross2(b - a, c - a);
      const float sign = area < 0.0f ? -1.0f : 1.0f;
      // Twice the signed area between an edge and a texel's centre; the edge may be missed by half a texel.
      const auto beside = [&](const vec2& from, const vec2& to, const vec2& q) {
        return sign * cross2(to - from, q - from);
      };
      const auto reach = [](const vec2& from, const vec2& to) {
        return 0.5f * (std::abs(to.x - from.x) + std::abs(to.y - from.y));
      };
      for (float y = low.y; y <= high.y; y += 1.0f)
        for (float x = low.x; x <= high.x; x += 1.0f) {
          const vec2 q(x, y);
          vec3 share(beside(b, c, q), beside(c, a, q), beside(a, b, q));
          if (share.x < -reach(b, c) || share.y < -reach(c, a) || share.z < -reach(a, b)) continue;
          const asset::BilinearTap tap = asset::bilinear_tap(target, (q + 0.5f) / size);
          const auto nearest = static_cast<size_t>(std::max_element(tap.weight.begin(), tap.weight.end()) -
                                                   tap.weight.begin());
          const auto texel = static_cast<size_t>(tap.texel[nearest]);
          surface.covered.pixels[texel] = 1.0f;
          share = glm::max(share, 0.0f);
          const float total = share.x + share.y + share.z;
          surface.p_world[texel] =
              total > 0.0f ? (share.x * p_a + share.y * p_b + share.z * p_c) / total : p_a;
        }
    }
  }
  return surface;
}

}  // namespace patina::inverse
