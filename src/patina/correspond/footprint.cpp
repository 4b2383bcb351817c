#include "patina/correspond/footprint.h"

#include <algorithm>

#include "patina/base/parallel.h"
#include "patina/views/view_set.h"

namespace patina::correspond {

float area_per_pixel(const render::Camera& camera, const render::Ray& ray, const views::FrontHit& front) {
  // A pixel at angle φ off the axis spans cos³φ / f² steradians, f in pixels.
  const float cos_axis = -glm::dot(ray.direction, vec3(camera.world_from_camera[2]));
  const float solid_angle = cos_axis * cos_axis * cos_axis / square(camera.focal_pixels());
  return square(front.hit.t) * solid_angle / std::max(front.cosine, 0.001f);
}

std::optional<vec2> seen_from(const render::Scene& scene, const render::Camera& camera, uint32_t primitive,
                              const vec3& p_world, vec3 n_world) {
  const auto material = static_cast<size_t>(scene.primitives()[primitive]->material);
  if (scene.materials()[material].double_sided && glm::dot(n_world, camera.position() - p_world) < 0.0f)
    n_world = -n_world;
  return views::seen_at(scene, camera, p_world, n_world);
}

Footprints trace_footprints(const render::Scene& scene, const render::Camera& camera, int latent_scale) {
  constexpr int kSide = 4;
  Footprints out;
  out.width = camera.width / latent_scale;
  out.height = camera.height / latent_scale;
  const auto count = static_cast<size_t>(out.width) * static_cast<size_t>(out.height);
  out.coverage.assign(count, 0.0f);
  out.area.assign(count, 0.0f);
  const auto step = static_cast<float>(latent_scale) / static_cast<float>(kSide);
  parallel_for(0, out.height, 1, [&](int64_t begin, int64_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < out.width; ++x) {
        const auto i = static_cast<size_t>(y) * static_cast<size_t>(out.width) + static_cast<size_t>(x);
        for (int v = 0; v < kSide; ++v) {
          for (int u = 0; u < kSide; ++u) {
            const vec2 sub(static_cast<float>(x * kSide + u) + 0.5f,
                           static_cast<float>(y * kSide + v) + 0.5f);
            const render::Ray ray = camera.ray(step * sub);
            const auto front = views::front_hit(scene, ray);
            if (!front) continue;
            out.coverage[i] += 1.0f / static_cast<float>(kSide * kSide);
            out.area[i] += square(step) * area_per_pixel(camera, ray, *front);
          }
        }
      }
    }
  });
  return out;
}

std::vector<uint8_t> surface_mask(const render::Scene& scene, std::span<const render::Camera> cameras,
                                  int latent_scale) {
  const auto grid = static_cast<size_t>(views::grid_of(cameras.size()));
  std::vector<uint8_t> mask;
  for (size_t view = 0; view < cameras.size(); ++view) {
    const Footprints footprints = trace_footprints(scene, cameras[view], latent_scale);
    const auto width = static_cast<size_t>(footprints.width), height = static_cast<size_t>(footprints.height);
    mask.resize(grid * grid * width * height);
    const size_t first = view / grid * height * grid * width + view % grid * width;
    for (size_t y = 0; y < height; ++y)
      for (size_t x = 0; x < width; ++x)
        mask[first + y * grid * width + x] = footprints.coverage[y * width + x] > 0.0f;
  }
  return mask;
}

}  // namespace patina::correspond
