// The second stage: noise and correspondences from the geometry, then the diffusion model over the whole
// grid.
#include <algorithm>

#include <fmt/format.h>

#include "patina/base/clock.h"
#include "patina/base/error.h"
#include "patina/base/memory.h"
#include "patina/correspond/correspondences.h"
#include "patina/correspond/noise.h"
#include "patina/image/image_io.h"
#include "patina/pipeline/exemplars.h"
#include "patina/pipeline/part_prompts.h"
#include "patina/pipeline/stage_key.h"
#include "patina/pipeline/stages.h"
#include "patina/pipeline/variants.h"

namespace patina::pipeline {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

std::string edit_key(const Workbench& bench, const Strength& strength, const RenderedViews& views,
                     const EditSettings& settings, std::span<const Exemplar> exemplars,
                     const ResolvedModel& model) {
  StageKey key(bench, settings);
  key.add(views.tile).add(views.normal).add_strength(strength).add(model.hash());
  for (const Exemplar& exemplar : exemplars) key.add(exemplar.picture);
  return key.hash();
}

// The view whose noise is farthest from white tells whether the noise can be trusted.
json noise_metrics(const correspond::NoiseField& noise, int grid) {
  json worst = {{"mean", 0.0f}, {"variance", 1.0f}, {"autocorrelation", 0.0f}, {"ks_p", 1.0f}};
  const auto replace_if_farther = [&](const char* name, float value, float ideal) {
    if (std::abs(value - ideal) > std::abs(worst[name].get<float>() - ideal)) worst[name] = value;
  };
  for (const correspond::NoiseStatistics& view : correspond::noise_statistics(noise, grid)) {
    replace_if_farther("mean", view.mean, 0);
    replace_if_farther("variance", view.variance, 1);
    replace_if_farther("autocorrelation", view.autocorrelation_x, 0);
    replace_if_farther("autocorrelation", view.autocorrelation_y, 0);
    replace_if_farther("ks_p", view.kolmogorov_smirnov_p, 1);
  }
  return worst;
}

// Where the asset is not, nothing may change: the backdrop and the scene around it.
void restore_surroundings(Image& edited, const Image& render, const std::vector<float>& coverage) {
  for (size_t i = 0; i < coverage.size(); ++i)
    if (coverage[i] == 0) std::copy_n(&render.pixels[3 * i], 3, &edited.pixels[3 * i]);
}

// Where the strength is zero nothing may change either. Latent pixels are coarser than that: inside one, the
// edit comes in as the strength of a pixel against the largest around it, so that grey stays smooth and a
// border in the mask stays where it was painted.
void restore_masked(Image& edited, const Image& render, const Image& strength, int latent_scale) {
  const int radius = latent_scale / 2;
  const auto largest = [&](const Image& in, ivec2 axis) {
    Image out = in;
    for (int y = 0; y < in.height; ++y)
      for (int x = 0; x < in.width; ++x)
        for (int k = -radius; k <= radius; ++k) {
          const int u = std::clamp(x + k * axis.x, 0, in.width - 1),
                    v = std::clamp(y + k * axis.y, 0, in.height - 1);
          *out.at(x, y) = std::max(*out.at(x, y), *in.at(u, v));
        }
    return out;
  };
  const Image around = largest(largest(strength, {1, 0}), {0, 1});
  for (size_t i = 0; i < strength.pixels.size(); ++i) {
    const float own = strength.pixels[i];
    if (own < 0) continue;  // nothing of the asset
    if (own == around.pixels[i] && own > 0) continue;
    const float share = own > 0 ? own / around.pixels[i] : 0.0f;
    for (size_t c = 3 * i; c < 3 * i + 3; ++c)
      edited.pixels[c] = render.pixels[c] + share * (edited.pixels[c] - render.pixels[c]);
  }
}

// Strengths as a grey picture in which only exact zeros are black; what shows nothing of the asset is black
// too.
Image strength_picture(Image strength) {
  for (float& value : strength.pixels) value = value > 0 ? std::max(value, 1.0f / 255) : 0.0f;
  return strength;
}

double megabytes(int64_t bytes) {
  return static_cast<double>(bytes) / 1048576;
}

// Once a machine swaps, steps take minutes: better said before the first one. The weights are there by now.
void warn_of_memory(const diffusion::EditMemory& memory, const EditSettings& settings,
                    const RunProgress& progress) {
  const int64_t available = available_bytes();
  if (available == 0 || memory.activations <= available) return;
  progress.warn(
      fmt::format("the networks will need about {:.1f} GB beside their weights, and {:.1f} GB are free: the "
                  "machine may swap or end the run. Take fewer or smaller views{}.",
                  static_cast<double>(memory.activations) * 1e-9, static_cast<double>(available) * 1e-9,
                  settings.low_memory ? "" : ", or low memory"));
}

}  // namespace

PreparedEdit prepare_edit(const Workbench& bench, const Strength& strength, const RenderedViews& views,
                          const EditSettings& settings, const diffusion::Model& model,
                          const RunProgress& progress) {
  const int scale = model.latent_scale();
  if (bench.cameras[0].width % scale || bench.cameras[0].height % scale)
    throw Error(ErrorCode::kUsage, "resolution", fmt::format("this model needs a multiple of {}", scale));

  PreparedEdit prepared;
  auto start = Clock::now();
  std::vector<uint64_t> seeds;  // of fields of four channels
  for (int block = 0; 4 * block < model.latent_channels(); ++block)
    seeds.push_back(correspond::block_seed(settings.options.seed, block));
  const std::vector<correspond::NoiseField> noises =
      correspond::make_noises(*bench.scene, bench.cameras, scale, {.mode = settings.noise}, seeds, progress);
  prepared.noise_seconds = seconds_since(start);
  prepared.noise_metrics = noise_metrics(noises[0], views.set.grid);
  std::vector<float> noise;
  for (const correspond::NoiseField& field : noises)
    noise.insert(noise.end(), field.values.begin(), field.values.end());
  noise.resize(noise.size() / (4 * noises.size()) * static_cast<size_t>(model.latent_channels()));

  const PartPrompts parts = part_prompts(bench, strength, settings);
  prepared.options = settings.options;
  prepared.options.part_prompts = parts.prompts;
  prepared.inputs = {.grid = views.set.grid,
                     .tile_views = views.tile,
                     .normal_views = views.normal,
                     .noise = std::move(noise),
                     .bias_levels = {},
                     .strength_views = strength.views,
                     .part_views = part_views(parts, views.set)};
  if (settings.options.bias_weight != 0) {
    start = Clock::now();
    prepared.inputs.bias_levels = correspond::bias_levels(*bench.scene, bench.cameras, progress, scale);
    prepared.correspond_seconds = seconds_since(start);
  }
  return prepared;
}

std::vector<Image> edit_stage(const Workbench& bench, const Strength& strength, const RenderedViews& views,
                              const EditSettings& settings, ResolvedModel& resolved, RunFolder& run,
                              const RunProgress& progress) {
  const std::vector<Exemplar> exemplars = read_exemplars(bench, strength, settings);
  const std::string key = edit_key(bench, strength, views, settings, exemplars, resolved);
  adopt_variant(run, settings.options.seed, key);
  const std::unique_lock alone = resolved.alone();  // one edit at a time has the networks
  run.run_stage("detail", key, progress, [&] {
    const auto start = Clock::now();
    const int64_t bytes_before = resident_bytes();
    const bool loads = !resolved.is_loaded();  // else its weights are among the bytes before
    const diffusion::Model& model = resolved.loaded();
    const double load_seconds = seconds_since(start);
    PreparedEdit prepared = prepare_edit(bench, strength, views, settings, model, progress);
    prepared.inputs.exemplars = exemplar_inputs(exemplars, views.set);

    const diffusion::EditOptions& options = prepared.options;
    const diffusion::EditMemory memory = diffusion::predict_memory(
        model, views.set.grid, bench.cameras[0].width, bench.cameras[0].height, options);
    if (model.device() == diffusion::Device::kCpu) warn_of_memory(memory, settings, progress);
    diffusion::EditHooks hooks;
    hooks.on_checkpoint = [&](const diffusion::Checkpoint& c) {
      run.save_checkpoint("detail", key, c.next_step, c.bytes);
    };
    if (auto saved = run.load_checkpoint("detail", key))
      hooks.resume = diffusion::Checkpoint{.next_step = saved->step, .bytes = std::move(saved->bytes)};
    std::vector<Image> edited = diffusion::edit_views(model, prepared.inputs, options, hooks, progress);

    RunFolder::StageResult result;
    for (size_t v = 0; v < edited.size(); ++v) {
      restore_surroundings(edited[v], views.tile[v], views.set.views[v].gbuffer.coverage);
      if (!strength.views.empty())
        restore_masked(edited[v], views.tile[v], strength.views[v], model.latent_scale());
      result.outputs.push_back(numbered("detail/edited", v, ".png"));
      write_image(run.output(result.outputs.back()), edited[v]);
    }
    for (size_t v = 0; v < strength.views.size(); ++v) {
      result.outputs.push_back(numbered("detail/strength", v, ".png"));
      write_image(run.output(result.outputs.back()), strength_picture(strength.views[v]));
    }
    const std::vector<Image> parts = part_pictures(prepared.inputs.part_views, views.tile);
    for (size_t v = 0; v < parts.size(); ++v) {
      result.outputs.push_back(numbered("detail/parts", v, ".png"));
      write_image(run.output(result.outputs.back()), parts[v]);
    }
    json shown = json::array();  // what the report says of the exemplars
    for (size_t i = 0; i < prepared.inputs.exemplars.size(); ++i) {
      result.outputs.push_back(numbered("detail/exemplar", i, ".png"));
      write_image(run.output(result.outputs.back()), prepared.inputs.exemplars[i].picture);
      shown.push_back({{"file", result.outputs.back()}, {"caption", printable(settings.exemplars[i])}});
    }
    const diffusion::Guidance guidance = diffusion::guidance_of(model, options);
    const size_t latent_pixels = prepared.inputs.noise.size() / static_cast<size_t>(model.latent_channels());
    result.metrics = {
        {"noise", prepared.noise_metrics},
        {"model", model.description()},
        {"prompt", options.prompt},
        {"exemplars", shown},
        {"parts", parts_as_json(part_prompts(bench, strength, settings), bench)},
        {"guidance", {{"scale", guidance.scale}, {"negative_prompt", guidance.negative_prompt}}},
        {"latent_pixels", latent_pixels},
        {"memory_mb",
         {{"predicted", megabytes(bytes_before + (loads ? memory.weights : 0) + memory.activations)},
          {"peak", megabytes(peak_resident_bytes())}}},
        {"seconds",
         {{"load", load_seconds},
          {"noise", prepared.noise_seconds},
          {"correspond", prepared.correspond_seconds}}}};
    return result;
  });
  return load_edited(views, run);
}

std::vector<Image> load_edited(const RenderedViews& views, const RunFolder& run) {
  if (!run.stage("detail"))
    throw Error(ErrorCode::kNotFound, run.path().string(),
                "has no edited views yet; `patina detail` makes them");
  std::vector<Image> edited;
  for (size_t v = 0; v < views.tile.size(); ++v)
    edited.push_back(read_rgb_sized(run.file(numbered("detail/edited", v, ".png")), views.tile[v].width,
                                    views.tile[v].height));
  return edited;
}

Prompts prompts_of(const RunFolder& run) {
  const StageRecord* edit = run.stage("detail");
  if (!edit) return {};
  return {edit->metrics.value("prompt", std::string()),
          edit->metrics.value("/guidance/negative_prompt"_json_pointer, std::string())};
}

}  // namespace patina::pipeline
