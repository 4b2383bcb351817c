// Stable Diffusion 1.5's networks at full size with random weights: seconds, share of the machine's matrix
// peak, and where the time goes. Prints and writes JSON.
//
//   bench_unet [--out build/bench/unet.json] [--size 512] [--grid 1] [--threads N] [--f32] [--repeat 5]
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <string>

#include <ATen/ATen.h>
#include <ATen/Parallel.h>
#include <c10/core/InferenceMode.h>
#include <nlohmann/json.hpp>

#include "best_seconds.h"
#include "console/numbers.h"
#include "console/program.h"
#include "convolutions.h"
#include "make_checkpoint/configs.h"
#include "operation_times.h"
#include "patina/base/files.h"
#include "patina/base/memory.h"
#include "patina/diffusion/networks/unet.h"
#include "patina/diffusion/networks/vae.h"
#include "patina/nn/threads.h"
#include "random_weights.h"

namespace {

using namespace patina;
using bench::best_seconds;
using bench::RandomWeights;

/// GFLOP/s of LibTorch's product of two square matrices, all threads.
double matrix_peak(at::ScalarType type, int repeat) {
  constexpr int64_t kSide = 2048;
  const at::Tensor a = at::randn({kSide, kSide}).to(type), b = at::randn({kSide, kSide}).to(type);
  at::Tensor out = at::matmul(a, b);
  const double seconds = best_seconds(3 * repeat, [&] { at::matmul_out(out, a, b); });
  return 2e-9 * static_cast<double>(kSide * kSide * kSide) / seconds;
}

/// Operations of every layer with a weight, and of attention: 4 · queries · keys · channels.
class FlopCount {
 public:
  explicit FlopCount(const RandomWeights& weights) : weights_(weights) {}

  nn::Recorder recorder() {
    return nn::Recorder([this](const std::string& name, const at::Tensor& output) {
      const auto numbers = static_cast<double>(output.numel());
      flops_ += weights_.flops_an_output(name) * numbers;
      const auto ends_with = [&](const char* end) {
        return name.size() >= std::strlen(end) &&
               name.compare(name.size() - std::strlen(end), name.npos, end) == 0;
      };
      if (ends_with(".to_k")) keys_ = static_cast<double>(output.size(1));
      if (ends_with(".attn1") || ends_with(".attn2")) flops_ += 4 * numbers * keys_;
    });
  }
  double flops() const { return flops_; }

 private:
  const RandomWeights& weights_;
  double flops_ = 0, keys_ = 0;
};

struct Options {
  std::string out;
  int64_t side = 512, grid = 1;
  int repeat = 5;
  at::ScalarType type = at::kBFloat16;
};

nlohmann::json measure(const Options& options) {
  const c10::InferenceMode inference;
  at::manual_seed(1);
  const make_checkpoint::Configs configs =
      make_checkpoint::configs_of(diffusion::Family::kSd1, make_checkpoint::Size::kFull);
  nlohmann::json result;
  const double peak = matrix_peak(options.type, options.repeat);
  result["matrix_peak_gflops"] = peak;

  RandomWeights unet_weights;
  nn::WeightReader unet_reader(unet_weights, options.type);
  const diffusion::UNet unet(configs.unet, unet_reader);
  const int64_t latents = options.side / 8 * options.grid;
  const at::Tensor sample = at::randn({1, 4, latents, latents}), time = at::full({1}, 500.0f),
                   text = at::randn({1, 77, 768});
  const std::string size = std::to_string(options.side * options.grid);
  FlopCount count(unet_weights);
  const diffusion::NetworkInputs inputs{sample, time, {text, {}}};
  unet(inputs, {}, count.recorder());
  const auto evaluate = [&] { unet(inputs); };
  const double seconds = best_seconds(options.repeat, evaluate);
  result["unet_" + size + "_seconds"] = seconds;
  result["unet_gflop"] = count.flops() * 1e-9;
  result["unet_gflops"] = count.flops() * 1e-9 / seconds;
  result["fraction_of_peak"] = count.flops() * 1e-9 / seconds / peak;
  double inside = 0;
  for (const auto& [name, share] : bench::operation_seconds(evaluate)) {
    result["unet_operations"][name] = share;
    inside += share;
  }
  result["unet_operations"]["sum"] = inside;

  RandomWeights vae_weights;
  nn::WeightReader vae_reader(vae_weights, options.type);
  const diffusion::Vae vae(configs.vae, vae_reader);
  const at::Tensor view = at::randn({1, 4, options.side / 8, options.side / 8});
  const auto decode = [&] { vae.decode(view); };
  result["vae_decode_" + std::to_string(options.side) + "_seconds"] =
      best_seconds(std::max(1, options.repeat / 2), decode);
  for (const auto& [name, share] : bench::operation_seconds(decode)) result["vae_operations"][name] = share;

  result["peak_mb"] = static_cast<double>(peak_resident_bytes()) / 1048576;

  // With plain sums in place of Winograd's convolutions, as --low-memory has them.
  if (nn::winograd_pays() && options.type == at::kBFloat16) {
    const nn::Placement plain(options.type, c10::kCPU, /*low=*/true);
    nn::WeightReader plain_unet_reader(unet_weights, plain), plain_vae_reader(vae_weights, plain);
    const diffusion::UNet plain_unet(configs.unet, plain_unet_reader);
    const diffusion::Vae plain_vae(configs.vae, plain_vae_reader);
    result["unet_" + size + "_plain_seconds"] = best_seconds(options.repeat, [&] { plain_unet(inputs); });
    result["vae_decode_" + std::to_string(options.side) + "_plain_seconds"] =
        best_seconds(std::max(1, options.repeat / 2), [&] { plain_vae.decode(view); });
    result["convolutions"] = bench::measure_convolutions(options.repeat);
  }

  // Guidance evaluates two prompts: as one batch?
  const at::Tensor two_samples = sample.expand({2, -1, -1, -1}), two_texts = text.expand({2, -1, -1});
  result["unet_" + size + "_batch_of_two_seconds"] = best_seconds(std::max(1, options.repeat / 2), [&] {
    unet({two_samples, time, {two_texts, {}}});
  });
  return result;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App program("Stable Diffusion 1.5's networks at full size with random weights.", "bench_unet");
  Options options;
  int threads = 0;
  bool is_f32 = false;
  program.add_option("--size", options.side, "Pixels a side of a view")
      ->check(tools::whole_number(1))
      ->capture_default_str();
  program.add_option("--grid", options.grid, "Views a side")
      ->check(tools::whole_number(1))
      ->capture_default_str();
  program.add_option("--repeat", options.repeat, "Runs, of which the fastest counts")
      ->check(tools::whole_number(1))
      ->capture_default_str();
  program.add_option("--threads", threads, "0: all processors")
      ->check(tools::whole_number(0))
      ->capture_default_str();
  program.add_flag("--f32", is_f32, "Instead of bf16");
  program.add_option("--out", options.out, "JSON to write, which is printed as well");
  return tools::run_program(program, argc, argv, [&] {
    if (is_f32) options.type = at::kFloat;
    nn::set_num_threads(threads);
    const nlohmann::json result = measure(options);
    std::printf("%s\n", result.dump(1).c_str());
    if (!options.out.empty()) write_file(options.out, result.dump(1) + "\n");
  });
}
