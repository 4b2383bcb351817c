#include "patina/pipeline/compare_runs.h"

#include <algorithm>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/image/image_io.h"
#include "patina/pipeline/enhance.h"
#include "patina/pipeline/stages.h"
#include "patina/report/comparison_page.h"

namespace patina::pipeline {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

// What a run shows, and what it began with.
struct ReadRun {
  report::ComparedRun run;
  std::string asset_hash;
  std::vector<Image> before;
};

// The pictures of a stage whose names begin with `prefix`.
std::vector<Image> pictures_of(const RunFolder& run, const StageRecord* stage, std::string_view prefix) {
  std::vector<Image> images;
  if (!stage) return images;
  for (const std::string& output : stage->outputs)
    if (output.starts_with(prefix)) images.push_back(read_image(run.file(output)));
  return images;
}

ReadRun read_run(const fs::path& folder) {
  if (!fs::exists(folder / "config.json"))
    throw Error(ErrorCode::kNotFound, folder.string(),
                "is not a run folder (it has no config.json); `patina enhance` makes one");
  const RunFolder run(folder);
  if (!run.stage("report") || !fs::exists(run.file("metrics.json")))
    throw Error(ErrorCode::kNotFound, folder.string(),
                fmt::format("has no report yet; `patina report {}` makes it", folder.string()));
  const json config = read_json(run.file("config.json"));
  const Prompts prompts = prompts_of(run);
  ReadRun read{.run = {.name = fs::absolute(folder).lexically_normal().filename().string(),
                       .asset = fs::path(config.value("asset", "")).filename().string(),
                       .prompt = prompts.prompt,
                       .negative_prompt = prompts.negative_prompt,
                       .options = config.value("options", json::object()),
                       .metrics = read_json(run.file("metrics.json")),
                       .after = pictures_of(run, run.stage("report"), "report/rendered_"),
                       .turntable = {}},
               .asset_hash = config.value("asset_hash", ""),
               .before = pictures_of(run, run.stage("render"), "views/tile_")};
  const auto& outputs = run.stage("report")->outputs;
  if (std::find(outputs.begin(), outputs.end(), "turntable.webp") != outputs.end())
    read.run.turntable = read_file(run.file("turntable.webp"));
  return read;
}

bool begin_alike(const ReadRun& a, const ReadRun& b) {
  return a.asset_hash == b.asset_hash &&
         std::equal(a.before.begin(), a.before.end(), b.before.begin(), b.before.end(),
                    [](const Image& x, const Image& y) { return x.pixels == y.pixels; });
}

}  // namespace

void compare_runs(std::span<const fs::path> runs, const fs::path& page) {
  report::ComparisonData data;
  std::vector<ReadRun> read;
  for (const fs::path& folder : runs) read.push_back(read_run(folder));
  if (std::all_of(read.begin(), read.end(), [&](const ReadRun& one) { return begin_alike(read[0], one); }))
    data.before = read[0].before;
  for (ReadRun& one : read) data.runs.push_back(std::move(one.run));
  report::write_comparison(page, data);
}

}  // namespace patina::pipeline
