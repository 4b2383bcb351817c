// What a whole view grid costs at Stable Diffusion 1.5's full size, with random weights: views encoded one by
// one, guided steps of the U-Net and both ControlNets under the attention bias, views decoded one by one.
// Prints JSON: seconds of each and the memory at the most.
//
//   bench_grid BIAS.safetensors [--steps 4] [--device cpu|cuda] [--dtype bf16|f16|f32]
//
// grid_table.py writes BIAS.safetensors, runs this beside its peer and makes the table. What the bias
// corresponds to says how many views there are, and of what size.
#include <chrono>
#include <cstdio>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include <ATen/ATen.h>
#include <ATen/Parallel.h>
#include <c10/core/InferenceMode.h>
#include <nlohmann/json.hpp>

#include "console/numbers.h"
#include "console/program.h"
#include "device_memory.h"
#include "make_checkpoint/configs.h"
#include "patina/base/error.h"
#include "patina/diffusion/edit_run.h"
#include "patina/diffusion/networks/vae.h"
#include "patina/diffusion/sampler.h"
#include "patina/nn/threads.h"
#include "random_weights.h"

namespace {

using namespace patina;
using diffusion::ControlNet;
using diffusion::Held;

constexpr int kSteps = 20;  // of the whole schedule, of which some are measured
constexpr float kGuidanceScale = 7.5f;
constexpr float kBiasWeight = 1.8f;  // patina's default

double seconds_of(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

std::vector<int32_t> integers(const nn::SafeTensors& file, const std::string& name) {
  const nn::TensorEntry* entry = file.find(name);
  if (!entry) throw Error(ErrorCode::kFormat, file.path().string(), "has no tensor " + name);
  const at::Tensor tensor = nn::read_tensor(file, *entry, at::kInt).contiguous();
  return {tensor.data_ptr<int>(), tensor.data_ptr<int>() + tensor.numel()};
}

int number(const nn::SafeTensors& file, const std::string& name) {
  const auto found = file.metadata().find(name);
  if (found == file.metadata().end())
    throw Error(ErrorCode::kFormat, file.path().string(), "says no " + name);
  return std::stoi(found->second);
}

/// The levels of the bias, finest first.
std::vector<attention::KeyBuckets> read_bias(const std::filesystem::path& path) {
  const nn::SafeTensors file(path);
  std::vector<attention::KeyBuckets> levels;
  for (int level = 0; file.find("keys_" + std::to_string(level)); ++level) {
    const std::string suffix = "_" + std::to_string(level);
    attention::KeyBuckets buckets;
    buckets.grid = number(file, "grid");
    buckets.view_width = buckets.view_height = number(file, "view" + suffix);
    buckets.window_radius = number(file, "radius" + suffix);
    buckets.offsets = integers(file, "offsets" + suffix);
    buckets.keys = integers(file, "keys" + suffix);
    attention::validate(buckets);
    levels.push_back(std::move(buckets));
  }
  if (levels.empty())
    throw Error(ErrorCode::kFormat, path.string(), "holds no level of a bias: keys_0 is missing");
  return levels;
}

template <class Network, class Config>
Network random_network(const Config& config, nn::Placement placement) {
  bench::RandomWeights weights;
  nn::WeightReader reader(weights, placement);
  return Network(config, reader);
}

nlohmann::json measure(const std::vector<attention::KeyBuckets>& levels, int steps, nn::Placement placement) {
  const c10::InferenceMode inference;
  at::manual_seed(1);
  const make_checkpoint::Configs configs =
      make_checkpoint::configs_of(diffusion::Family::kSd1, make_checkpoint::Size::kFull);
  const auto vae = random_network<diffusion::Vae>(configs.vae, placement);
  const auto unet = random_network<diffusion::UNet>(configs.unet, placement);
  const Held<ControlNet> tile(random_network<ControlNet>(configs.controlnet, placement)),
      normal(random_network<ControlNet>(configs.controlnet, placement));

  const int64_t width = levels.front().width(), view = levels.front().view_width,
                num_views = levels.front().grid * levels.front().grid;
  nlohmann::json result;
  const at::Tensor image = at::rand({1, 3, 8 * view, 8 * view});
  const auto encode_views = [&] {
    for (int64_t i = 0; i < num_views; ++i) vae.encode(2 * image - 1).mean.cpu();
  };
  encode_views();  // compiles, uploads and takes memory
  result["encode_seconds"] = seconds_of(encode_views);

  const nn::SelfAttentionBias bias{levels, kBiasWeight, /*scaled_with_scores=*/false};
  const at::Tensor hint_image = at::rand({1, 3, 8 * width, 8 * width});
  const diffusion::Denoiser denoiser{
      &unet,
      {{&tile, tile.use()->hint(hint_image), 1}, {&normal, normal.use()->hint(hint_image), 1}},
      {at::randn({2, 77, configs.text_encoder.hidden_size}), {}},
      kGuidanceScale,
      diffusion::guides_in_one_batch(unet.config(), width * width),
      &bias};
  diffusion::SchedulerConfig scheduler;
  scheduler.solver = diffusion::Solver::kUniPc;
  const diffusion::SchedulePlan plan = make_schedule(scheduler, kSteps);
  const at::Tensor start = at::randn({1, 4, width, width});
  diffusion::SamplerState state;
  state.latents.assign(start.data_ptr<float>(), start.data_ptr<float>() + start.numel());
  std::vector<double> at_step{0};
  const auto begin = std::chrono::steady_clock::now();
  const diffusion::SamplerCallbacks callbacks{
      {},
      [&](const diffusion::SamplerState&, const diffusion::Guided&) {
        at_step.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
      },
      1 + steps};
  sample(denoiser, plan, std::move(state), start.sizes(), callbacks);
  result["first_step_seconds"] = at_step[1];
  result["step_seconds"] = (at_step.back() - at_step[1]) / steps;

  const at::Tensor latents = at::randn({1, 4, view, view});
  const auto decode_views = [&] {
    for (int64_t i = 0; i < num_views; ++i) vae.decode(latents).cpu();
  };
  decode_views();
  result["decode_seconds"] = seconds_of(decode_views);
  result["peak_gb"] = static_cast<double>(bench::peak_bytes(placement.device)) * 1e-9;
  return result;
}

const std::map<std::string, c10::DeviceType> kDevices{{"cpu", c10::kCPU}, {"cuda", c10::kCUDA}};
const std::map<std::string, at::ScalarType> kTypes{
    {"bf16", at::kBFloat16}, {"f16", at::kHalf}, {"f32", at::kFloat}};

}  // namespace

int main(int argc, char** argv) {
  CLI::App program("What a whole view grid costs at Stable Diffusion 1.5's full size.", "bench_grid");
  std::string bias_file, device = "cpu", type = "bf16";
  int steps = 4;
  program.add_option("BIAS.safetensors", bias_file, "What grid_table.py writes")->required();
  program.add_option("--steps", steps, "Of the schedule, that are measured")
      ->check(tools::whole_number(1, kSteps - 1))
      ->capture_default_str();
  program.add_option("--device", device, "That computes")
      ->check(CLI::IsMember(kDevices))
      ->capture_default_str();
  program.add_option("--dtype", type, "Of weights and activations")
      ->check(CLI::IsMember(kTypes))
      ->capture_default_str();
  return tools::run_program(program, argc, argv, [&] {
    nn::Placement placement(kTypes.at(type));
    placement.device = kDevices.at(device);
    nn::set_num_threads(0);
    std::printf("%s\n", measure(read_bias(bias_file), steps, placement).dump(1).c_str());
  });
}
