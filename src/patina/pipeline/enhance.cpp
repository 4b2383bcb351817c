#include "patina/pipeline/enhance.h"

#include <unistd.h>

#include <fmt/format.h>

#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/diffusion/model.h"
#include "patina/pipeline/options.h"

namespace patina::pipeline {

namespace fs = std::filesystem;
using nlohmann::json;

void enhance(const Config& config, RunFolder& run, const Progress& progress) {
  check_inputs(config);
  write_config(config, run);
  const Workbench bench = open_workbench(config, progress);                // asset, scene, cameras
  const RenderedViews views = render_stage(bench, config, run, progress);  // → views/
  const std::vector<Image> edited = detail_stage(bench, views, config, run, progress);    // → detail/
  const FittedMaterials fitted = fit_stage(bench, views, edited, config, run, progress);  // → textures/
  write_output(bench, fitted, config);                                                    // → the asset
  report_stage(bench, views, edited, fitted, config, run, progress);                      // → report.html
}

void check_inputs(const Config& config) {
  // A U-Net halves the views three times, and each level's attention needs its own correspondences.
  if (config.detail.bias_weight != 0 && config.cameras.empty() && config.orbit.resolution % 64 != 0)
    throw Error(ErrorCode::kUsage, "--resolution",
                fmt::format("expected a multiple of 64, or any multiple of 8 with --bias 0, found {}",
                            config.orbit.resolution));
  if (config.model.model.empty())
    throw Error(
        ErrorCode::kUsage, "--model",
        "give a diffusion model: a diffusers folder or a .safetensors checkpoint of Stable Diffusion 1.x or "
        "2.x; `patina models DIR` lists those in a folder");
  diffusion::check_device(config.device, config.dtype);
  diffusion::check_model(config.model);
  if (config.output.empty()) return;
  const std::string extension = config.output.extension().string();
  if (extension != ".glb" && extension != ".gltf" && extension != ".obj")
    throw Error(ErrorCode::kUsage, "--output",
                fmt::format("expected a name that ends in .glb, .gltf or .obj, found '{}'",
                            printable(config.output.string())));
  // A file that is made and removed beside the output tells whether the output can be written.
  const fs::path probe = config.output.parent_path() / fmt::format(".patina-probe.{}", ::getpid());
  write_file(probe, std::string_view());
  std::error_code ignored;
  fs::remove(probe, ignored);
}

void write_output(const Workbench& bench, const FittedMaterials& fitted, const Config& config) {
  if (!config.output.empty()) asset::export_asset(bench.asset, fitted.maps, fitted.changed, config.output);
}

fs::path run_folder_path(const Config& config) {
  if (!config.run.empty()) return config.run;
  if (config.output.empty())
    throw Error(ErrorCode::kUsage, "", "give an output (-o OUT.glb) or a run folder (--run DIR)");
  return config.output.parent_path() / (config.output.stem().string() + ".patina-run");
}

void write_config(const Config& config, const RunFolder& run) {
  write_json(run.file("config.json"), {{"patina", PATINA_VERSION},
                                       {"asset", fs::absolute(config.asset).string()},
                                       {"options", to_json(config)}});
}

Config read_config(const fs::path& run_folder) {
  const fs::path file = run_folder / "config.json";
  if (!fs::exists(file))
    throw Error(ErrorCode::kNotFound, run_folder.string(),
                "is not a run folder (it has no config.json); `patina render ASSET --run DIR` makes one");
  const json values = read_json(file);
  Config config;
  try {
    config.asset = values.at("asset").get<std::string>();
    apply_json(config, values.at("options"), file.string());
  } catch (const json::exception& e) {
    throw Error(ErrorCode::kFormat, file.string(),
                fmt::format("is not a patina configuration: {}", e.what()));
  }
  config.run = run_folder;
  return config;
}

}  // namespace patina::pipeline
