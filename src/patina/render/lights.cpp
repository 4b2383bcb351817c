#include "patina/render/lights.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "patina/render/sampling.h"
#include "patina/render/scene_state.h"

namespace patina::render {
namespace {

float triangle_area(const asset::Primitive& primitive, const uvec3& t) {
  const glm::dvec3 a(primitive.p_world[t.x]), b(primitive.p_world[t.y]), c(primitive.p_world[t.z]);
  return static_cast<float>(0.5 * glm::length(glm::cross(b - a, c - a)));
}

bool emits(const asset::MaterialMaps& material) {
  return std::any_of(material.emission.texels.pixels.begin(), material.emission.texels.pixels.end(),
                     [](float value) { return value > 0.0f; });
}

float mean_of_channels(const vec3& v) {
  return (v.x + v.y + v.z) * (1.0f / 3.0f);
}

/// Mean radiance of a triangle from a fixed pattern of points. An estimate is enough: it only steers the
/// sampling, and a spot that it misses is still found by the paths that hit it.
float mean_emission(const asset::MaterialMaps& material, const asset::Primitive& primitive,
                    uint32_t triangle) {
  if (material.emission.texels.num_pixels() == 1) return mean_of_channels(material.emission.texels.rgb(0, 0));
  constexpr int kSide = 4;
  float sum = 0.0f;
  for (int i = 0; i < kSide; ++i)
    for (int j = 0; j < kSide; ++j) {
      const vec2 u((static_cast<float>(i) + 0.5f) / kSide, (static_cast<float>(j) + 0.5f) / kSide);
      sum += mean_of_channels(emission_at(material, primitive, triangle, sample_triangle(u)));
    }
  return sum / (kSide * kSide);
}

}  // namespace

Lights::Lights(const Environment& environment, std::span<const asset::Primitive* const> primitives,
               std::span<const int> material_of_primitive, std::span<const asset::MaterialMaps> materials,
               std::span<const asset::Light> punctual, float scene_radius)
    : environment_(&environment),
      primitives_(primitives),
      material_of_primitive_(material_of_primitive),
      materials_(materials),
      punctual_(punctual),
      density_(primitives.size()) {
  std::vector<bool> material_emits;
  for (const asset::MaterialMaps& material : materials) material_emits.push_back(emits(material));

  std::vector<double> power;  // of each emitter, W, up to a factor that all share
  double total = 0;
  for (size_t p = 0; p < primitives.size(); ++p) {
    const auto m = static_cast<size_t>(material_of_primitive[p]);
    if (!material_emits[m]) continue;
    const asset::Primitive& primitive = *primitives[p];
    density_[p].assign(primitive.triangles.size(), 0.0f);
    for (uint32_t t = 0; t < primitive.triangles.size(); ++t) {
      const float area = triangle_area(primitive, primitive.triangles[t]);
      const double flux = static_cast<double>(area) * mean_emission(materials[m], primitive, t);
      if (!(flux > 0)) continue;
      emitters_.push_back({static_cast<uint32_t>(p), t, area});
      power.push_back(flux);
      total += flux;
    }
  }

  emitter_cdf_.assign(emitters_.size() + 1, 0.0f);
  double sum = 0;
  for (size_t i = 0; i < emitters_.size(); ++i) {
    sum += power[i];
    emitter_cdf_[i + 1] = static_cast<float>(sum / total);
  }
  if (!emitters_.empty()) emitter_cdf_.back() = 1.0f;

  // What the environment sends through the scene's sphere against what the (two-sided) emitters send out;
  // bounded, since an emitter near a point matters more there than its power says, and the other way round.
  const double environment_power =
      2.0 * std::numbers::pi * square(scene_radius) * environment.mean_radiance();
  if (environment_power > 0)
    environment_probability_ =
        emitters_.empty()
            ? 1.0f
            : glm::clamp(static_cast<float>(environment_power / (environment_power + total)), 0.1f, 0.9f);

  const float emitter_probability = 1.0f - environment_probability_;
  for (size_t i = 0; i < emitters_.size(); ++i)
    density_[emitters_[i].primitive][emitters_[i].triangle] =
        emitter_probability * (emitter_cdf_[i + 1] - emitter_cdf_[i]) / emitters_[i].area;
}

std::optional<LightSample> Lights::sample_extended(const vec3& p, float u_light, const vec2& u) const {
  LightSample out;
  if (u_light < environment_probability_) {
    const Environment::Sample sample = environment_->sample(u);
    out.direction = sample.direction;
    out.at_infinity = true;
    out.radiance = sample.radiance;
    out.pdf = environment_probability_ * sample.pdf;
    return out;
  }
  if (emitters_.empty()) return std::nullopt;

  const float u_emitter = (u_light - environment_probability_) / (1.0f - environment_probability_);
  const auto upper = std::upper_bound(emitter_cdf_.begin(), emitter_cdf_.end(), u_emitter);
  const auto index =
      std::min<size_t>(static_cast<size_t>(upper - emitter_cdf_.begin()) - 1, emitters_.size() - 1);
  const Emitter& emitter = emitters_[index];
  const asset::Primitive& primitive = *primitives_[emitter.primitive];
  const asset::MaterialMaps& material =
      materials_[static_cast<size_t>(material_of_primitive_[emitter.primitive])];
  const uvec3& t = primitive.triangles[emitter.triangle];

  const vec2 barycentric = sample_triangle(u);
  out.p_light = interpolate(primitive.p_world, t, barycentric);
  const vec3 to_light = out.p_light - p;
  const float distance = glm::length(to_light);
  if (!(distance > 0.0f)) return std::nullopt;
  out.direction = to_light / distance;
  const glm::dvec3 a(primitive.p_world[t.x]), b(primitive.p_world[t.y]), c(primitive.p_world[t.z]);
  const vec3 n(glm::normalize(glm::cross(b - a, c - a)));
  out.pdf = pdf_triangle(emitter.primitive, emitter.triangle, out.direction, distance, n);
  if (!(out.pdf > 0.0f) || !std::isfinite(out.pdf)) return std::nullopt;
  out.radiance = emission_at(material, primitive, emitter.triangle, barycentric);
  // The shadow ray ends before the light, so the light's own transparency must enter here.
  if (material.alpha_mode != asset::AlphaMode::kOpaque)
    out.radiance *= opacity_at(material, primitive, emitter.triangle, barycentric);
  return out;
}

Environment::Arrival Lights::arrival_from_environment(const vec3& direction) const {
  Environment::Arrival arrival = environment_->arrival(direction);
  arrival.pdf *= environment_probability_;
  return arrival;
}

float Lights::pdf_triangle(uint32_t primitive, uint32_t triangle, const vec3& direction, float t,
                           const vec3& n) const {
  const std::vector<float>& density = density_[primitive];
  if (density.empty()) return 0.0f;
  const float cosine = std::abs(glm::dot(direction, n));
  return cosine > 0.0f ? density[triangle] * t * t / cosine : 0.0f;
}

std::optional<LightSample> Lights::sample_punctual(const vec3& p, float u_light) const {
  float total = 0.0f;
  for (const asset::Light& light : punctual_)
    total += mean_of_channels(punctual_arrival(light, p).irradiance);
  if (!(total > 0.0f)) return std::nullopt;

  float sum = 0.0f;
  std::optional<LightSample> chosen;
  for (const asset::Light& light : punctual_) {
    const PunctualArrival arrival = punctual_arrival(light, p);
    const float part = mean_of_channels(arrival.irradiance);
    if (!(part > 0.0f)) continue;
    sum += part;
    chosen = LightSample{arrival.direction, light.p_world, light.kind == asset::LightKind::kDirectional,
                         arrival.irradiance, part / total};
    if (u_light * total < sum) break;
  }
  return chosen;
}

PunctualArrival punctual_arrival(const asset::Light& light, const vec3& p) {
  const vec3 power = light.color * light.intensity;
  if (light.kind == asset::LightKind::kDirectional) return {-light.direction_world, power};

  const vec3 to_light = light.p_world - p;
  const float distance = glm::length(to_light);
  if (!(distance > 0.0f)) return {};
  const vec3 direction = to_light / distance;
  float attenuation = 1.0f / square(distance);
  if (light.range > 0.0f) {
    const float ratio2 = square(distance / light.range);
    attenuation *= glm::clamp(1.0f - ratio2 * ratio2, 0.0f, 1.0f);
  }
  if (light.kind == asset::LightKind::kSpot) {
    const float cos_outer = std::cos(light.outer_cone_angle), cos_inner = std::cos(light.inner_cone_angle);
    const float cosine = glm::dot(light.direction_world, -direction);
    const float fade = glm::clamp((cosine - cos_outer) / std::max(0.001f, cos_inner - cos_outer), 0.0f, 1.0f);
    attenuation *= fade * fade;
  }
  return {direction, power * attenuation};
}

}  // namespace patina::render
