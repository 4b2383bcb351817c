// Noise-free buffers of what each pixel shows: one ray through its centre, and sixteen more where an edge may
// cross it.
#include <array>

#include "patina/base/parallel.h"
#include "patina/views/view_set.h"

namespace patina::views {
namespace {

// What a ray meets, as far as coverage cares.
bool meets_enhanced(const render::Scene& scene, const render::Ray& ray) {
  const auto hit = scene.intersect(ray);
  return hit && static_cast<int>(hit->primitive) < scene.num_asset_primitives();
}

GBuffer empty_gbuffer(int width, int height) {
  const size_t count = static_cast<size_t>(width) * static_cast<size_t>(height);
  GBuffer out;
  out.width = width;
  out.height = height;
  out.primitive.assign(count, -1);
  out.triangle.assign(count, -1);
  out.material.assign(count, -1);
  out.uv.assign(count, vec2(0.0f));
  out.p_world.assign(count, vec3(0.0f));
  out.n_shading_world.assign(count, vec3(0.0f));
  out.n_geometric_world.assign(count, vec3(0.0f));
  out.view_cosine.assign(count, 0.0f);
  out.depth.assign(count, std::numeric_limits<float>::infinity());
  out.coverage.assign(count, 0.0f);
  out.reflectance.assign(count, 0.0f);
  return out;
}

// The base colour, and a dielectric's gloss, between rough and smooth: so a black object does not seem to
// stand in the dark.
float reflectance_of(const render::BsdfParams& bsdf) {
  constexpr float kGloss = 0.025f;
  const float base = luminance(bsdf.base_color);
  return std::max(bsdf.metallic * base + (1.0f - bsdf.metallic) * ((1.0f - kGloss) * base + kGloss), kGloss);
}

void trace_centers(const render::Scene& scene, const render::Camera& camera, GBuffer& out) {
  const vec3 eye = camera.position();
  const vec3 forward = -vec3(camera.world_from_camera[2]);
  parallel_for(0, camera.height, 4, [&](int64_t begin, int64_t end) {
    for (int64_t y = begin; y < end; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const render::Ray ray = camera.ray(vec2(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f));
        const auto hit = scene.intersect(ray);
        if (!hit) continue;
        const render::SurfacePoint point = scene.surface(ray, *hit);
        const auto i = static_cast<size_t>(y) * static_cast<size_t>(camera.width) + static_cast<size_t>(x);
        out.primitive[i] = static_cast<int32_t>(hit->primitive);
        out.triangle[i] = static_cast<int32_t>(hit->triangle);
        out.material[i] = point.material;
        if (point.num_uv_sets > 0) out.uv[i] = point.uv[0];
        out.p_world[i] = point.p_world;
        out.n_shading_world[i] = point.n_shading;
        out.n_geometric_world[i] = point.n_geometric;
        out.view_cosine[i] = glm::clamp(-glm::dot(point.n_geometric, ray.direction), 0.0f, 1.0f);
        out.depth[i] = glm::dot(point.p_world - eye, forward);
        out.reflectance[i] = reflectance_of(point.bsdf);
      }
    }
  });
}

// Coverage needs no sixteen rays where nothing changes: a pixel whose centre, corners and eight neighbours'
// centres all meet enhanced surface is full, one where none does is empty. Only what is thinner than half a
// pixel and meets none of the thirteen rays can be missed.
void trace_coverage(const render::Scene& scene, const render::Camera& camera, GBuffer& out) {
  const int width = camera.width, height = camera.height;
  const auto center_is_enhanced = [&](int x, int y) {
    const auto i = static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x);
    return out.primitive[i] >= 0 && out.primitive[i] < scene.num_asset_primitives();
  };
  const size_t corner_stride = static_cast<size_t>(width) + 1;
  std::vector<uint8_t> corner(corner_stride * (static_cast<size_t>(height) + 1));
  parallel_for(0, height + 1, 4, [&](int64_t begin, int64_t end) {
    for (int64_t y = begin; y < end; ++y)
      for (int x = 0; x <= width; ++x)
        corner[static_cast<size_t>(y) * corner_stride + static_cast<size_t>(x)] =
            meets_enhanced(scene, camera.ray(vec2(static_cast<float>(x), static_cast<float>(y))));
  });
  parallel_for(0, height, 4, [&](int64_t begin, int64_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < width; ++x) {
        int met = 0, asked = 0;
        for (int v = std::max(y - 1, 0); v <= std::min(y + 1, height - 1); ++v)
          for (int u = std::max(x - 1, 0); u <= std::min(x + 1, width - 1); ++u) {
            met += center_is_enhanced(u, v);
            ++asked;
          }
        for (int v = y; v <= y + 1; ++v)
          for (int u = x; u <= x + 1; ++u) {
            met += corner[static_cast<size_t>(v) * corner_stride + static_cast<size_t>(u)];
            ++asked;
          }
        const auto i = static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x);
        if (met == asked) {
          out.coverage[i] = 1.0f;
        } else if (met > 0) {
          int covered = 0;
          for (int sample = 0; sample < 16; ++sample) {
            const vec2 offset((static_cast<float>(sample % 4) + 0.5f) / 4.0f,
                              (static_cast<float>(sample / 4) + 0.5f) / 4.0f);
            covered += meets_enhanced(
                scene, camera.ray(vec2(static_cast<float>(x), static_cast<float>(y)) + offset));
          }
          out.coverage[i] = static_cast<float>(covered) / 16.0f;
        }
      }
    }
  });
}

}  // namespace

GBuffer make_gbuffer(const render::Scene& scene, const render::Camera& camera) {
  GBuffer out = empty_gbuffer(camera.width, camera.height);
  trace_centers(scene, camera, out);
  trace_coverage(scene, camera, out);
  return out;
}

}  // namespace patina::views
