#include "patina/inverse/incident_light.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "patina/base/check.h"
#include "patina/render/frame.h"
#include "patina/render/lights.h"
#include "patina/render/microfacet.h"
#include "patina/render/path_tracer.h"
#include "patina/render/sampling.h"

namespace patina::inverse {
namespace {

// The wide lobe keeps the density above zero where the narrow one is, should the fit make the surface
// rougher.
constexpr float kWideRoughness = 0.5f;

constexpr int kMaxLights = 8;

// Radical inverse in base 2: with i/n the second coordinate of a Hammersley set.
float radical_inverse(uint32_t i) {
  i = (i << 16) | (i >> 16);
  i = ((i & 0x00FF00FFu) << 8) | ((i & 0xFF00FF00u) >> 8);
  i = ((i & 0x0F0F0F0Fu) << 4) | ((i & 0xF0F0F0F0u) >> 4);
  i = ((i & 0x33333333u) << 2) | ((i & 0xCCCCCCCCu) >> 2);
  i = ((i & 0x55555555u) << 1) | ((i & 0xAAAAAAAAu) >> 1);
  return uniform_from_bits(i);
}
vec2 shifted(const vec2& u, const vec2& shift) {
  const vec2 sum = u + shift;
  // Rounding can bring the fraction of a number just below one to one.
  return glm::min(sum - glm::floor(sum), vec2(0x1.fffffep-1f));
}

}  // namespace

LightGatherer::LightGatherer(const render::Scene& scene, std::span<const asset::MaterialMaps> asset_materials,
                             const GatherOptions& options)
    : scene_(scene),
      asset_materials_(asset_materials),
      options_(options),
      aims_(static_cast<size_t>(options.num_directions)) {
  PATINA_CHECK_LE(static_cast<int>(kNumStrategies), options.num_directions);
  directions_.resize(aims_.size());
}

// How many of the directions each strategy makes. Metals have no diffuse lobe: their directions go to the
// narrow one.
LightGatherer::Counts LightGatherer::shares(int num_directions, bool has_lights, float metallic) {
  std::array<float, kNumStrategies> share{};
  share[kLights] = has_lights ? 0.35f : 0.0f;
  share[kCosine] = 0.3f - 0.2f * metallic;
  share[kNarrow] = 0.25f + 0.2f * metallic;
  share[kWide] = 0.15f;
  float total = 0;
  for (const float s : share) total += s;
  Counts count{};
  int left = num_directions;
  for (size_t s = 0; s < kNumStrategies; ++s) {
    if (share[s] <= 0.0f) continue;
    count[s] =
        std::max(1, static_cast<int>(std::floor(share[s] / total * static_cast<float>(num_directions))));
    left -= count[s];
  }
  count[kNarrow] += left;
  return count;
}

int LightGatherer::num_entries(const render::Scene& scene, const GatherOptions& options) {
  return options.num_directions + std::min(kMaxLights, static_cast<int>(scene.lights().size()));
}

void LightGatherer::gather(const render::SurfacePoint& surface, const vec3& wo, RandomStream& random,
                           std::span<IncidentLight> entries) {
  PATINA_CHECK_EQ(static_cast<int>(entries.size()), num_entries(scene_, options_));
  std::fill(entries.begin(), entries.end(), IncidentLight{surface.n_interpolated, vec3(0.0f)});
  const size_t num_punctual = entries.size() - aims_.size();
  gather_punctual(surface, random, entries.first(num_punctual));

  const Counts counts =
      shares(options_.num_directions, scene_.light_sampler().has_extended(), surface.bsdf.metallic);
  LobeMixture mixture;
  mixture.n = surface.n_shading;
  mixture.wo = wo;
  mixture.num_cosine = static_cast<float>(counts[kCosine]);
  mixture.num_narrow = static_cast<float>(counts[kNarrow]);
  mixture.num_wide = static_cast<float>(counts[kWide]);
  mixture.alpha_narrow = render::alpha_from_roughness(surface.bsdf.roughness);
  mixture.alpha_wide = render::alpha_from_roughness(kWideRoughness);
  choose_directions(surface, wo, mixture, counts, random);
  lobe_densities(mixture, directions_, density_);
  cast_rays(surface, static_cast<float>(counts[kLights]), random, entries.subspan(num_punctual));
}

void LightGatherer::choose_directions(const render::SurfacePoint& surface, const vec3& wo,
                                      const LobeMixture& mixture, const Counts& counts,
                                      RandomStream& random) {
  const render::Lights& lights = scene_.light_sampler();
  const render::Frame frame(surface.n_shading);
  const vec3 wo_local = frame.to_local(wo);
  size_t next = 0;
  for (int strategy = 0; strategy < kNumStrategies; ++strategy) {
    const int count = counts[static_cast<size_t>(strategy)];
    const vec2 shift = random.uniform2();
    for (int i = 0; i < count; ++i, ++next) {
      // A shifted Hammersley point.
      const vec2 u = shifted(vec2((static_cast<float>(i) + 0.5f) / static_cast<float>(count),
                                  radical_inverse(static_cast<uint32_t>(i))),
                             shift);
      Aim& aim = aims_[next];
      aim = {};
      vec3 wi = surface.n_interpolated;
      if (strategy == kLights) {
        const float u_light = (static_cast<float>(i) + random.uniform()) / static_cast<float>(count);
        if (const auto light = lights.sample_extended(surface.p_world, u_light, u)) {
          wi = light->direction;
          aim.valid = true;
          aim.from_environment = light->at_infinity;
          aim.arrival = {light->radiance, light->pdf};
          if (!light->at_infinity) aim.distance = glm::length(light->p_light - surface.p_world);
        }
      } else if (strategy == kCosine) {
        wi = frame.to_world(render::sample_cosine_hemisphere(u));
        aim.valid = true;
      } else if (wo_local.z > 0.0f) {
        const vec3 h = render::sample_visible_normal(
            strategy == kNarrow ? mixture.alpha_narrow : mixture.alpha_wide, wo_local, u);
        wi = frame.to_world(2.0f * glm::dot(wo_local, h) * h - wo_local);
        // A microfacet may reflect below the horizon: that light is what single scattering loses.
        aim.valid = glm::dot(wi, surface.n_shading) > 0.0f;
      }
      // Light from below the true surface cannot arrive.
      aim.valid = aim.valid && glm::dot(wi, surface.n_geometric) > 0.0f;
      directions_.set(next, wi);
    }
  }
  PATINA_CHECK_EQ(next, aims_.size());
}

void LightGatherer::cast_rays(const render::SurfacePoint& surface, float num_lights, RandomStream& random,
                              std::span<IncidentLight> entries) const {
  const render::Lights& lights = scene_.light_sampler();
  for (size_t i = 0; i < aims_.size(); ++i) {
    const Aim& aim = aims_[i];
    if (!aim.valid) continue;
    const vec3 wi = directions_[i];
    const render::Ray ray = render::spawn_ray(surface, wi);
    // Any surface that is not wholly transparent.
    const std::optional<render::Hit> hit = scene_.intersect(ray, 0.0f);
    // Aiming at an emitter makes a direction only if the emitter is what the direction meets first. So the
    // strategy has no density along blocked directions, and the mixture stays exact.
    if (aim.distance > 0.0f && !(hit && std::abs(hit->t - aim.distance) < 1e-3f * aim.distance)) continue;

    const render::Environment::Arrival arrival =
        aim.from_environment ? aim.arrival : lights.arrival_from_environment(wi);
    float density = density_[i] + num_lights * arrival.pdf;
    if (hit && lights.has_emitters()) {
      const render::SurfacePoint met = scene_.surface(ray, *hit, asset_materials_);
      density += num_lights * lights.pdf_triangle(hit->primitive, hit->triangle, wi, hit->t, met.n_geometric);
    }
    if (!(density > 0.0f)) continue;
    const vec3 weighted = (hit ? radiance_of_hit(ray, *hit, random) : arrival.radiance) / density;
    if (is_finite(weighted)) entries[i] = {wi, weighted};
  }
}

// All punctual lights, or kMaxLights spread evenly with one random offset.
void LightGatherer::gather_punctual(const render::SurfacePoint& surface, RandomStream& random,
                                    std::span<IncidentLight> entries) const {
  if (entries.empty()) return;
  const std::span<const asset::Light> punctual = scene_.lights();
  const float stride = static_cast<float>(punctual.size()) / static_cast<float>(entries.size());
  const float offset = punctual.size() > entries.size() ? random.uniform() : 0.0f;
  for (size_t i = 0; i < entries.size(); ++i) {
    const auto chosen =
        std::min(static_cast<size_t>((static_cast<float>(i) + offset) * stride), punctual.size() - 1);
    const asset::Light& light = punctual[chosen];
    const render::PunctualArrival arrival = render::punctual_arrival(light, surface.p_world);
    if (!(glm::dot(arrival.direction, surface.n_geometric) > 0.0f &&
          max_component(arrival.irradiance) > 0.0f))
      continue;
    const render::Ray shadow = light.kind == asset::LightKind::kDirectional
                                   ? render::spawn_ray(surface, arrival.direction)
                                   : render::spawn_segment(surface, light.p_world);
    if (!scene_.occluded(shadow, random.uniform()))
      entries[i] = {arrival.direction, arrival.irradiance * stride};
  }
}

// What a surface sends back along the ray that met it.
vec3 LightGatherer::radiance_of_hit(const render::Ray& ray, const render::Hit& hit,
                                    RandomStream& random) const {
  render::PathOptions path;
  path.max_depth = options_.max_depth - 1;
  path.roulette_depth = 1;  // one direction of many: a short path tells enough
  path.show_environment = true;
  // A path decides anew whether blended surfaces are met or passed.
  return scene_.has_blended() ? render::trace_path(scene_, asset_materials_, ray, path, random)
                              : render::trace_path_from(scene_, asset_materials_, ray, hit, path, random);
}

}  // namespace patina::inverse
