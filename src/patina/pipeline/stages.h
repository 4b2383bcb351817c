// The stages of a run. Each reads plain structs and the run folder, writes its part of the run folder and
// returns it; each is skipped when nothing it reads has changed. What a stage returns was read back from
// disk, so a resumed run sees the very same values, and pictures that an artist edited in between are taken
// as they are.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "patina/diffusion/edit.h"
#include "patina/pipeline/resolved_model.h"
#include "patina/pipeline/run_folder.h"
#include "patina/pipeline/settings.h"
#include "patina/pipeline/workbench.h"

namespace patina::pipeline {

/// The rendered views as the later stages need them: G-buffers and exposure in `set` (without radiance),
/// control images beside.
struct RenderedViews {
  views::ViewSet set;
  std::vector<Image> tile;    // [H,W,3] sRGB, one a view
  std::vector<Image> normal;  // [H,W,3] in the protocol of ControlNet normalbae
};

/// Where and how strongly the surface may change (asset/strength_map.h). Maps and views are empty without
/// masks: fully, on all of the materials that may change.
struct Strength {
  std::vector<bool> enhanced;    // one a material of the asset: may any of its texels change
  std::vector<asset::Map> maps;  // one a material
  std::vector<Image> views;      // one a camera, [H,W,1] (views/strength_views.h)
};

/// The strength of a run without masks.
Strength unmasked(const Workbench& bench);

/// Combines the masks into strengths → masks/NN_<material>_strength.png, one grey picture a material that has
/// some. Without masks it writes nothing. Throws Error for materials that the asset does not have, pictures
/// that are no masks, and masks that leave nothing to change or nothing that a camera sees.
Strength mask_stage(const Workbench& bench, const MaskSettings& settings, RunFolder& run,
                    const RunProgress& progress);

/// Renders the views → views/tile_NN.png, views/normal_NN.png, views/radiance_NN.exr, views/cameras.json.
RenderedViews render_stage(const Workbench& bench, const RenderSettings& settings, RunFolder& run,
                           const RunProgress& progress);

/// What the diffusion model is given beside the options: control images, noise, correspondences and the words
/// of single materials; exemplars come on top (exemplars.h). Throws Error{kUsage} if the views do not fit the
/// model.
struct PreparedEdit {
  diffusion::EditInputs inputs;
  diffusion::EditOptions options;  // the settings' own, and the words of single materials
  nlohmann::json noise_metrics;
  double noise_seconds = 0, correspond_seconds = 0;
};
PreparedEdit prepare_edit(const Workbench& bench, const Strength& strength, const RenderedViews& views,
                          const EditSettings& settings, const diffusion::Model& model,
                          const RunProgress& progress);

/// Lets the diffusion model edit the views → detail/edited_NN.png; with masks also their strengths there,
/// detail/strength_NN.png, with words for single materials detail/parts_NN.png, with exemplars
/// detail/exemplar_NN.png. Loads the model where it is needed.
std::vector<Image> edit_stage(const Workbench& bench, const Strength& strength, const RenderedViews& views,
                              const EditSettings& settings, ResolvedModel& model, RunFolder& run,
                              const RunProgress& progress);

/// Carries the edit into the textures → textures/NN_<material>_<slot>.png, with those before in
/// textures/before/; meanwhile preview/preview.html.
/// A fit that is stopped leaves its textures so far in preview/ and goes on from its checkpoint the next
/// time.
struct FittedMaterials {
  std::vector<asset::MaterialMaps> maps;  // one a material of the asset
  std::vector<asset::MapSet> changed;
};
FittedMaterials fit_stage(const Workbench& bench, const Strength& strength, const RenderedViews& views,
                          std::span<const Image> edited, const FitSettings& settings, RunFolder& run,
                          const RunProgress& progress);

/// Measures the result and shows it → metrics.json, report.html, turntable.webp, report/rendered_NN.png. The
/// page also shows what config.json of the run folder says.
void report_stage(const Workbench& bench, const Strength& strength, const RenderedViews& views,
                  std::span<const Image> edited, const FittedMaterials& fitted,
                  const ReportSettings& settings, RunFolder& run, const RunProgress& progress);

/// What lies in the run folder from earlier, without running anything. Throw Error{kNotFound} that says which
/// command makes it.
RenderedViews load_views(const Workbench& bench, const RunFolder& run);
std::vector<Image> load_edited(const RenderedViews& views, const RunFolder& run);
FittedMaterials load_fitted(const Workbench& bench, const RunFolder& run);

/// The words that the edited views of the run folder were made with; empty where there are none yet.
struct Prompts {
  std::string prompt, negative_prompt;
};
Prompts prompts_of(const RunFolder& run);

/// A picture of a run folder as [height,width,3]; an alpha channel that a paint program added is dropped.
/// Throws Error{kFormat} on another size.
Image read_rgb_sized(const std::filesystem::path& path, int width, int height);

/// Path of a material's picture: "textures/00_steel_normal.png". Letters, digits, '-' and '_' of its name,
/// numbered, so that two materials never share a file.
std::string material_file(const char* folder, size_t material, const std::string& name, const char* what);

/// Path of file number `index` of a stage: "views/tile_03.png".
std::string numbered(std::string_view prefix, size_t index, std::string_view extension);

}  // namespace patina::pipeline
