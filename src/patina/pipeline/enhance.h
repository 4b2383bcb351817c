// The way through patina: from an asset and a prompt to the same asset with new textures.
#pragma once

#include "patina/pipeline/stages.h"

namespace patina::pipeline {

/// Runs every stage that has to run and writes config.output. Throws Error; what was finished stays in the
/// run folder.
void enhance(const Config& config, RunFolder& run, const Progress& progress);

/// Throws Error for what could only fail at the end, hours later: an output that cannot be written or has no
/// known format, a model that is missing.
void check_inputs(const Config& config);

/// Writes the asset with its fitted textures to config.output; nothing if that is empty.
void write_output(const Workbench& bench, const FittedMaterials& fitted, const Config& config);

/// config.run, or beside the output: "rusty.glb" → "rusty.patina-run". Throws Error{kUsage} if neither is
/// given.
std::filesystem::path run_folder_path(const Config& config);

/// Notes in config.json what this run was asked for: asset, version and every option.
void write_config(const Config& config, const RunFolder& run);
/// Reads it back: the starting point of `patina detail|fit|report`. Throws Error{kNotFound} if the folder
/// holds no run.
Config read_config(const std::filesystem::path& run_folder);

}  // namespace patina::pipeline
