// What one surface point attends to in the U-Net, without and with the bias [Hadadan2025, Fig. 3].
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "patina/diffusion/attention_probe.h"
#include "patina/pipeline/config.h"
#include "patina/pipeline/pick_point.h"
#include "patina/pipeline/run_folder.h"
#include "patina/pipeline/run_progress.h"
#include "patina/report/attention_page.h"

namespace patina::pipeline {

struct AttentionOptions {
  PointOptions point = {};
  std::string layer = {};  // as find_layer takes it
  int evaluation = 0;      // of the network, from 1; 0: the middle one
};

struct ShownAttention {
  report::AttentionFigure figure;
  diffusion::CapturedAttention captured;
  std::string negative_prompt;  // what guidance went away from
  int view = 0;                 // of the query, counted from 0
  vec2 pixel{0.0f};             // where the point is seen in it
};

/// The self-attentions that can be shown, in the order in which they run. Loads the model.
std::vector<diffusion::AttentionLayer> list_attention_layers(Config config, const Progress& progress);

/// Renders the views into `run` (or takes those that are there), runs the model up to the evaluation, the
/// bias acting as configured, and takes the row of the picked point. Throws Error{kUsage} where there is no
/// such layer, view, pixel or evaluation, and where no bias acts in that layer.
ShownAttention show_attention(Config config, const AttentionOptions& options, RunFolder& run,
                              const RunProgress& progress);

/// Writes it as a page (.html) or as one picture of three panels (.png).
void write_attention(const ShownAttention& shown, const Config& config, const std::filesystem::path& path);
/// Throws Error{kUsage} for other extensions, before anything is computed.
void check_attention_output(const std::filesystem::path& path);

}  // namespace patina::pipeline
