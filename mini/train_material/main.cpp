// train_material: trains the network that estimates materials from edited views. See mini/docs/training.md.
#include <cstdio>
#include <functional>
#include <memory>

#include <ATen/ATen.h>

#include "console/console_progress.h"
#include "console/numbers.h"
#include "console/program.h"
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

struct Arguments {
  fs::path shards, work, model, sheet, autoencoder;
  int64_t num_samples = 1500, num_evaluated = 100, num_shown = 8;
  MaterialTraining training{.run = {.rate = 2e-3, .warm_up_steps = 100}};
};

std::function<at::Tensor(const at::Tensor&)> round_trip(const fs::path& folder) {
  const auto vae = std::make_shared<const diffusion::Vae>(folder, at::kFloat);
  return
      [vae](const at::Tensor& picture) { return 0.5 + 0.5 * vae->decode(vae->encode(2 * picture - 1).mean); };
}

void compose_samples(const Arguments& a) {
  RecordOptions options;
  if (!a.autoencoder.empty()) options.through_autoencoder = round_trip(a.autoencoder);
  options.seed = a.training.run.seed;
  options.part = mini_data::Part::kHeldOut;
  options.count = a.num_samples / 10;
  make_records(a.shards, a.work / "held_out", options, tools::console_progress());
  options.part = mini_data::Part::kTraining;
  options.count = a.num_samples;
  make_records(a.shards, a.work / "training", options, tools::console_progress());
}

void train(Arguments a) {
  train_mini::stop_on_signals();
  a.training.run.workers = train_mini::default_workers(c10::kCPU);
  train_material::train_material(a.work, a.model, a.training);
}

void print_evaluation(const Arguments& a) {
  const Records records(a.work / "held_out");
  const prior::MaterialNetwork network = read_material_network(a.model);
  for (const bool disturb : {false, true}) {
    EvaluationOptions options;
    options.samples = a.num_evaluated, options.disturb = disturb;
    std::printf("%s\n\n%s\n", disturb ? "Disturbed as in training" : "As composed",
                table_of(evaluate(network, records, options)).c_str());
    std::fflush(stdout);
  }
}

CLI::Option* add_count(CLI::App& command, int64_t& count, const char* help) {
  return command.add_option("--count", count, help)->check(tools::whole_number(1))->capture_default_str();
}
void add_folders(CLI::App& command, Arguments& a) {
  command.add_option("WORK", a.work, "Folder of the samples and of the training's state")->required();
  command.add_option("MODEL", a.model, "Folder with config.json; gets material.safetensors")->required();
}
void add_seed(CLI::App& command, Arguments& a) {
  command.add_option("--seed", a.training.run.seed, "Of all that is random")->check(tools::whole_number(0));
}

void add_samples(CLI::App& program, Arguments& a) {
  CLI::App& command =
      *program.add_subcommand("samples", "Compose training samples, and a tenth as many held out");
  command.add_option("SHARDS", a.shards, "What make_dataset packed")->required();
  command.add_option("WORK", a.work, "Folder that gets them")->required();
  add_count(command, a.num_samples, "Training samples");
  command.add_option("--autoencoder", a.autoencoder,
                     "Folder of a VAE, through which every third edited picture passes");
  add_seed(command, a);
  command.callback([&a] { compose_samples(a); });
}

void add_train(CLI::App& program, Arguments& a) {
  CLI::App& command = *program.add_subcommand("train", "Train");
  add_folders(command, a);
  train_mini::RunOptions& run = a.training.run;
  command.add_option("--minutes", run.minutes, "How long")
      ->check(tools::positive_number())
      ->capture_default_str();
  command.add_option("--rate", run.rate, "Of learning")
      ->check(tools::positive_number())
      ->capture_default_str();
  command.add_flag("--settle", run.settle, "The rate falls to zero");
  command.add_option("--batch", a.training.batch, "Samples a step")
      ->check(tools::whole_number(1))
      ->capture_default_str();
  command.add_flag("--from-model", a.training.from_model, "Begin with the weights that MODEL has");
  add_seed(command, a);
  command.callback([&a] { train(a); });
}

void add_judges(CLI::App& program, Arguments& a) {
  CLI::App& evaluation = *program.add_subcommand(
      "evaluate", "Measure on the held-out samples, as they are and disturbed as in training");
  add_folders(evaluation, a);
  add_count(evaluation, a.num_evaluated, "Samples");
  evaluation.callback([&a] { print_evaluation(a); });

  CLI::App& sheet = *program.add_subcommand("sheet", "A picture of held-out samples and their estimates");
  add_folders(sheet, a);
  add_count(sheet, a.num_shown, "Samples");
  sheet.add_option("-o", a.sheet, "PNG to write")->required();
  sheet.callback([&a] {
    write_sheet(read_material_network(a.model), Records(a.work / "held_out"), a.num_shown, false, a.sheet);
  });
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App program(
      "Trains the network that estimates materials (mini/docs/training.md). Samples and training go on where "
      "they were stopped.",
      "train_material");
  program.require_subcommand(1);
  Arguments arguments;
  add_samples(program, arguments);
  add_train(program, arguments);
  add_judges(program, arguments);
  return tools::run_program(program, argc, argv);
}
