// Inverse rendering: finds base colour, roughness, metallic and normal maps whose renders look like the
// edited views [Hadadan2025, Sec. 4 and 5].
#pragma once

#include <span>
#include <vector>

#include "patina/base/progress.h"
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

/// The same step by step: start or resume, iterate while there is work, take the result. Refers to the scene,
/// the views and the edited images.
class Fit {
 public:
  Fit(const render::Scene& scene, const FitInputs& inputs, const FitOptions& options,
      const Progress& progress);
  Fit(const Fit&) = delete;
  Fit& operator=(const Fit&) = delete;

  /// Goes on where `checkpoint` was made. Throws Error{kFormat} if it belongs to another fit.
  void resume(const FitCheckpoint& checkpoint);

  bool has_work() const;
  /// One step. Interrupted, it leaves the state as the last iteration left it.
  void iterate();
  int num_done() const { return state_.next_iteration; }

  FitCheckpoint checkpoint() const { return make_checkpoint(state_); }
  /// The views, sRGB [H,W,3], as the light cache shows them: black where pixels count nothing.
  std::vector<Image> rendered() const;
  std::span<const float> loss() const { return state_.loss; }

  /// What has been found so far. The end of this fit.
  FitResult take_result();

 private:
  void trace(int generation);
  void learn_from_start();
  void learn_kinds(std::span<const vec3> clean_radiance);
  float evaluate() { return evaluator_.evaluate(cache_); }

  const render::Scene& scene_;
  const FitInputs inputs_;
  const FitOptions options_;
  const Progress& progress_;
  const float gain_;                             // 2^exposure_ev
  const std::vector<Image> weights_;             // of each view's pixels
  LightCache cache_;                             // its pixels: those that count, and toward what
  const std::vector<asset::MaterialMaps> base_;  // starting maps at the size that they will be written with
  std::vector<SeenPoint> seen_;                  // until the evaluator has them
  FitState state_;
  const std::vector<asset::MaterialMaps> coarse_;  // starting maps at the size of the fields
  Evaluator evaluator_;
};

}  // namespace patina::inverse
