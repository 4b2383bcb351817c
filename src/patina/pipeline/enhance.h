// The way through patina: from an asset and a prompt to the same asset with new textures, whole or stage by
// stage on a run folder.
#pragma once

#include "patina/pipeline/config.h"
#include "patina/pipeline/stages.h"

namespace patina::pipeline {

/// Runs every stage that has to run and writes config.output. Throws Error; what was finished stays in the
/// run folder. Runs side by side may share a shelf of models; without one a run has its model for itself.
/// Returns the files that asset, context and model were read from.
std::vector<std::filesystem::path> enhance(Config config, RunFolder& run, const RunProgress& progress);
std::vector<std::filesystem::path> enhance(Config config, RunFolder& run, const RunProgress& progress,
                                           ModelShelf& models);

/// One stage on the run folder; those before it have run. The fit writes config.output too, if there is one.
void run_render(Config config, RunFolder& run, const RunProgress& progress);
void run_edit(Config config, RunFolder& run, const RunProgress& progress);
void run_fit(Config config, RunFolder& run, const RunProgress& progress);
void run_report(Config config, RunFolder& run, const RunProgress& progress);

/// Throws Error for settings that could only fail at the end, hours later. `config` is settled.
void check_inputs(const Config& config);
/// Throws Error for an output that cannot be written or has no known format.
void check_output(const std::filesystem::path& output);

/// Writes the asset with its fitted textures; nothing if `output` is empty.
void write_output(const Workbench& bench, const FittedMaterials& fitted, const std::filesystem::path& output);

/// config.run, or beside the output: "rusty.glb" → "rusty.patina-run". Throws Error{kUsage} if neither is
/// given.
std::filesystem::path run_folder_path(const Config& config);

/// Notes in config.json what this run was asked for: asset, version and every option. What another asset has
/// left in the folder goes.
void write_config(const Config& config, RunFolder& run);
/// Reads it back: the starting point of a later stage. Throws Error{kNotFound} if the folder holds no run.
Config read_config(const std::filesystem::path& run_folder);

}  // namespace patina::pipeline
