#include "patina/inverse/fit.h"

#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cmath>

#include "patina/base/check.h"
#include "patina/base/error.h"
#include "patina/base/parallel.h"
#include "patina/image/color.h"
#include "patina/inverse/alignment.h"
#include "patina/inverse/evaluate.h"
#include "patina/inverse/fit_slots.h"
#include "patina/inverse/fit_state.h"
#include "patina/inverse/loss.h"
#include "patina/inverse/unseen.h"

namespace patina::inverse {
namespace {

using Clock = std::chrono::steady_clock;

// Iterations take turns over this many light caches, each with its own points and directions, and the oldest
// is traced anew with the current materials kRefreshes times in a fit: no fixed noise is there long enough to
// be fitted. Many caches of few directions find more than few caches of many: for the same rays they also
// give the pixel more points.
constexpr int kCaches = 4;
constexpr int kRefreshes = 36;

// The first fiftieth of the iterations moves levels from a quarter of the finest size down, the second from
// a half, the rest all.
constexpr int kCoarseLevels = 2, kStages = 50;
constexpr double kSecondsBetweenCheckpoints = 20, kSecondsBetweenPreviews = 5;

// The views are aligned with what they make together at these hundredths of the iterations: late enough that
// the textures show where things are, early enough that what was blurred becomes sharp again.
constexpr std::array<int, 4> kAlignments{15, 22, 30, 40};

// Bounds of the size that a map gets from what the views resolve.
constexpr int kMinResolvedSize = 16, kMaxResolvedSize = 2048;

bool is_chosen(const FitOptions& options, int material) {
  return options.materials.empty() || options.materials[static_cast<size_t>(material)];
}

void check_inputs(const render::Scene& scene, const views::ViewSet& views, std::span<const Image> edited,
                  const FitOptions& options) {
  if (edited.size() != views.views.size())
    throw Error(ErrorCode::kUsage, "fit",
                "expected one edited image for each of " + std::to_string(views.views.size()) +
                    " views, found " + std::to_string(edited.size()));
  for (size_t v = 0; v < edited.size(); ++v) {
    const auto& g = views.views[v].gbuffer;
    if (edited[v].width != g.width || edited[v].height != g.height || edited[v].channels != 3)
      throw Error(ErrorCode::kUsage, "edited view " + std::to_string(v),
                  "expected " + std::to_string(g.width) + " x " + std::to_string(g.height) +
                      " pixels of 3 channels, found " + std::to_string(edited[v].width) + " x " +
                      std::to_string(edited[v].height) + " of " + std::to_string(edited[v].channels));
  }
  PATINA_CHECK(options.materials.empty() ||
               static_cast<int>(options.materials.size()) == scene.num_asset_materials());
  PATINA_CHECK_LE(0, options.iterations);
}

// The size that a map will be written with: texture_size where given; otherwise slots without a texture, and
// with kAutoTextureSize all, get one that the views resolve.
ivec2 enlarged_size(const render::Scene& scene, const views::ViewSet& views,
                    std::span<const CachePixel> pixels, const FitOptions& options, int material,
                    const asset::Map& map) {
  const ivec2 own(map.texels.width, map.texels.height);
  if (options.texture_size > 0) return ivec2(options.texture_size);
  const bool has_texture = map.texels.num_pixels() > 1;
  if (has_texture && options.texture_size != kAutoTextureSize) return own;
  const float across = texels_per_pixel(scene, views, pixels, map, material);
  const auto resolved = [&](int texels) {
    const float wanted = across > 0.0f ? static_cast<float>(texels) / across : 1.0f;
    return static_cast<int>(std::bit_ceil(static_cast<unsigned>(
        std::clamp(wanted, static_cast<float>(kMinResolvedSize), static_cast<float>(kMaxResolvedSize)))));
  };
  return glm::max(own, ivec2(resolved(own.x), resolved(own.y)));
}

// The asset's maps at the size that they will be written with.
std::vector<asset::MaterialMaps> enlarged_maps(const render::Scene& scene, const views::ViewSet& views,
                                               std::span<const CachePixel> pixels,
                                               const FitOptions& options) {
  std::vector<asset::MaterialMaps> maps(scene.materials().begin(),
                                        scene.materials().begin() + scene.num_asset_materials());
  for (int m = 0; m < scene.num_asset_materials(); ++m) {
    if (!is_chosen(options, m)) continue;
    for (const asset::MapSlotRow& row : asset::kMapSlots) {
      if (!has(options.maps, row.slot)) continue;
      asset::Map& map = slot_map(maps[static_cast<size_t>(m)], row.slot);
      const ivec2 size = enlarged_size(scene, views, pixels, options, m, map);
      map = asset::resized(map, size.x, size.y);
      if (row.encoding == asset::MapEncoding::kNormal)
        for (size_t i = 0; i < map.texels.num_pixels(); ++i) {
          float* texel = map.texels.pixels.data() + 3 * i;
          const vec3 n = glm::normalize(vec3(texel[0], texel[1], texel[2]));
          texel[0] = n.x, texel[1] = n.y, texel[2] = n.z;
        }
    }
  }
  return maps;
}

// Which texels of a field may change: seen ones with a rim of one texel for bilinear look-ups, and those of
// no surface.
Image changeable(const Image& evidence, const Image& covered) {
  Image out(evidence.width, evidence.height, 1);
  for (int y = 0; y < out.height; ++y)
    for (int x = 0; x < out.width; ++x) {
      bool allowed = *covered.at(x, y) <= 0.0f;
      for (int dy = -1; dy <= 1 && !allowed; ++dy)
        for (int dx = -1; dx <= 1 && !allowed; ++dx) {
          const int nx = std::clamp(x + dx, 0, out.width - 1), ny = std::clamp(y + dy, 0, out.height - 1);
          allowed = *evidence.at(nx, ny) > 0.0f;
        }
      *out.at(x, y) = allowed ? 1.0f : 0.0f;
    }
  return out;
}

std::vector<FittedMap> make_fitted_maps(const render::Scene& scene, const views::ViewSet& views,
                                        std::span<const CachePixel> pixels, const FitOptions& options) {
  const std::vector<SeenPoint> seen = trace_seen_points(scene, views, pixels);
  std::vector<FittedMap> fitted;
  for (int m = 0; m < scene.num_asset_materials(); ++m) {
    if (!is_chosen(options, m)) continue;
    for (const FitSlot& row : kFitSlots) {
      const asset::MapSlot slot = row.slot;
      if (!has(options.maps, slot)) continue;
      const asset::Map& map = slot_map(scene.materials()[static_cast<size_t>(m)], slot);
      const float across = texels_per_pixel(scene, views, pixels, map, m);
      if (!(across > 0.0f)) continue;  // not seen, or without UVs
      // The finest level has between one and two texels a pixel, or the map's own if that is coarser.
      const int drop = std::max(0, static_cast<int>(std::floor(std::log2(across))));
      const int width = std::max(1, map.texels.width >> drop),
                height = std::max(1, map.texels.height >> drop);
      FittedMap entry;
      entry.material = m;
      entry.slot = slot;
      entry.texels_per_pixel = across;
      entry.field = make_field(map, width, height, row.unknowns);
      entry.evidence = evidence_of(map, width, height, slot, m, seen);
      entry.may_change = changeable(entry.evidence, surface_texels(scene, map, width, height, m).covered);
      fitted.push_back(std::move(entry));
    }
  }
  return fitted;
}

int finest_level(const FitState& state, const FittedMap& map, int iterations) {
  const int stage = kStages * state.next_iteration / std::max(1, iterations);
  return std::min(std::max(0, kCoarseLevels - stage), static_cast<int>(map.field.levels.size()) - 1);
}

// A cosine from full speed down to a fiftieth: the last iterations average the noise out.
float learning_rate(const FitOptions& options, int iteration) {
  const float t = static_cast<float>(iteration) / static_cast<float>(std::max(1, options.iterations));
  return options.learning_rate * (0.02f + 0.98f * (0.5f + 0.5f * std::cos(kPi * t)));
}

void add_prior(const FittedMap& map, std::vector<Image>& gradients) {
  const Prior& prior = fit_slot(map.slot).prior;
  float detail = prior.detail;
  for (size_t level = 0; level < gradients.size(); ++level, detail *= 0.25f) {
    const std::vector<float>& values = map.field.levels[level].pixels;
    std::vector<float>& gradient = gradients[level].pixels;
    parallel_for(0, static_cast<int64_t>(values.size()), 1 << 15, [&](int64_t begin, int64_t end) {
      for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i)
        gradient[i] += detail * values[i] / std::sqrt(1.0f + square(values[i] / prior.knee));
    });
  }
}

void step(FitState& state, std::vector<Image>& d_delta, const FitOptions& options) {
  // Without the maps that should come first nothing is worth waiting for.
  const float progress =
      static_cast<float>(state.next_iteration) / static_cast<float>(std::max(1, options.iterations));
  float first_start = 1.0f;
  for (const FittedMap& map : state.fitted) first_start = std::min(first_start, fit_slot(map.slot).start);
  for (size_t f = 0; f < state.fitted.size(); ++f) {
    FittedMap& map = state.fitted[f];
    if (progress + first_start < fit_slot(map.slot).start) continue;
    Image& gradient = d_delta[f];
    const float change = fit_slot(map.slot).prior.change;
    for (size_t i = 0; i < gradient.pixels.size(); ++i)
      gradient.pixels[i] += change * map.field.delta.texels.pixels[i];
    std::vector<Image> gradients = restrict_to_levels(map.field, gradient);
    add_prior(map, gradients);
    AdamOptions adam;
    // Levels add up: with all of them in step, a texel moves at twice the rate that was asked for.
    adam.learning_rate = fit_slot(map.slot).rate * 2.0f * learning_rate(options, state.next_iteration) /
                         static_cast<float>(gradients.size());
    adam_step(map.field, gradients, finest_level(state, map, options.iterations), adam);
  }
}

// Radiance of every pixel in all caches but one.
std::vector<std::span<const vec3>> all_but(const std::vector<std::vector<vec3>>& radiance, size_t left_out) {
  std::vector<std::span<const vec3>> others;
  for (size_t k = 0; k < radiance.size(); ++k)
    if (k != left_out) others.push_back(radiance[k]);
  return others;
}

bool is_aligned_at(int iteration, int iterations) {
  for (const int hundredths : kAlignments)
    if (iteration == (iterations * hundredths + 99) / 100) return true;
  return false;
}

// The views, sRGB, as the caches showed them when they were last looked at: their pixels' mean radiance.
std::vector<Image> rendered_views(const FitState& state, std::span<const CachePixel> pixels,
                                  std::span<const Image> edited, float gain) {
  std::vector<Image> rendered;
  for (const Image& view : edited) rendered.emplace_back(view.width, view.height, 3);
  for (size_t i = 0; i < pixels.size(); ++i) {
    vec3 radiance(0.0f);
    for (const auto& of_cache : state.cache_radiance)
      radiance += of_cache[i] / static_cast<float>(state.cache_radiance.size());
    vec3 shown;
    for (int c = 0; c < 3; ++c) shown[c] = srgb_from_linear(reinhard(gain * radiance[c]));
    rendered[pixels[i].view].set_rgb(pixels[i].x, pixels[i].y, shown);
  }
  return rendered;
}

// Moves every view toward what the caches show of it.
void align(FitState& state, std::span<const CachePixel> pixels, std::span<const Image> edited,
           std::span<const Image> weights, float gain) {
  const std::vector<Image> rendered = rendered_views(state, pixels, edited, gain);
  parallel_for(0, static_cast<int64_t>(edited.size()), 1, [&](int64_t begin, int64_t end) {
    for (auto v = static_cast<size_t>(begin); v < static_cast<size_t>(end); ++v)
      state.displacements[v] =
          estimate_displacement(rendered[v], edited[v], weights[v], state.displacements[v]);
  });
}

// Gives the pixels the colours of the views where they now lie.
void retarget(std::vector<CachePixel>& pixels, std::span<const Image> edited,
              std::span<const Image> displacements) {
  std::vector<Image> targets(edited.size());
  parallel_for(0, static_cast<int64_t>(edited.size()), 1, [&](int64_t begin, int64_t end) {
    for (auto v = static_cast<size_t>(begin); v < static_cast<size_t>(end); ++v)
      targets[v] = loss_target(displaced(edited[v], displacements[v]));
  });
  for (CachePixel& pixel : pixels) pixel.target = targets[pixel.view].rgb(pixel.x, pixel.y);
}

float psnr_of(const LightCache& cache, std::span<const vec3> radiance, float gain) {
  double error = 0;
  for (size_t i = 0; i < radiance.size(); ++i) {
    const CachePixel& pixel = cache.pixels[i];
    for (int c = 0; c < 3; ++c) {
      const double difference =
          srgb_from_linear(reinhard(gain * radiance[i][c])) - srgb_from_linear(pixel.target[c]);
      error += difference * difference;
    }
  }
  const double mean = error / std::max<double>(1.0, 3.0 * static_cast<double>(radiance.size()));
  return static_cast<float>(mean > 0 ? -10.0 * std::log10(mean) : 100.0);
}

// Lets the change of the maps that do so go on over texels that no view saw.
void fill_unseen(const render::Scene& scene, FitState& state) {
  for (FittedMap& map : state.fitted) {
    if (!fit_slot(map.slot).fills_unseen) continue;
    Image& delta = map.field.delta.texels;
    const SurfaceTexels surface =
        surface_texels(scene, map.field.delta, delta.width, delta.height, map.material);
    delta = spread_to_unseen(delta, map.evidence, surface);
    for (size_t i = 0; i < surface.p_world.size(); ++i)
      if (surface.covered.pixels[i] > 0.0f) map.evidence.pixels[i] = map.may_change.pixels[i] = 1.0f;
  }
}

// What the fitted maps have become, with all that is known of them but the PSNR. The end of `state`.
FitResult result_of(const render::Scene& scene, FitState& state, const std::vector<asset::MaterialMaps>& base,
                    const FitOptions& options) {
  FitResult result;
  result.loss = std::move(state.loss);
  result.changed.resize(base.size());
  result.evidence.resize(base.size());
  for (size_t m = 0; m < base.size(); ++m) {
    const Image& texels = base[m].base_color.texels;
    result.evidence[m] = Image(texels.width, texels.height, 1);
  }
  for (const FittedMap& map : state.fitted) {
    const auto m = static_cast<size_t>(map.material);
    result.changed[m].set(index_of(map.slot));
    if (map.slot != asset::MapSlot::kBaseColor) continue;
    result.density.push_back(
        {map.material, result.evidence[m].width, result.evidence[m].height, map.texels_per_pixel});
    asset::Map evidence = map.field.delta;
    evidence.texels = map.evidence;
    result.evidence[m] = asset::resized(evidence, result.evidence[m].width, result.evidence[m].height).texels;
  }
  if (options.fill_unseen) fill_unseen(scene, state);
  result.maps = apply_changes(base, state.fitted, Padding::kIslands);
  return result;
}

double seconds_since(Clock::time_point time) {
  return std::chrono::duration<double>(Clock::now() - time).count();
}

}  // namespace

FitResult fit_materials(render::Scene& scene, const views::ViewSet& views, std::span<const Image> edited,
                        const FitOptions& options, const FitHooks& hooks, const Progress& progress) {
  check_inputs(scene, views, edited, options);
  const float gain = std::exp2(views.exposure_ev);
  const render::BsdfModel model = scene.bsdf_model();
  const int num_materials = scene.num_asset_materials();

  // Which pixels count, and toward what.
  std::vector<bool> chosen(static_cast<size_t>(num_materials));
  for (int m = 0; m < num_materials; ++m) chosen[static_cast<size_t>(m)] = is_chosen(options, m);
  std::vector<Image> targets, weights;
  for (size_t v = 0; v < edited.size(); ++v) {
    targets.push_back(loss_target(edited[v]));
    weights.push_back(loss_weight(views.views[v].gbuffer, chosen, options.boundary_pixels));
  }
  std::vector<CachePixel> pixels = select_pixels(views, targets, weights);

  // The unknowns.
  const std::vector<asset::MaterialMaps> base = enlarged_maps(scene, views, pixels, options);
  scene.set_asset_materials(base);
  FitState state;
  state.fitted = make_fitted_maps(scene, views, pixels, options);
  const Parameters untouched = parameters_of(state.fitted);
  state.late_parameters = untouched;
  state.cache_parameters.assign(kCaches, untouched);
  state.cache_radiance.assign(kCaches, std::vector<vec3>(pixels.size(), vec3(0.0f)));
  for (const Image& view : edited) state.displacements.push_back(no_displacement(view.width, view.height));
  if (state.fitted.empty())
    progress.warn("no view shows a surface with UVs and an enhanced material: nothing was fitted");
  if (hooks.resume) {
    restore_checkpoint(state, *hooks.resume);
    retarget(pixels, edited, state.displacements);
  }

  Evaluator evaluator(state.fitted, model, gain);
  const std::vector<asset::MaterialMaps> coarse_base = shrunk(base, state.fitted);
  const auto trace = [&](LightCache& cache, int generation) {
    scene.set_asset_materials(apply_changes(coarse_base, state.fitted, Padding::kNone));
    CacheOptions cache_options;
    cache_options.light_samples = options.light_samples;
    cache_options.max_depth = options.max_depth;
    cache_options.seed = options.seed;
    cache_options.generation = static_cast<uint32_t>(generation);
    cache.pixels = pixels;
    trace_cache(cache, scene, views, base, cache_options, progress);
  };
  // Generation g lives in caches[g % kCaches]; the first kCaches are traced at the start, then one every
  // `interval` iterations.
  const int interval = std::max(1, (options.iterations + kRefreshes) / (kRefreshes + 1));
  std::array<LightCache, kCaches> caches;
  const auto renew = [&](int generation) {
    trace(caches[static_cast<size_t>(generation % kCaches)], generation);
  };
  const bool has_work = !state.fitted.empty() && state.next_iteration < options.iterations;
  if (has_work && state.next_iteration == 0) {
    for (int generation = 0; generation < kCaches; ++generation) {
      renew(generation);
      const auto at = static_cast<size_t>(generation);
      state.cache_radiance[at] = evaluator.shade_pixels(caches[at]);
    }
  } else if (has_work) {
    // Resumed: each cache was traced with the parameters of its own beginning.
    const Parameters current = parameters_of(state.fitted);
    const int newest = kCaches - 1 + (state.next_iteration - 1) / interval;
    for (int generation = newest - kCaches + 1; generation <= newest; ++generation) {
      set_parameters(state.fitted, state.cache_parameters[static_cast<size_t>(generation % kCaches)]);
      renew(generation);
    }
    set_parameters(state.fitted, current);
  }

  const auto iterate = [&] {
    const bool new_generation = state.next_iteration > 0 && state.next_iteration % interval == 0;
    auto turn = static_cast<size_t>(state.next_iteration % kCaches);
    if (new_generation) {
      // A stop that is asked for while rays are cast leaves the state as the last iteration left it.
      const int generation = kCaches - 1 + state.next_iteration / interval;
      turn = static_cast<size_t>(generation % kCaches);
      renew(generation);
      state.cache_parameters[turn] = parameters_of(state.fitted);
    }
    if (!options.keep_in_place && is_aligned_at(state.next_iteration, options.iterations)) {
      align(state, pixels, edited, weights, gain);
      retarget(pixels, edited, state.displacements);
      for (LightCache& cache : caches) cache.pixels = pixels;
    }
    state.loss.push_back(
        evaluator.evaluate(caches[turn], all_but(state.cache_radiance, turn), state.cache_radiance[turn]));
    step(state, evaluator.d_delta(), options);
    ++state.next_iteration;
    if (state.next_iteration == options.iterations * 3 / 4)
      state.late_parameters = parameters_of(state.fitted);
    progress.update("fit", state.next_iteration, options.iterations);
  };

  auto last_checkpoint = Clock::now(), last_preview = Clock::now();
  try {
    while (!state.fitted.empty() && state.next_iteration < options.iterations) {
      progress.throw_if_stopped();
      iterate();
      const bool is_last = state.next_iteration == options.iterations;
      if (hooks.on_preview && (is_last || seconds_since(last_preview) > kSecondsBetweenPreviews)) {
        hooks.on_preview({rendered_views(state, pixels, edited, gain), state.loss});
        last_preview = Clock::now();
      }
      const bool is_due = is_last || seconds_since(last_checkpoint) > kSecondsBetweenCheckpoints ||
                          (hooks.every_iterations > 0 && state.next_iteration % hooks.every_iterations == 0);
      if (hooks.on_checkpoint && is_due) {
        hooks.on_checkpoint(make_checkpoint(state));
        last_checkpoint = Clock::now();
      }
    }
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kInterrupted) {
      if (hooks.on_checkpoint) hooks.on_checkpoint(make_checkpoint(state));
      if (hooks.on_stop) hooks.on_stop(result_of(scene, state, base, options));
    }
    throw;
  }

  // A cache that no iteration saw judges the end, and the result.
  float psnr = 0;
  if (!state.fitted.empty()) {
    LightCache &cache = caches[0], &other = caches[1];
    trace(cache, kCaches + kRefreshes + 1);
    trace(other, kCaches + kRefreshes + 2);
    // Losses of different caches differ by more than the last iterations win, so all candidates meet the same
    // one.
    Parameters best;
    float best_loss = std::numeric_limits<float>::infinity();
    std::vector<vec3> radiance;
    for (const Parameters& candidate : {parameters_of(state.fitted), state.late_parameters, untouched}) {
      set_parameters(state.fitted, candidate);
      const std::vector<vec3> of_other = evaluator.shade_pixels(other);
      const float loss = evaluator.evaluate(cache, std::vector<std::span<const vec3>>{of_other}, radiance);
      if (loss < best_loss) best = candidate, best_loss = loss;
    }
    set_parameters(state.fitted, best);
    psnr = psnr_of(cache, evaluator.shade_pixels(cache), gain);
  }
  FitResult result = result_of(scene, state, base, options);
  result.psnr = psnr;
  scene.set_asset_materials(result.maps);
  return result;
}

}  // namespace patina::inverse
