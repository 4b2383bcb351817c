// Light that arrives at a surface point, as a short list of directions with radiance and weight.
// Multiple-sample importance sampling [Veach1997, Sec. 9.2] over environment and emitters, the cosine and GGX
// lobes; every direction's weight uses the density of the whole mixture, so the list integrates any material,
// not just the one whose lobe helped to choose it.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "patina/base/random.h"
#include "patina/inverse/lobe_density.h"
#include "patina/render/scene.h"

namespace patina::inverse {

/// One incident direction: reflected radiance is the sum over entries of eval_bsdf(wo, wi) ·
/// weighted_radiance.
struct IncidentLight {
  vec3 wi;
  vec3 weighted_radiance;  // radiance / Σ_s n_s p_s for sampled directions, irradiance for punctual lights
};

struct GatherOptions {
  int num_directions = 16;  // at least four: one a strategy
  int max_depth = 4;        // path segments after the camera ray, as render::PathOptions counts them
};

/// Gathers the light at one point after the other; keeps what all points share. One a thread.
class LightGatherer {
 public:
  /// `asset_materials` are worn in place of the scene's own; all arguments must live as long as the gatherer.
  LightGatherer(const render::Scene& scene, std::span<const asset::MaterialMaps> asset_materials,
                const GatherOptions& options);

  /// Entries that `gather` fills: directions and punctual lights (at most eight of them, chosen evenly).
  static int num_entries(const render::Scene& scene, const GatherOptions& options);

  /// Fills `entries` (num_entries of them; unused ones carry no light) for a viewer in direction `wo`. The
  /// material at `surface` places the narrow lobe and decides how the directions are shared out, nothing
  /// else.
  void gather(const render::SurfacePoint& surface, const vec3& wo, RandomStream& random,
              std::span<IncidentLight> entries);

 private:
  enum Strategy { kLights, kCosine, kNarrow, kWide, kNumStrategies };
  using Counts = std::array<int, kNumStrategies>;  // of the directions that each strategy makes

  // What is known of a direction before its ray is cast.
  struct Aim {
    bool valid = false;
    bool from_environment = false;           // chosen by the environment's sampler,
    render::Environment::Arrival arrival{};  // which said this
    float distance = 0;                      // of the emitter that the direction was made for
  };

  static Counts shares(int num_directions, bool has_lights, float metallic);
  // Fills aims_ and directions_.
  void choose_directions(const render::SurfacePoint& surface, const vec3& wo, const LobeMixture& mixture,
                         const Counts& counts, RandomStream& random);
  // What arrives along directions_, whose densities in the mixture of lobes are density_.
  void cast_rays(const render::SurfacePoint& surface, float num_lights, RandomStream& random,
                 std::span<IncidentLight> entries) const;
  void gather_punctual(const render::SurfacePoint& surface, RandomStream& random,
                       std::span<IncidentLight> entries) const;
  vec3 radiance_of_hit(const render::Ray& ray, const render::Hit& hit, RandomStream& random) const;

  const render::Scene& scene_;
  std::span<const asset::MaterialMaps> asset_materials_;
  GatherOptions options_;
  std::vector<Aim> aims_;
  DirectionArrays directions_;
  std::vector<float> density_;
};

}  // namespace patina::inverse
