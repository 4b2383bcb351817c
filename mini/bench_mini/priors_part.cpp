#include "priors_part.h"

#include <cmath>
#include <cstdio>
#include <set>

#include <fmt/format.h>

#include "patina/base/check.h"
#include "patina/pipeline/ablate.h"
#include "patina/pipeline/measures.h"

namespace patina::bench {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using pipeline::AblationOptions;
using pipeline::json_number;

constexpr const char* kMeasures[] = {"edit_correlation", "edit_psnr", "edit_sharpness", "texture_sharpness",
                                     "texture_psnr"};

json ablated(const HeldOutAsset& asset, const EditSettings& settings, const AblationOptions& options,
             const fs::path& folder) {
  pipeline::Config config = edit_config(asset, settings);
  config.edit.options.prompt = fmt::format("a rusty old {}", asset.words);
  // Half of the default's iterations: all steps alike, in less time.
  config.fit.options.iterations = 100;
  Progress progress;
  progress.on_update = [&](std::string_view task, double done, double total) {
    if (task.find("steps") == task.npos) return;
    std::printf("\r%-8s %s %.1f of %.0f   ", asset.name.c_str(), std::string(task).c_str(), done, total);
    std::fflush(stdout);
  };
  const json result = pipeline::ablate(config, options, folder / asset.name, {progress});
  std::printf("\n");
  return result.at("steps");
}

// steps[i][measure] of every asset to the mean over assets; null where none has it.
json mean_of(const std::vector<json>& assets, size_t step, const char* measure) {
  double sum = 0, count = 0;
  for (const json& steps : assets)
    if (const json& value = steps.at(step).value(measure, json()); value.is_number())
      sum += value.get<double>(), ++count;
  return json_number(sum / count);
}

}  // namespace

json measure_steps(std::span<const HeldOutAsset> assets, const EditSettings& settings,
                   const fs::path& folder) {
  AblationOptions options;
  options.noise_paper = false;
  options.weights = {edit_config(assets[0], settings).edit.options.bias_weight};
  std::vector<json> all;
  json by_asset = json::object();
  for (const HeldOutAsset& asset : assets) {
    all.push_back(ablated(asset, settings, options, folder));
    for (const json& step : all.back()) {
      json& row = by_asset[asset.name][step.at("name").get<std::string>()];
      for (const char* measure : kMeasures) row[measure] = step.value(measure, json());
    }
  }
  json out = {{"steps", json::array()}, {"assets", by_asset}};
  for (size_t i = 0; i < all[0].size(); ++i) {
    out["steps"].push_back(all[0][i].at("name"));
    for (const char* measure : kMeasures) out[measure].push_back(mean_of(all, i, measure));
  }
  return out;
}

json measure_sweep(std::span<const HeldOutAsset> assets, const EditSettings& settings,
                   std::span<const float> weights, const fs::path& folder) {
  AblationOptions options;
  options.noise_paper = false;
  options.fit = false;
  options.scalings = {diffusion::BiasScaling::kAdditive, diffusion::BiasScaling::kPaper};
  options.weights.clear();
  for (const float w : weights)
    if (w > 0) options.weights.push_back(w);
  std::vector<json> all;
  for (const HeldOutAsset& asset : assets) all.push_back(ablated(asset, settings, options, folder));

  // Steps come in this order: baseline, tile, exact noise, every w added, every w scaled.
  constexpr size_t kNoBias = 2;
  const size_t num_weights = options.weights.size();
  PATINA_CHECK_EQ(all[0].size(), kNoBias + 1 + 2 * num_weights);
  json out = {{"w", json::array({0.0})}};
  for (const float w : options.weights) out["w"].push_back(std::round(w * 1e3) / 1e3);
  for (size_t scaling = 0; scaling < 2; ++scaling)
    for (const char* measure : {"edit_correlation", "edit_psnr", "edit_sharpness"}) {
      json& curve = out[scaling == 0 ? "additive" : "paper"][measure];
      curve.push_back(mean_of(all, kNoBias, measure));
      for (size_t i = 0; i < num_weights; ++i)
        curve.push_back(mean_of(all, kNoBias + 1 + scaling * num_weights + i, measure));
    }
  out["assets"] = assets.size();
  return out;
}

}  // namespace patina::bench
