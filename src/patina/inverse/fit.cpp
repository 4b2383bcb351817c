#include "patina/inverse/fit.h"

#include <cmath>
#include <limits>

#include "patina/base/check.h"
#include "patina/base/clock.h"
#include "patina/base/error.h"
#include "patina/inverse/fit_result.h"
#include "patina/inverse/fit_setup.h"
#include "patina/inverse/fit_step.h"
#include "patina/inverse/fit_views.h"
#include "patina/inverse/loss.h"

namespace patina::inverse {
namespace {

constexpr double kSecondsBetweenCheckpoints = 20, kSecondsBetweenPreviews = 5;

// The pixels that count, with the colours of the views as they are.
std::vector<CachePixel> counted_pixels(const views::ViewSet& views, std::span<const Image> edited,
                                       std::span<const Image> weights) {
  std::vector<Image> targets;
  for (const Image& view : edited) targets.push_back(loss_target(view));
  return select_pixels(views, targets, weights);
}

// Radiance of every pixel in all caches but one.
std::vector<std::span<const vec3>> all_but(const std::vector<std::vector<vec3>>& radiance, size_t left_out) {
  std::vector<std::span<const vec3>> others;
  for (size_t k = 0; k < radiance.size(); ++k)
    if (k != left_out) others.push_back(radiance[k]);
  return others;
}

// Iterates to the end and calls the hooks when they are due.
void run(Fit& fit, const FitHooks& hooks, const Progress& progress) {
  auto last_checkpoint = Clock::now(), last_preview = Clock::now();
  while (fit.has_work()) {
    progress.throw_if_stopped();
    fit.iterate();
    const bool is_last = !fit.has_work();
    if (hooks.on_preview && (is_last || seconds_since(last_preview) > kSecondsBetweenPreviews)) {
      hooks.on_preview({fit.rendered(), fit.loss()});
      last_preview = Clock::now();
    }
    const bool is_due = is_last || seconds_since(last_checkpoint) > kSecondsBetweenCheckpoints ||
                        (hooks.every_iterations > 0 && fit.num_done() % hooks.every_iterations == 0);
    if (hooks.on_checkpoint && is_due) {
      hooks.on_checkpoint(fit.checkpoint());
      last_checkpoint = Clock::now();
    }
  }
}

}  // namespace

Fit::Fit(const render::Scene& scene, const FitInputs& inputs, const FitOptions& options,
         const Progress& progress)
    : scene_(scene),
      inputs_(checked(inputs, scene)),
      options_(options),
      progress_(progress),
      gain_(std::exp2(inputs.views.exposure_ev)),
      schedule_(options.iterations),
      weights_(view_weights(scene, inputs, options)),
      pixels_(counted_pixels(inputs.views, inputs.edited, weights_)),
      base_(enlarged_maps(scene, inputs, pixels_, options)),
      state_(initial_state(scene, inputs, pixels_, base_, options)),
      untouched_(parameters_of(state_.fitted)),
      coarse_(shrunk(base_, state_.fitted)),
      evaluator_(state_.fitted, scene.bsdf_model(), gain_) {
  PATINA_CHECK_LE(0, options.iterations);
  if (state_.fitted.empty())
    progress.warn("no view shows a surface with UVs and an enhanced material: nothing was fitted");
}

bool Fit::has_work() const {
  return !state_.fitted.empty() && state_.next_iteration < options_.iterations;
}

void Fit::trace(LightCache& cache, int generation) {
  const std::vector<asset::MaterialMaps> current = apply_changes(coarse_, state_.fitted, Padding::kNone);
  CacheOptions options;
  options.light_samples = options_.light_samples;
  options.max_depth = options_.max_depth;
  options.seed = options_.seed;
  options.generation = static_cast<uint32_t>(generation);
  cache.pixels = pixels_;
  trace_cache(cache, scene_, current, base_, inputs_.views, options, progress_);
}

LightCache& Fit::renew(int generation) {
  LightCache& cache = caches_[CacheSchedule::place_of(generation)];
  trace(cache, generation);
  return cache;
}

void Fit::start() {
  if (!has_work()) return;
  for (int generation = 0; generation < CacheSchedule::kPlaces; ++generation)
    state_.cache_radiance[CacheSchedule::place_of(generation)] = evaluator_.shade_pixels(renew(generation));
}

void Fit::resume(const FitCheckpoint& checkpoint) {
  restore_checkpoint(state_, checkpoint);
  retarget(pixels_, inputs_.edited, state_.displacements);
  if (state_.next_iteration == 0) return start();
  if (!has_work()) return;
  // Each cache was traced with the parameters of its own beginning.
  const Parameters current = parameters_of(state_.fitted);
  const int newest = schedule_.newest_at(state_.next_iteration - 1);
  for (int generation = newest - CacheSchedule::kPlaces + 1; generation <= newest; ++generation) {
    set_parameters(state_.fitted, state_.cache_parameters[CacheSchedule::place_of(generation)]);
    renew(generation);
  }
  set_parameters(state_.fitted, current);
}

void Fit::iterate() {
  const int iteration = state_.next_iteration;
  const size_t turn = schedule_.place_at(iteration);
  if (schedule_.begins_at(iteration)) {
    renew(schedule_.newest_at(iteration));
    state_.cache_parameters[turn] = parameters_of(state_.fitted);
  }
  if (!options_.keep_in_place && is_aligned_at(iteration, options_.iterations)) {
    align(state_, pixels_, inputs_.edited, weights_, gain_);
    retarget(pixels_, inputs_.edited, state_.displacements);
    for (LightCache& cache : caches_) cache.pixels = pixels_;
  }
  state_.loss.push_back(
      evaluator_.evaluate(caches_[turn], all_but(state_.cache_radiance, turn), state_.cache_radiance[turn]));
  step(state_, evaluator_.d_delta(), options_);
  ++state_.next_iteration;
  if (state_.next_iteration == options_.iterations * 3 / 4)
    state_.late_parameters = parameters_of(state_.fitted);
  progress_.update("fit", state_.next_iteration, options_.iterations);
}

std::vector<Image> Fit::rendered() const {
  return rendered_views(state_, pixels_, inputs_.edited, gain_);
}

void Fit::choose_best() {
  if (state_.fitted.empty()) return;
  LightCache &cache = caches_[0], &other = caches_[1];
  trace(cache, CacheSchedule::kJudge);
  trace(other, CacheSchedule::kJudge + 1);
  // Losses of different caches differ by more than the last iterations win, so all candidates meet the same
  // one.
  Parameters best;
  float best_loss = std::numeric_limits<float>::infinity();
  std::vector<vec3> radiance;
  for (const Parameters& candidate : {parameters_of(state_.fitted), state_.late_parameters, untouched_}) {
    set_parameters(state_.fitted, candidate);
    const std::vector<vec3> of_other = evaluator_.shade_pixels(other);
    const float loss = evaluator_.evaluate(cache, std::vector<std::span<const vec3>>{of_other}, radiance);
    if (loss < best_loss) best = candidate, best_loss = loss;
  }
  set_parameters(state_.fitted, best);
  psnr_ = psnr_of(cache, evaluator_.shade_pixels(cache), gain_);
}

FitResult Fit::take_result() {
  FitResult result = result_of(scene_, state_, base_, inputs_.strength, options_.fill_unseen);
  result.psnr = psnr_;
  return result;
}

FitResult fit_materials(const render::Scene& scene, const FitInputs& inputs, const FitOptions& options,
                        const FitHooks& hooks, const Progress& progress) {
  Fit fit(scene, inputs, options, progress);
  if (hooks.resume)
    fit.resume(*hooks.resume);
  else
    fit.start();
  try {
    run(fit, hooks, progress);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kInterrupted) {
      if (hooks.on_checkpoint) hooks.on_checkpoint(fit.checkpoint());
      if (hooks.on_stop) hooks.on_stop(fit.take_result());
    }
    throw;
  }
  fit.choose_best();
  return fit.take_result();
}

}  // namespace patina::inverse
