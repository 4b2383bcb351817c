// The third stage: inverse rendering carries the edit into the texture maps.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <functional>

#include "patina/asset/map_slots.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/image/image_io.h"
#include "patina/inverse/fit.h"
#include "patina/pipeline/stage_key.h"
#include "patina/pipeline/stages.h"
#include "patina/report/fit_preview.h"

namespace patina::pipeline {

using nlohmann::json;

namespace {

// Below this many texels a pixel a note says that a larger texture would hold more.
constexpr float kTooCoarse = 0.5f;

// Where the stage's outputs go, and what a fit shows before it is done: never over the outputs of a run with
// other options, to which the user may come back.
constexpr const char *kFolder = "textures", *kBeforeFolder = "textures/before", *kPreviewFolder = "preview";

// Writes every changed map where `place` puts its name in `folder`; says which files and of what (the metric
// "maps").
struct WrittenMaps {
  std::vector<std::string> files;
  json entries = json::array();
};
WrittenMaps write_maps(std::span<const asset::MaterialMaps> maps, std::span<const asset::MapSet> changed,
                       const char* folder,
                       const std::function<std::filesystem::path(const std::string&)>& place) {
  WrittenMaps written;
  for (size_t m = 0; m < maps.size(); ++m)
    for (const asset::MapSlotRow& slot : asset::kMapSlots) {
      if (!has(changed[m], slot.slot)) continue;
      const std::string file = material_file(folder, m, maps[m].name, slot.name);
      write_image(place(file), asset::picture_of(slot_map(maps[m], slot.slot).texels, slot.encoding));
      written.files.push_back(file);
      written.entries.push_back({{"material", m}, {"slot", slot.name}, {"file", file}});
    }
  return written;
}

// Files hold eight bits a channel. A texel that its file shows as the asset came is so to the last bit.
// Returns whether any texel differs.
bool restore_untouched(Image& texels, const Image& picture, const Image& before,
                       asset::MapEncoding encoding) {
  if (texels.width != before.width || texels.height != before.height) return true;
  const Image old = asset::picture_of(before, encoding);
  const auto channels = static_cast<size_t>(texels.channels);
  bool any = false;
  for (size_t i = 0; i < texels.pixels.size(); i += channels) {
    bool same = true;
    for (size_t c = i; c < i + channels; ++c)
      same &= std::abs(picture.pixels[c] * 255.0f - std::round(old.pixels[c] * 255.0f)) < 1e-3f;
    any |= !same;
    if (same) std::copy_n(&before.pixels[i], channels, &texels.pixels[i]);
  }
  return any;
}

std::string fit_key(const Workbench& bench, const Strength& strength, const RenderedViews& views,
                    std::span<const Image> edited, const FitSettings& settings) {
  return StageKey(bench, settings)
      .add_materials(strength.enhanced)
      .add_strength(strength)
      .add(views.set.exposure_ev)
      .add(views.tile)
      .add(edited)
      .hash();
}

}  // namespace

std::string material_file(const char* folder, size_t material, const std::string& name, const char* what) {
  std::string safe;
  for (const char c : name.substr(0, 40))
    safe += std::isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_' ? c : '_';
  return fmt::format("{}/{:02}_{}_{}.png", folder, material, safe, what);
}

FittedMaterials fit_stage(const Workbench& bench, const Strength& strength, const RenderedViews& views,
                          std::span<const Image> edited, const FitSettings& settings, RunFolder& run,
                          const RunProgress& progress) {
  const std::string key = fit_key(bench, strength, views, edited, settings);
  run.run_stage("fit", key, progress, [&] {
    inverse::FitHooks hooks;
    hooks.on_checkpoint = [&](const inverse::FitCheckpoint& c) {
      run.save_checkpoint("fit", key, c.next_iteration, c.bytes);
    };
    if (auto saved = run.load_checkpoint("fit", key))
      hooks.resume = inverse::FitCheckpoint{.next_iteration = saved->step, .bytes = std::move(saved->bytes)};
    hooks.on_preview = [&, prompts = prompts_of(run)](const inverse::FitPreview& preview) {
      const std::filesystem::path page = run.file(std::string(kPreviewFolder) + "/preview.html");
      report::write_fit_preview(page, {.title = bench.asset.path.filename().string(),
                                       .prompt = prompts.prompt,
                                       .negative_prompt = prompts.negative_prompt,
                                       .edited = edited,
                                       .rendered = preview.rendered,
                                       .loss = preview.loss,
                                       .iterations = settings.options.iterations});
      progress.tell_preview(page);
    };
    hooks.on_stop = [&](const inverse::FitResult& so_far) {
      (void)write_maps(so_far.maps, so_far.changed, kPreviewFolder,
                       [&](const std::string& file) { return run.file(file); });
    };
    const inverse::FitResult fitted = inverse::fit_materials(
        *bench.scene, {views.set, edited, strength.enhanced, strength.maps, views.tile}, settings.options,
        hooks, progress);

    RunFolder::StageResult result;
    const auto output = [&](const std::string& file) { return run.output(file); };
    WrittenMaps written = write_maps(fitted.maps, fitted.changed, kFolder, output);
    result.outputs = std::move(written.files);
    const WrittenMaps before = write_maps(bench.maps, fitted.changed, kBeforeFolder, output);
    result.outputs.insert(result.outputs.end(), before.files.begin(), before.files.end());
    result.metrics["maps"] = std::move(written.entries);
    result.metrics["density"] = json::array();
    for (const inverse::MapDensity& density : fitted.density) {
      const std::string& name = bench.maps[static_cast<size_t>(density.material)].name;
      result.metrics["density"].push_back({{"material", name},
                                           {"width", density.width},
                                           {"height", density.height},
                                           {"texels_per_pixel", density.texels_per_pixel}});
      if (density.texels_per_pixel < kTooCoarse)
        progress.warn(fmt::format(
            "material '{}': its texture of {} x {} texels is coarser than the views by {:.1f} times, so fine "
            "detail is lost; the texture size 'auto' makes it larger",
            printable(name), density.width, density.height, 1 / density.texels_per_pixel));
    }
    result.metrics["loss"] = fitted.loss;
    result.metrics["training_psnr"] = fitted.psnr;
    return result;
  });
  return load_fitted(bench, run);
}

FittedMaterials load_fitted(const Workbench& bench, const RunFolder& run) {
  const StageRecord* stage = run.stage("fit");
  if (!stage)
    throw Error(ErrorCode::kNotFound, run.path().string(),
                "has no fitted textures yet; `patina fit` makes them");
  FittedMaterials fitted{.maps = bench.maps, .changed = std::vector<asset::MapSet>(bench.maps.size())};
  for (const json& entry : stage->metrics.at("maps")) {
    const size_t m = entry.at("material");
    const auto slot = asset::find_map_slot(entry.at("slot").get<std::string>());
    if (m >= fitted.maps.size() || !slot)
      throw Error(ErrorCode::kFormat, run.file("stages.json").string(),
                  "the textures belong to another asset; run `patina fit` again");
    const auto path = run.file(entry.at("file").get<std::string>());
    const Image stored = read_image(path);
    const int channels = slot->channels;
    if (stored.channels < channels)
      throw Error(ErrorCode::kFormat, path.string(),
                  fmt::format("expected {} channels, found {}", channels, stored.channels));
    Image picture(stored.width, stored.height, channels);
    for (size_t i = 0; i < picture.num_pixels(); ++i)
      for (int c = 0; c < channels; ++c)
        picture.pixels[static_cast<size_t>(channels) * i + static_cast<size_t>(c)] =
            stored.pixels[static_cast<size_t>(stored.channels) * i + static_cast<size_t>(c)];
    Image& texels = slot_map(fitted.maps[m], slot->slot).texels;
    texels = asset::texels_of(picture, slot->encoding);
    const Image& before = slot_map(bench.maps[m], slot->slot).texels;
    if (restore_untouched(texels, picture, before, slot->encoding))
      fitted.changed[m].set(index_of(slot->slot));
  }
  return fitted;
}

}  // namespace patina::pipeline
