// Inverse rendering: finds base colour, roughness and normal maps whose renders look like the edited views
// [Hadadan2025, Sec. 4 and 5].
#pragma once

#include <array>
#include <span>
#include <vector>

#include "patina/base/progress.h"
#include "patina/inverse/cache_schedule.h"
#include "patina/inverse/evaluate.h"
#include "patina/inverse/fit_options.h"
#include "patina/inverse/fit_state.h"
#include "patina/inverse/light_cache.h"
#include "patina/render/scene.h"
#include "patina/views/view_set.h"

namespace patina::inverse {

/// Fits the scene's materials to the edited views. Calls the hooks on the way. Throws Error{kUsage} for
/// edited views of other sizes, Error{kInterrupted} when progress asks to stop.
FitResult fit_materials(const render::Scene& scene, const FitInputs& inputs, const FitOptions& options,
                        const FitHooks& hooks, const Progress& progress);

/// The same step by step: start or resume, iterate while there is work, choose the best, take the result.
/// Refers to the scene, the views and the edited images.
class Fit {
 public:
  Fit(const render::Scene& scene, const FitInputs& inputs, const FitOptions& options,
      const Progress& progress);
  Fit(const Fit&) = delete;
  Fit& operator=(const Fit&) = delete;

  /// Casts the rays of the first light caches.
  void start();
  /// Goes on where `checkpoint` was made. Throws Error{kFormat} if it belongs to another fit.
  void resume(const FitCheckpoint& checkpoint);

  bool has_work() const;
  /// One step of descent. Interrupted, it leaves the state as the last iteration left it.
  void iterate();
  int num_done() const { return state_.next_iteration; }

  FitCheckpoint checkpoint() const { return make_checkpoint(state_); }
  /// The views, sRGB [H,W,3], as the light caches show them: noisy, black where pixels count nothing.
  std::vector<Image> rendered() const;
  std::span<const float> loss() const { return state_.loss; }

  /// Takes the best of the last textures, those after three quarters of the iterations, and the first, by
  /// light caches that no iteration saw.
  void choose_best();
  /// What has been found so far. The end of this fit.
  FitResult take_result();

 private:
  void trace(LightCache& cache, int generation);
  LightCache& renew(int generation);

  const render::Scene& scene_;
  const FitInputs inputs_;
  const FitOptions options_;
  const Progress& progress_;
  const float gain_;  // 2^exposure_ev
  const CacheSchedule schedule_;
  const std::vector<Image> weights_;             // of each view's pixels
  std::vector<CachePixel> pixels_;               // that count, and toward what
  const std::vector<asset::MaterialMaps> base_;  // starting maps at the size that they will be written with
  FitState state_;
  const Parameters untouched_;
  const std::vector<asset::MaterialMaps> coarse_;  // starting maps at the size of the fields
  Evaluator evaluator_;
  std::array<LightCache, CacheSchedule::kPlaces> caches_;
  float psnr_ = 0;  // of the chosen textures
};

}  // namespace patina::inverse
