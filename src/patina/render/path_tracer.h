// Unidirectional path tracing with next-event estimation and multiple importance sampling by the balance
// heuristic [Veach1997].
#pragma once

#include "patina/base/progress.h"
#include "patina/base/random.h"
#include "patina/image/image.h"
#include "patina/render/camera.h"
#include "patina/render/scene.h"

namespace patina::render {

struct PathOptions {
  int samples_per_pixel = 64;
  int max_depth = 6;       // path segments after the camera ray; 1 is direct light only
  int roulette_depth = 3;  // Russian roulette from this depth on
  uint64_t seed = 0;
  bool show_environment = false;  // whether camera rays that hit nothing see the environment (else black)
};

/// Radiance that arrives along one ray, [3] linear; `coverage` (may be null) gets 1 where a surface was hit,
/// else 0.
vec3 trace_path(const Scene& scene, const Ray& ray, const PathOptions& options, RandomStream& random,
                float* coverage = nullptr);

/// The same where it is known already what the ray meets first. For scenes without blended surfaces, where
/// that is certain.
vec3 trace_path_from(const Scene& scene, const Ray& ray, const Hit& first, const PathOptions& options,
                     RandomStream& random);

/// Both with other maps of the asset than the scene's own (Scene::surface).
vec3 trace_path(const Scene& scene, std::span<const asset::MaterialMaps> asset_materials, const Ray& ray,
                const PathOptions& options, RandomStream& random);
vec3 trace_path_from(const Scene& scene, std::span<const asset::MaterialMaps> asset_materials, const Ray& ray,
                     const Hit& first, const PathOptions& options, RandomStream& random);

struct Render {
  Image radiance;  // [H,W,3] linear HDR, premultiplied by coverage when the environment is not shown
  Image coverage;  // [H,W,1] share of camera rays that hit a surface, [0,1]
};
Render render(const Scene& scene, const Camera& camera, const PathOptions& options,
              const Progress& progress = {}, std::string_view task = "render");

}  // namespace patina::render
