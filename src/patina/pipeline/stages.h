// The stages of a run. Each reads plain structs and the run folder, writes its part of the run folder and
// returns it; each is skipped when nothing it reads has changed. What a stage returns was read back from
// disk, so a resumed run sees the very same values, and pictures that an artist edited in between are taken
// as they are.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "patina/diffusion/edit.h"
#include "patina/pipeline/config.h"
#include "patina/pipeline/run_folder.h"
#include "patina/pipeline/workbench.h"

namespace patina::pipeline {

/// The rendered views as the later stages need them: G-buffers and exposure in `set` (without radiance),
/// control images beside.
struct RenderedViews {
  views::ViewSet set;
  std::vector<Image> tile;    // [H,W,3] sRGB, one a view
  std::vector<Image> normal;  // [H,W,3] in the protocol of ControlNet normalbae
};

/// Renders the views → views/tile_NN.png, views/normal_NN.png, views/radiance_NN.exr, views/cameras.json.
RenderedViews render_stage(const Workbench& bench, const Config& config, RunFolder& run,
                           const Progress& progress);

/// What the diffusion model is given beside the options: control images, noise and correspondences. Its seed
/// is config.seed. Throws Error{kUsage} if the views do not fit the model.
struct PreparedDetail {
  diffusion::EditInputs inputs;
  nlohmann::json noise_metrics;
  double noise_seconds = 0, correspond_seconds = 0;
};
PreparedDetail prepare_detail(const Workbench& bench, const RenderedViews& views, const Config& config,
                              const diffusion::Model& model, const Progress& progress);

/// Lets the diffusion model edit the views → detail/edited_NN.png. `shared_model`, if given, is loaded where
/// it is empty and needed, and stays: runs of the same model then load it once.
std::vector<Image> detail_stage(const Workbench& bench, const RenderedViews& views, const Config& config,
                                RunFolder& run, const Progress& progress,
                                std::optional<diffusion::Model>* shared_model = nullptr);

/// Carries the edit into the textures → textures/NN_<material>_<slot>.png; meanwhile preview/preview.html.
/// A fit that is stopped leaves its textures so far in preview/ and goes on from its checkpoint the next
/// time.
struct FittedMaterials {
  std::vector<asset::MaterialMaps> maps;  // one a material of the asset
  std::vector<asset::MapSet> changed;
};
FittedMaterials fit_stage(const Workbench& bench, const RenderedViews& views, std::span<const Image> edited,
                          const Config& config, RunFolder& run, const Progress& progress);

/// Measures the result and shows it → metrics.json, report.html, turntable.webp, report/rendered_NN.png.
void report_stage(const Workbench& bench, const RenderedViews& views, std::span<const Image> edited,
                  const FittedMaterials& fitted, const Config& config, RunFolder& run,
                  const Progress& progress);

/// What lies in the run folder from earlier, without running anything. Throw Error{kNotFound} that says which
/// command makes it.
RenderedViews load_views(const Workbench& bench, const RunFolder& run);
std::vector<Image> load_edited(const RenderedViews& views, const RunFolder& run);
FittedMaterials load_fitted(const Workbench& bench, const RunFolder& run);

/// What the edited views of the run folder were guided away from, for those who look; empty where nothing
/// was.
std::string negative_prompt_of(const RunFolder& run);

/// A picture of a run folder as [height,width,3]; an alpha channel that a paint program added is dropped.
/// Throws Error{kFormat} on another size.
Image read_rgb_sized(const std::filesystem::path& path, int width, int height);

/// Path of file number `index` of a stage: "views/tile_03.png".
std::string numbered(std::string_view prefix, size_t index, std::string_view extension);

}  // namespace patina::pipeline
