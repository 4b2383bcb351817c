#include "mini_data/shading.h"

#include <ATen/ATen.h>

#include <vector>

#include "mini_data/dataset.h"

namespace patina::mini_data {

using at::Tensor;

namespace {

constexpr int kTableSide = 32;
constexpr double kDielectric = 0.04;  // reflectance at normal incidence of an index of refraction of 1.5

Tensor dot3(const Tensor& a, const Tensor& b) {
  return (a * b).sum({1}, true);
}
Tensor unit(const Tensor& v) {
  return v / v.norm(2, {1}, true).clamp_min(1e-6);
}

// Blurred environment [B,9,H,W] along directions [B,3,H,W].
Tensor environment_at(const Fields& fields, const Tensor& direction) {
  const Tensor x = direction.select(1, 0), y = direction.select(1, 1), z = direction.select(1, 2);
  constexpr double kPiD = 3.14159265358979;
  // The map's columns carry one texel more on each side.
  const Tensor u = at::atan2(z, x) * (kGlossMapWidth / kPiD / (kGlossMapWidth + 2));
  const Tensor v = y.clamp(-1, 1).acos() * (2 / kPiD) - 1;
  return at::grid_sampler(fields.gloss_map, at::stack({u, v}, 3), 0, 1, false);
}

// Three colours of one kept roughness, or between two of them. `levels`: three kept ones and the diffuse
// light.
Tensor at_roughness(const Tensor& roughness, const std::vector<Tensor>& levels) {
  const double at[4] = {kGlossRoughness[0], kGlossRoughness[1], kGlossRoughness[2], 1.0};
  Tensor out = levels[0];
  for (int i = 0; i < 3; ++i) {
    const Tensor t = ((roughness - at[i]) / (at[i + 1] - at[i])).clamp(0, 1);
    out = out + t * (levels[static_cast<size_t>(i + 1)] - levels[static_cast<size_t>(i)]);
  }
  return out;
}

}  // namespace

Tensor bumped_normal(const Fields& fields, const SurfaceValues& surface) {
  const Tensor n = unit(fields.normal + surface.bump);
  // A normal that looks away from the eye is brought back to the horizon and a little over it.
  const Tensor below = (0.05 - dot3(n, fields.to_eye)).clamp_min(0);
  return unit(n + below * fields.to_eye);
}

Tensor shaded(const Library& library, const Fields& fields, const SurfaceValues& surface, int64_t num_plans) {
  const Tensor n = bumped_normal(fields, surface);
  const Tensor cosine = dot3(n, fields.to_eye).clamp(1e-3, 1);

  // Diffuse light follows the bumped normal by its mean direction: exact where the same light stays above the
  // horizon.
  const Tensor flat = dot3(fields.normal, fields.toward_light).clamp_min(0.2);
  const Tensor turned = (dot3(n, fields.toward_light).clamp_min(0) / flat).clamp(0.05, 2.0);
  // What the object sends to itself depends on its colour: once, and once more.
  const int64_t b = surface.albedo.size(0);
  const Tensor weight = fields.coverage.view({num_plans, -1}).sum(1).clamp_min(1).view({-1, 1, 1, 1, 1});
  Tensor mean =
      (surface.albedo * fields.coverage).view({num_plans, b / num_plans, 3, -1, 1}).sum({1, 3}, true) /
      weight;
  mean = mean.expand({num_plans, b / num_plans, 3, 1, 1}).reshape({b, 3, 1, 1});
  const Tensor returned = fields.bounce * mean;
  const Tensor light = fields.light * (turned + returned * (1 + 0.5 * returned));

  // Reflections of the baked lobes, carried to the bumped direction by the environment's own change.
  const auto mirrored = [&](const Tensor& normal) {
    return 2 * dot3(normal, fields.to_eye) * normal - fields.to_eye;
  };
  constexpr double kFloor = 0.05;
  const Tensor change = ((environment_at(fields, mirrored(n)) + kFloor) /
                         (environment_at(fields, mirrored(fields.normal)) + kFloor))
                            .clamp(0.2, 5.0);
  const Tensor gloss = fields.gloss * change;
  const Tensor reflected = at_roughness(
      surface.roughness, {gloss.slice(1, 0, 3), gloss.slice(1, 3, 6), gloss.slice(1, 6, 9), light});

  const int64_t h = cosine.size(2), w = cosine.size(3);
  const Tensor where =
      at::stack({2 * cosine.squeeze(1) - 1, 2 * surface.roughness.squeeze(1) - 1}, 3).view({1, b * h, w, 2});
  const Tensor table =
      at::grid_sampler(library.albedo, where, 0, 1, false).view({3, b, h, w}).transpose(0, 1);
  const Tensor scale = table.slice(1, 0, 1), offset = table.slice(1, 1, 2), through = table.slice(1, 2, 3);
  const Tensor dielectric = surface.albedo * through * light + (kDielectric * scale + offset) * reflected;
  const Tensor metal = (surface.albedo * scale + offset) * reflected;
  return dielectric + surface.metallic * (metal - dielectric);
}

// Midpoint sums over visible normals for the first two, over the cosine-weighted hemisphere for the third.
Tensor specular_albedo_table() {
  constexpr int kSamples = 24;
  std::vector<float> values(3 * kTableSide * kTableSide);
  for (int row = 0; row < kTableSide; ++row)
    for (int column = 0; column < kTableSide; ++column) {
      const float cosine = (static_cast<float>(column) + 0.5f) / kTableSide;
      const float roughness = (static_cast<float>(row) + 0.5f) / kTableSide;
      const float alpha = std::max(roughness * roughness, 1e-3f);
      const vec3 wo(std::sqrt(1 - cosine * cosine), 0, cosine);
      double scale = 0, offset = 0, through = 0;
      for (int i = 0; i < kSamples * kSamples; ++i) {
        const vec2 u((static_cast<float>(i % kSamples) + 0.5f) / kSamples,
                     (static_cast<float>(i / kSamples) + 0.5f) / kSamples);
        // A visible normal: stretch, sample the projected half disc, shrink [Heitz2018, Sec. 3].
        const vec3 v = glm::normalize(vec3(alpha * wo.x, 0, wo.z));
        const vec3 t1 = vec3(0, 1, 0), t2 = glm::cross(v, t1);
        const float r = std::sqrt(u.x), phi = 2 * kPi * u.y, s = 0.5f * (1 + v.z);
        const float p1 = r * std::cos(phi),
                    p2 = (1 - s) * std::sqrt(std::max(0.0f, 1 - p1 * p1)) + s * r * std::sin(phi);
        const vec3 stretched = p1 * t1 + p2 * t2 + std::sqrt(std::max(0.0f, 1 - p1 * p1 - p2 * p2)) * v;
        const vec3 h =
            glm::normalize(vec3(alpha * stretched.x, alpha * stretched.y, std::max(stretched.z, 1e-6f)));
        const vec3 wi = 2 * glm::dot(wo, h) * h - wo;
        if (wi.z > 0) {
          const float g1 = 2 * wi.z / (wi.z + std::sqrt(alpha * alpha + (1 - alpha * alpha) * wi.z * wi.z));
          const float fresnel = std::pow(1 - std::min(glm::dot(wo, h), 1.0f), 5.0f);
          scale += g1 * (1 - fresnel);
          offset += g1 * fresnel;
        }
        const vec3 d(r * std::cos(phi), r * std::sin(phi), std::sqrt(1 - u.x));
        through += (1 - kDielectric) *
                   (1 - std::pow(1 - std::min(glm::dot(wo, glm::normalize(wo + d)), 1.0f), 5.0f));
      }
      const auto at = static_cast<size_t>(row * kTableSide + column);
      constexpr double kCount = kSamples * kSamples;
      values[at] = static_cast<float>(scale / kCount);
      values[kTableSide * kTableSide + at] = static_cast<float>(offset / kCount);
      values[2 * kTableSide * kTableSide + at] = static_cast<float>(through / kCount);
    }
  return at::tensor(values, at::kFloat).reshape({1, 3, kTableSide, kTableSide});
}

}  // namespace patina::mini_data
