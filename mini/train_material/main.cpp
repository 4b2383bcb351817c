// train_material: trains the network that estimates materials from edited views. See mini/docs/training.md.
#include <charconv>
#include <cstdio>
#include <exception>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <ATen/ATen.h>

#include "console/console_progress.h"
#include "evaluation.h"
#include "patina/diffusion/networks/vae.h"
#include "records.h"
#include "sheet.h"
#include "train_mini/workers.h"
#include "training.h"

namespace {

using namespace patina;
using namespace patina::train_material;
namespace fs = std::filesystem;

constexpr const char* kUsage =
    "usage: train_material samples SHARDS WORK [--count N] [--autoencoder VAE]\n"
    "                                              compose N samples and N/10 held out (goes on where it "
    "stopped);\n"
    "                                              every third edited picture passes through the "
    "autoencoder\n"
    "       train_material train WORK MODEL        train (goes on where it stopped)\n"
    "       train_material evaluate WORK MODEL     measure on the held-out samples, as they are and "
    "disturbed\n"
    "       train_material sheet WORK MODEL -o PNG look at held-out samples\n"
    "options: samples: --count N (1500), --seed S (0); train: --minutes M (60), --rate R (2e-3), --settle "
    "(the rate\n"
    "falls to zero), --batch N (8), --seed S (0), --from-model (begin with the weights that MODEL has); "
    "evaluate and\n"
    "sheet: --count N (100; 8). MODEL holds config.json and gets material.safetensors.\n";

struct Arguments {
  std::vector<std::string> positional;
  int64_t count = 0, batch = 0;
  train_mini::RunOptions run;
  fs::path output, autoencoder;
  bool from_model = false, good = true;
};

Arguments parsed(int argc, char** argv) {
  Arguments out;
  out.run.rate = 2e-3, out.run.warm_up_steps = 100;
  for (int i = 2; i < argc; ++i) {
    const std::string word = argv[i];
    const auto number = [&](auto& into) {
      const std::string text = i + 1 < argc ? argv[++i] : "";
      const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), into);
      if (error != std::errc() || end != text.data() + text.size() || !(into > 0)) out.good = false;
    };
    if (word == "--count")
      number(out.count);
    else if (word == "--batch")
      number(out.batch);
    else if (word == "--minutes")
      number(out.run.minutes);
    else if (word == "--seed")
      number(out.run.seed);
    else if (word == "--rate")
      number(out.run.rate);
    else if (word == "--settle")
      out.run.settle = true;
    else if (word == "--from-model")
      out.from_model = true;
    else if (word == "-o" && i + 1 < argc)
      out.output = argv[++i];
    else if (word == "--autoencoder" && i + 1 < argc)
      out.autoencoder = argv[++i];
    else if (word.rfind("-", 0) == 0)
      out.good = false;
    else
      out.positional.push_back(word);
  }
  return out;
}

std::function<at::Tensor(const at::Tensor&)> round_trip(const fs::path& folder) {
  const auto vae = std::make_shared<const diffusion::Vae>(folder, at::kFloat);
  return
      [vae](const at::Tensor& picture) { return 0.5 + 0.5 * vae->decode(vae->encode(2 * picture - 1).mean); };
}

int run(const std::string& command, Arguments arguments) {
  const std::vector<std::string>& names = arguments.positional;
  if (names.size() != 2) return 2;
  const fs::path first = names[0], second = names[1];
  const auto count = [&](int64_t usual) { return arguments.count > 0 ? arguments.count : usual; };
  if (command == "samples") {
    RecordOptions options;
    if (!arguments.autoencoder.empty()) options.through_autoencoder = round_trip(arguments.autoencoder);
    options.seed = arguments.run.seed;
    options.part = mini_data::Part::kHeldOut;
    options.count = count(1500) / 10;
    make_records(first, second / "held_out", options, tools::console_progress());
    options.part = mini_data::Part::kTraining;
    options.count = count(1500);
    make_records(first, second / "training", options, tools::console_progress());
  } else if (command == "train") {
    train_mini::stop_on_signals();
    MaterialTraining options;
    options.run = arguments.run;
    options.run.workers = train_mini::default_workers(c10::kCPU);
    options.from_model = arguments.from_model;
    if (arguments.batch > 0) options.batch = arguments.batch;
    train_material::train_material(first, second, options);
  } else if (command == "evaluate") {
    const Records records(first / "held_out");
    const prior::MaterialNetwork network = read_material_network(second);
    for (const bool disturb : {false, true}) {
      EvaluationOptions options;
      options.samples = count(100), options.disturb = disturb;
      std::printf("%s\n\n%s\n", disturb ? "Disturbed as in training" : "As composed",
                  table_of(evaluate(network, records, options)).c_str());
      std::fflush(stdout);
    }
  } else if (command == "sheet" && !arguments.output.empty()) {
    write_sheet(read_material_network(second), Records(first / "held_out"), count(8), false,
                arguments.output);
  } else {
    return 2;
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  const Arguments arguments = parsed(argc, argv);
  try {
    const int code = argc < 2 || !arguments.good ? 2 : run(argv[1], arguments);
    if (code == 2) std::fputs(kUsage, stderr);
    return code;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "train_material: %s\n", error.what());
    return 1;
  }
}
