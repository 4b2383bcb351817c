#include "patina/inverse/incident_light.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "patina/base/check.h"
#include "patina/render/lights.h"
#include "patina/render/path_tracer.h"
#include "patina/render/sampling.h"

namespace patina::inverse {
namespace {

// The wide lobe keeps the density above zero where the narrow one is, should the fit make the surface
// rougher.
constexpr float kWideRoughness = 0.5f;

enum Strategy { kLights, kCosine, kNarrow, kWide, kNumStrategies };

// How many of the directions each strategy makes. Metals have no diffuse lobe: their directions go to the
// narrow one.
std::array<int, kNumStrategies> shares(int num_directions, bool has_lights, float metallic) {
  std::array<float, kNumStrategies> share{};
  share[kLights] = has_lights ? 0.35f : 0.0f;
  share[kCosine] = 0.3f - 0.2f * metallic;
  share[kNarrow] = 0.25f + 0.2f * metallic;
  share[kWide] = 0.15f;
  float total = 0;
  for (const float s : share) total += s;
  std::array<int, kNumStrategies> count{};
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

struct Frame {
  vec3 x, y, z;
  explicit Frame(const vec3& n) : z(n) {
    const Basis basis = orthonormal_basis(n);
    x = basis.tangent, y = basis.bitangent;
  }
  vec3 to_local(const vec3& v) const { return {glm::dot(v, x), glm::dot(v, y), glm::dot(v, z)}; }
  vec3 to_world(const vec3& v) const { return x * v.x + y * v.y + z * v.z; }
};

render::BsdfParams mirror_lobe(float roughness) {
  return {vec3(1.0f), roughness, 1.0f};
}

}  // namespace

int num_entries(const render::Scene& scene, const GatherOptions& options) {
  return options.num_directions + std::min(kMaxLights, static_cast<int>(scene.lights().size()));
}

void gather_light(const render::Scene& scene, const render::SurfacePoint& surface, const vec3& wo_world,
                  const GatherOptions& options, RandomStream& random, std::span<IncidentLight> entries) {
  PATINA_CHECK_EQ(static_cast<int>(entries.size()), num_entries(scene, options));
  std::fill(entries.begin(), entries.end(), IncidentLight{surface.n_interpolated, vec3(0.0f)});
  size_t next = 0;

  // Punctual lights: all of them, or kMaxLights spread evenly with one random offset.
  const std::span<const asset::Light> punctual = scene.lights();
  const size_t num_punctual = std::min<size_t>(kMaxLights, punctual.size());
  if (num_punctual > 0) {
    const float stride = static_cast<float>(punctual.size()) / static_cast<float>(num_punctual);
    const float offset = punctual.size() > num_punctual ? random.uniform() : 0.0f;
    for (size_t i = 0; i < num_punctual; ++i) {
      const auto chosen =
          std::min(static_cast<size_t>((static_cast<float>(i) + offset) * stride), punctual.size() - 1);
      const asset::Light& light = punctual[chosen];
      const render::PunctualArrival arrival = render::punctual_arrival(light, surface.p_world);
      IncidentLight& entry = entries[next++];
      if (!(glm::dot(arrival.direction, surface.n_geometric) > 0.0f &&
            max_component(arrival.irradiance) > 0.0f))
        continue;
      const render::Ray shadow = light.kind == asset::LightKind::kDirectional
                                     ? render::spawn_ray(surface, arrival.direction)
                                     : render::spawn_segment(surface, light.p_world);
      if (!scene.occluded(shadow, random.uniform())) entry = {arrival.direction, arrival.irradiance * stride};
    }
  }

  const render::Lights& lights = scene.light_sampler();
  const auto counts = shares(options.num_directions, lights.has_extended(), surface.bsdf.metallic);
  const Frame frame(surface.n_shading);
  const vec3 wo = frame.to_local(wo_world);
  const render::BsdfParams narrow = mirror_lobe(surface.bsdf.roughness);
  const render::BsdfParams wide = mirror_lobe(kWideRoughness);

  for (int strategy = 0; strategy < kNumStrategies; ++strategy) {
    const int count = counts[static_cast<size_t>(strategy)];
    const vec2 shift = random.uniform2();
    for (int i = 0; i < count; ++i) {
      IncidentLight& entry = entries[next++];
      // Three numbers a direction: a shifted Hammersley point, and which light or lobe it is for.
      const vec2 u = shifted(vec2((static_cast<float>(i) + 0.5f) / static_cast<float>(count),
                                  radical_inverse(static_cast<uint32_t>(i))),
                             shift);
      const float u_choice = (static_cast<float>(i) + random.uniform()) / static_cast<float>(count);
      vec3 wi(0.0f);
      float aimed_distance = 0.0f;  // of the emitter that the direction was made for
      if (strategy == kLights) {
        const auto light = lights.sample_extended(surface.p_world, u_choice, u);
        if (!light) continue;
        wi = light->direction;
        if (!light->at_infinity) aimed_distance = glm::length(light->p_light - surface.p_world);
      } else if (strategy == kCosine) {
        wi = frame.to_world(render::sample_cosine_hemisphere(u));
      } else {
        const auto sample = render::sample_bsdf(render::BsdfModel::kGltf, strategy == kNarrow ? narrow : wide,
                                                wo, u_choice, u);
        if (!(sample.pdf > 0.0f)) continue;
        wi = frame.to_world(sample.wi);
      }
      // Light from below the true surface cannot arrive.
      if (!(glm::dot(wi, surface.n_geometric) > 0.0f)) continue;

      const render::Ray ray = render::spawn_ray(surface, wi);
      const std::optional<render::Hit> hit =
          scene.intersect(ray, 0.0f);  // any surface that is not wholly transparent
      // Aiming at an emitter makes a direction only if the emitter is what the direction meets first. So the
      // strategy has no density along blocked directions, and the mixture stays exact.
      if (aimed_distance > 0.0f && !(hit && std::abs(hit->t - aimed_distance) < 1e-3f * aimed_distance))
        continue;

      const vec3 wi_local = frame.to_local(wi);
      float density = static_cast<float>(counts[kCosine]) * std::max(wi_local.z, 0.0f) * kInvPi;
      density += static_cast<float>(counts[kNarrow]) *
                 render::pdf_bsdf(render::BsdfModel::kGltf, narrow, wo, wi_local);
      density +=
          static_cast<float>(counts[kWide]) * render::pdf_bsdf(render::BsdfModel::kGltf, wide, wo, wi_local);
      if (counts[kLights] > 0) {
        float light_density = lights.pdf_environment(wi);
        if (hit) {
          const render::SurfacePoint met = scene.surface(ray, *hit);
          light_density += lights.pdf_triangle(hit->primitive, hit->triangle, wi, hit->t, met.n_geometric);
        }
        density += static_cast<float>(counts[kLights]) * light_density;
      }
      if (!(density > 0.0f)) continue;

      // Nothing in the way is the common case; else a path decides whether blended surfaces are met or
      // passed.
      vec3 radiance = scene.environment().radiance(wi);
      if (hit) {
        render::PathOptions path;
        path.max_depth = options.max_depth - 1;
        path.show_environment = true;
        radiance = render::trace_path(scene, ray, path, random);
      }
      const vec3 weighted = radiance / density;
      if (is_finite(weighted)) entry = {wi, weighted};
    }
  }
  PATINA_CHECK_EQ(next, entries.size());
}

}  // namespace patina::inverse
