#include "patina/inverse/fit.h"

#include <algorithm>
#include <cmath>

#include "patina/base/check.h"
#include "patina/base/clock.h"
#include "patina/base/error.h"
#include "patina/inverse/edited_pixels.h"
#include "patina/inverse/first_guess.h"
#include "patina/inverse/fit_result.h"
#include "patina/inverse/fit_setup.h"
#include "patina/inverse/fit_slots.h"
#include "patina/inverse/fit_step.h"
#include "patina/inverse/fit_views.h"
#include "patina/inverse/light_schedule.h"
#include "patina/inverse/loss.h"
#include "patina/inverse/material_kinds.h"

namespace patina::inverse {
namespace {

// Marquardt's damping after a step that made things better, and after one that did not.
constexpr float kRelax = 3.0f, kTighten = 8.0f, kMinDamping = 1e-4f, kMaxDamping = 1e3f;

constexpr double kSecondsBetweenCheckpoints = 20, kSecondsBetweenPreviews = 5;

// The pixels that count, with the colours of the views as they are.
LightCache cache_of_pixels(const views::ViewSet& views, std::span<const Image> edited,
                           std::span<const Image> weights) {
  std::vector<Image> targets;
  for (const Image& view : edited) targets.push_back(loss_target(view));
  LightCache cache;
  cache.pixels = select_pixels(views, targets, weights);
  return cache;
}

// Traces what the pixels show and makes `cache`'s samples of it.
std::vector<SeenPoint> samples_of(LightCache& cache, const render::Scene& scene, const views::ViewSet& views,
                                  std::span<const asset::MaterialMaps> base) {
  std::vector<SeenPoint> points = trace_seen_points(scene, views, cache.pixels);
  make_samples(cache, scene, base, points);
  return points;
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
      weights_(view_weights(scene, inputs, options)),
      cache_(cache_of_pixels(inputs.views, inputs.edited, weights_)),
      base_(enlarged_maps(scene, inputs, cache_.pixels, options)),
      seen_(samples_of(cache_, scene, inputs.views, base_)),
      state_(initial_state(scene, inputs, cache_.pixels, seen_, base_, options)),
      coarse_(shrunk(base_, state_.fitted)),
      evaluator_(state_.fitted, seen_, scene.bsdf_model(), gain_) {
  PATINA_CHECK_LE(0, options.iterations);
  if (state_.fitted.empty())
    progress.warn("no view shows a surface with UVs and an enhanced material: nothing was fitted");
  seen_ = {};
}

bool Fit::has_work() const {
  return !state_.fitted.empty() && state_.next_iteration < options_.iterations;
}

void Fit::trace(int generation) {
  const std::vector<asset::MaterialMaps> current = apply_changes(coarse_, state_.fitted, Padding::kNone);
  CacheOptions options;
  options.light_samples = options_.light_samples;
  options.max_depth = options_.max_depth;
  options.seed = options_.seed;
  options.traces = kLightTraces[static_cast<size_t>(generation)].traces;
  trace_light(cache_, scene_, current, inputs_.views, options, progress_);
}

// The first light falls on the starting maps. What it shows of them tells, beside the clean views, how far
// off the cache is, and beside the edited ones, which texels are of one kind and which kinds turned from
// metal into something else.
void Fit::learn_from_start() {
  const std::vector<vec3> clean = evaluator_.shade_samples(cache_);
  std::vector<float> edited(cache_.pixels.size(), 1.0f);
  if (!inputs_.clean.empty()) {
    edited = edited_pixels(cache_, inputs_.views, inputs_.clean);
    calibrate(cache_, clean, inputs_.clean, gain_);
  }
  for (size_t f = 0; f < state_.fitted.size(); ++f) {
    FittedMap& map = state_.fitted[f];
    map.field.edited =
        edited_texels(cache_, edited, evaluator_.taps_of(f), map.evidence.width, map.evidence.height);
  }
  learn_kinds(clean);
}

void Fit::learn_kinds(std::span<const vec3> clean_radiance) {
  const bool guesses = has(options_.maps, asset::MapSlot::kBaseColor) &&
                       has(options_.maps, asset::MapSlot::kRoughness) &&
                       has(options_.maps, asset::MapSlot::kMetallic);
  const SampleTaps* learned = nullptr;  // whose kinds and changes these are: maps of one layout share them
  std::optional<MaterialKinds> kinds;
  std::vector<std::optional<KindChange>> changes;
  for (size_t f = 0; f < state_.fitted.size(); ++f) {
    FittedMap& map = state_.fitted[f];
    if (!fit_slot(map.slot).follows_kinds) continue;
    const SampleTaps& taps = evaluator_.taps_of(f);
    if (learned != &taps) {
      learned = &taps;
      kinds.emplace(cache_, clean_radiance, gain_, taps.samples);
      changes.clear();
      if (guesses)
        changes = guess_changes(cache_, scene_.bsdf_model(), gain_, taps, kinds->kinds_of(taps.samples),
                                kinds->size());
    }
    map.field.kinds = kinds->shares(taps);
    std::vector<float>& of_kinds = map.field.levels.back().pixels;
    for (size_t k = 0; k < changes.size(); ++k)
      if (changes[k])
        of_kinds[k] = map.slot == asset::MapSlot::kMetallic ? changes[k]->metallic : changes[k]->roughness;
    compose(map.field);
    map.field.guess = map.field.delta.texels;
  }
}

void Fit::resume(const FitCheckpoint& checkpoint) {
  const Parameters start = parameters_of(state_.fitted);
  restore_checkpoint(state_, checkpoint);
  if (state_.next_iteration == 0 || state_.fitted.empty()) return;
  // The first light is that of the starting maps; the last one is what the next iteration sees.
  const Parameters current = parameters_of(state_.fitted);
  set_parameters(state_.fitted, start);
  trace(0);
  learn_from_start();
  const int generation = light_generation_at(state_.next_iteration - 1, options_.iterations);
  if (generation > 0) {
    set_parameters(state_.fitted, state_.light_parameters);
    trace(generation);
  }
  retarget(cache_.pixels, inputs_.edited, state_.displacements);
  set_parameters(state_.fitted, current);
  evaluate();
}

void Fit::iterate() {
  const int iteration = state_.next_iteration;
  const bool is_traced = is_light_traced_at(iteration, options_.iterations);
  const bool is_aligned = !options_.keep_in_place && is_aligned_at(iteration, options_.iterations);
  if (is_aligned) {
    align(state_.displacements, rendered(), inputs_.edited, weights_);
    retarget(cache_.pixels, inputs_.edited, state_.displacements);
  }
  if (is_traced) {
    trace(light_generation_at(iteration, options_.iterations));
    if (iteration == 0) learn_from_start();
    state_.light_parameters = parameters_of(state_.fitted);
  }
  if (is_traced || is_aligned) evaluate();

  const Parameters before = parameters_of(state_.fitted);
  const double objective_before = objective(state_, evaluator_);
  set_parameters(state_.fitted, sum_of(before, solve_step(state_, evaluator_, options_.iterations)));
  float loss = evaluate();
  if (objective(state_, evaluator_) < objective_before) {
    state_.damping = std::max(state_.damping / kRelax, kMinDamping);
  } else {
    state_.damping = std::min(state_.damping * kTighten, kMaxDamping);
    set_parameters(state_.fitted, before);
    loss = evaluate();
  }
  state_.loss.push_back(loss);
  ++state_.next_iteration;
  progress_.update("fit", state_.next_iteration, options_.iterations);
}

std::vector<Image> Fit::rendered() const {
  return rendered_views(evaluator_.radiance(), cache_.pixels, inputs_.edited, gain_);
}

FitResult Fit::take_result() {
  FitResult result = result_of(scene_, state_, base_, inputs_.strength, options_.fill_unseen);
  result.psnr = psnr_of(cache_.pixels, evaluator_.radiance(), gain_);
  return result;
}

FitResult fit_materials(const render::Scene& scene, const FitInputs& inputs, const FitOptions& options,
                        const FitHooks& hooks, const Progress& progress) {
  Fit fit(scene, inputs, options, progress);
  if (hooks.resume) fit.resume(*hooks.resume);
  try {
    run(fit, hooks, progress);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kInterrupted) {
      if (hooks.on_checkpoint) hooks.on_checkpoint(fit.checkpoint());
      if (hooks.on_stop) hooks.on_stop(fit.take_result());
    }
    throw;
  }
  return fit.take_result();
}

}  // namespace patina::inverse
