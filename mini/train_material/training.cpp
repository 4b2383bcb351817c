#include "training.h"

#include <cmath>
#include <cstdio>
#include <mutex>
#include <random>

#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>

#include "augment.h"
#include "evaluation.h"
#include "loss.h"
#include "patina/base/files.h"
#include "patina/nn/file_weights.h"
#include "records.h"
#include "train_mini/parameters.h"
#include "train_mini/workers.h"

namespace patina::train_material {
namespace {

namespace fs = std::filesystem;
using prior::MaterialNetwork;
using train_mini::Parameters;

constexpr double kCheckpointSeconds = 240;
constexpr double kMostGradient = 1;  // norm

MaterialNetwork network_of(Parameters& parameters, const prior::MaterialConfig& config) {
  nn::WeightReader weights(parameters, at::kFloat);
  return MaterialNetwork(config, weights);
}

prior::MaterialInputs part_of(const prior::MaterialInputs& x, int64_t begin, int64_t end) {
  const auto part = [&](const at::Tensor& t) { return t.slice(0, begin, end); };
  return {part(x.edited),    part(x.render),   part(x.normal), part(x.base_color),
          part(x.roughness), part(x.metallic), part(x.mask)};
}
Truth part_of(const Truth& x, int64_t begin, int64_t end) {
  const auto part = [&](const at::Tensor& t) { return t.slice(0, begin, end); };
  return {part(x.base_color), part(x.roughness), part(x.metallic),
          part(x.weight),     part(x.normal),    part(x.slope)};
}

}  // namespace

MaterialNetwork read_material_network(const fs::path& model) {
  const nn::SafeTensors file(model / prior::kMaterialWeightFile);
  nn::FileWeights source(file);
  nn::WeightReader weights(source, at::kFloat);
  MaterialNetwork network(prior::read_material_config(model / prior::kMaterialConfigFile), weights);
  weights.finish();
  return network;
}

void train_material(const fs::path& work, const fs::path& model, const MaterialTraining& options) {
  const Records training(work / "training"), held_out(work / "held_out");
  const prior::MaterialConfig config = prior::read_material_config(model / prior::kMaterialConfigFile);
  Parameters parameters("material", options.run.seed, at::kCPU);
  const fs::path checkpoint = work / "material.checkpoint", step_file = work / "material.step";
  parameters.read(checkpoint);
  if (options.from_model && !fs::exists(checkpoint))
    parameters.begin_with(model / prior::kMaterialWeightFile);
  train_mini::Run run(options.run, work / "material.log",
                      fs::exists(step_file) ? std::stoll(read_text_file(step_file)) : 0);
  network_of(parameters, config);
  std::printf("%.2f M parameters, %lld training samples\n",
              static_cast<double>(parameters.num_parameters()) * 1e-6,
              static_cast<long long>(training.size()));

  const auto save = [&] {
    parameters.write(checkpoint);
    write_file(step_file, std::to_string(run.step()));
    parameters.write_result(model / prior::kMaterialWeightFile);
    parameters.use_average(true);
    EvaluationOptions quick;
    quick.samples = 32, quick.reduction = 2, quick.disturb = true;
    const Evaluation e = evaluate(network_of(parameters, config), held_out, quick);
    parameters.use_average(false);
    std::printf("step %lld, held out, disturbed, at half the size:\n%s", static_cast<long long>(run.step()),
                table_of(e).c_str());
    std::fflush(stdout);
  };
  for (; !run.finished(); run.next()) {
    std::mt19937_64 random(options.run.seed + static_cast<uint64_t>(run.step()) * 0x9E3779B97F4A7C15u);
    at::manual_seed(random());
    const at::Tensor planes = disturbed(random_cuts(training, options.batch, options.side, random));
    const prior::MaterialInputs inputs = inputs_of(planes);
    const Truth truth = truth_of(planes);
    const MaterialNetwork network = network_of(parameters, config);
    std::mutex mutex;
    std::map<std::string, double> means;
    train_mini::in_shares(options.run.workers, options.batch, [&](int64_t begin, int64_t end) {
      const double share = static_cast<double>(end - begin) / static_cast<double>(options.batch);
      const Loss loss = loss_of(network(part_of(inputs, begin, end)), part_of(truth, begin, end));
      (loss.total * share).backward();
      const std::lock_guard lock(mutex);
      means["loss"] += share * loss.total.item<double>();
      for (const auto& [name, value] : loss.parts) means[name] += share * value;
    });
    const double norm = parameters.gradient_norm();
    if (norm > kMostGradient) parameters.scale_gradients(kMostGradient / norm);
    Parameters::Optimizer optimizer;
    optimizer.rate = run.rate();
    optimizer.average = 0.998;
    if (std::isfinite(norm)) parameters.step(optimizer, run.step());
    means["gradient"] = norm;
    means["samples_per_step"] = static_cast<double>(options.batch);
    run.log(means);
    if (run.due(kCheckpointSeconds)) save();
  }
  save();
}

}  // namespace patina::train_material
