// View-correlated noise as published [Hadadan2025, Sec. 4.2]: each latent pixel is split into 4 × 4 subpixels
// whose corners are cast to UV, and the value is the area-weighted mean of the field at their centres,
// divided by the estimated deviation. docs/noise.md goes through it sentence by sentence.
#include <algorithm>
#include <optional>

#include "patina/base/parallel.h"
#include "patina/correspond/noise_projection.h"

namespace patina::correspond {
namespace {

// UV of what a ray through a subpixel corner meets. A quad is used only if all its corners lie on one
// primitive.
struct Corner {
  int primitive = -1;
  vec2 uv{0.0f};
};

Corner cast_corner(const render::Scene& scene, const render::Ray& ray) {
  const auto front = views::front_hit(scene, ray);
  if (!front) return {};
  const asset::Primitive& mesh = *scene.primitives()[front->hit.primitive];
  if (mesh.uv.empty() || mesh.uv[0].empty()) return {};
  const uvec3 corner = mesh.triangles[front->hit.triangle];
  const vec2 b = front->hit.barycentric;
  const vec2 a = mesh.uv[0][corner.x];
  const vec2 uv = a + b.x * (mesh.uv[0][corner.y] - a) + b.y * (mesh.uv[0][corner.z] - a);
  if (!std::isfinite(uv.x) || !std::isfinite(uv.y)) return {};
  return {static_cast<int>(front->hit.primitive), uv};
}

// Texel of the field at uv, which repeats like a texture; materials do not share a field.
uint64_t texel_at(const vec2& uv, int field_size, int material) {
  const auto wrapped = [&](float x) {
    const double at = (static_cast<double>(x) - std::floor(static_cast<double>(x))) * field_size;
    return static_cast<uint64_t>(std::min(static_cast<int>(at), field_size - 1));
  };
  const auto size = static_cast<uint64_t>(field_size);
  return (static_cast<uint64_t>(material) * size + wrapped(uv.y)) * size + wrapped(uv.x);
}

float area(const vec2& a, const vec2& b, const vec2& c) {
  return 0.5f * std::abs((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x));
}

// How much of a pixel's value comes from the field: none up to one texel of area, all from four on. The paper
// names no numbers.
float field_share(float texels) {
  const float t = glm::clamp((texels - 1.0f) / 3.0f, 0.0f, 1.0f);
  return t * t * (3.0f - 2.0f * t);
}

}  // namespace

NoiseProjection project_paper(const render::Scene& scene, const render::Camera& camera, int latent_scale,
                              int field_size, int subpixels) {
  const int width = camera.width / latent_scale, height = camera.height / latent_scale;
  const int stride = subpixels * width + 1;
  const auto step = static_cast<float>(latent_scale) / static_cast<float>(subpixels);
  std::vector<Corner> corners(static_cast<size_t>(stride) * static_cast<size_t>(subpixels * height + 1));
  parallel_for(0, subpixels * height + 1, 4, [&](int64_t begin, int64_t end) {
    for (int64_t y = begin; y < end; ++y)
      for (int x = 0; x < stride; ++x)
        corners[static_cast<size_t>(y) * static_cast<size_t>(stride) + static_cast<size_t>(x)] =
            cast_corner(scene, camera.ray(step * vec2(static_cast<float>(x), static_cast<float>(y))));
  });

  NoiseProjection out{.width = width, .height = height, .field = kUvFieldId};
  const auto num_pixels = static_cast<size_t>(width) * static_cast<size_t>(height);
  out.first.assign(1, 0);
  out.scale.assign(num_pixels, 0.0f);
  out.share.assign(num_pixels, 0.0f);
  const float texel_area = 1.0f / square(static_cast<float>(field_size));
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      float sum_area = 0, sum_variance = 0;
      for (int sub = 0; sub < subpixels * subpixels; ++sub) {
        const int u = subpixels * x + sub % subpixels, v = subpixels * y + sub / subpixels;
        const Corner* row =
            &corners[static_cast<size_t>(v) * static_cast<size_t>(stride) + static_cast<size_t>(u)];
        const Corner &c00 = row[0], &c10 = row[1], &c01 = row[stride], &c11 = row[stride + 1];
        if (c00.primitive < 0 || c10.primitive != c00.primitive || c01.primitive != c00.primitive ||
            c11.primitive != c00.primitive)
          continue;
        const float sub_area = area(c00.uv, c10.uv, c11.uv) + area(c00.uv, c11.uv, c01.uv);
        if (!(sub_area > 0.0f)) continue;
        const vec2 center = 0.25f * (c00.uv + c10.uv + c01.uv + c11.uv);
        const int material = scene.primitives()[static_cast<size_t>(c00.primitive)]->material;
        out.index.push_back(texel_at(center, field_size, material));
        out.weight.push_back(sub_area);
        const float covariance = std::max(texel_area / sub_area - 1.0f, 0.0f);
        sum_area += sub_area;
        sum_variance += square(sub_area) * (1.0f + covariance);
      }
      const size_t pixel = out.first.size() - 1;
      out.first.push_back(static_cast<int64_t>(out.index.size()));
      if (!(sum_variance > 0.0f)) continue;
      out.scale[pixel] = 1.0f / std::sqrt(sum_variance);
      out.share[pixel] = field_share(sum_area / texel_area);
    }
  }
  return out;
}

}  // namespace patina::correspond
