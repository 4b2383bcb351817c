#include "path_replay_fit.h"

#include <chrono>
#include <cmath>

#include "patina/base/parallel.h"
#include "patina/inverse/light_cache.h"
#include "patina/inverse/loss.h"
#include "patina/inverse/path_replay.h"

namespace patina::bench {

double path_replay_iteration_seconds(const test::Recovery& recovery, const inverse::FitOptions& options,
                                     int paths) {
  std::vector<Image> targets, weights;
  for (size_t v = 0; v < recovery.targets.size(); ++v) {
    targets.push_back(inverse::loss_target(recovery.targets[v]));
    weights.push_back(inverse::loss_weight(recovery.views.views[v].gbuffer, {}, options.boundary_pixels));
  }
  const std::vector<inverse::CachePixel> pixels = inverse::select_pixels(recovery.views, targets, weights);
  const render::Scene scene(recovery.asset, recovery.start, render::studio_environment());
  const std::vector<asset::MaterialMaps>& maps = scene.materials();
  render::PathOptions path_options;
  path_options.max_depth = options.max_depth;
  const float gain = std::exp2(recovery.views.exposure_ev);

  // Two halves of the pixels, each with gradients of its own: threads must not add into one texel.
  constexpr int64_t kParts = 2;
  std::vector<inverse::TexelGradients> gradients(kParts,
                                                 inverse::zero_gradients(maps, scene.num_asset_materials()));
  const auto begin_time = std::chrono::steady_clock::now();
  parallel_for(0, kParts, 1, [&](int64_t begin, int64_t end) {
    for (int64_t part = begin; part < end; ++part)
      for (size_t i = static_cast<size_t>(part); i < pixels.size(); i += kParts) {
        const inverse::CachePixel& pixel = pixels[i];
        std::vector<inverse::PathRecord> records;
        vec3 radiance(0.0f);
        for (int k = 0; k < paths; ++k) {
          RandomStream random(options.seed, RandomPurpose::kTest, i, static_cast<uint32_t>(k));
          const vec2 position = vec2(pixel.x, pixel.y) + random.uniform2();
          records.push_back(inverse::record_path(scene, recovery.views.views[pixel.view].camera.ray(position),
                                                 path_options, random));
          radiance +=
              inverse::path_radiance(records.back(), maps, scene.bsdf_model()) / static_cast<float>(paths);
        }
        const inverse::PixelResidual residual = inverse::relative_residual(radiance, pixel.target, gain);
        const vec3 d_radiance =
            2.0f * pixel.weight / static_cast<float>(paths) * residual.value * residual.d_radiance;
        for (const inverse::PathRecord& record : records)
          inverse::add_path_gradient(record, maps, scene.bsdf_model(), d_radiance,
                                     gradients[static_cast<size_t>(part)]);
      }
  });
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_time).count();
}

}  // namespace patina::bench
