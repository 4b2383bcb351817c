// train_mini: trains patina-mini. See mini/docs/training.md.
#include <algorithm>
#include <cstdio>

#include "adversarial_training.h"
#include "console/console_progress.h"
#include "console/numbers.h"
#include "console/program.h"
#include "decoder_data.h"
#include "denoiser_training.h"
#include "mini_data/plan.h"
#include "samples.h"
#include "sheet.h"
#include "vae_training.h"
#include "words_training.h"
#include "workers.h"

namespace {

using namespace patina;
using namespace patina::train_mini;
namespace fs = std::filesystem;

struct Arguments {
  fs::path shards, work, model, sheet;
  int64_t num_samples = 5000, num_captions = 5000, batch = 0;
  int num_rows = 6;
  RunOptions run;
  bool decoder_only = false, from_model = false, cuda = false;

  c10::Device device() const { return cuda ? c10::kCUDA : c10::kCPU; }
};

void compose_samples(const Arguments& a) {
  SampleOptions options;
  options.device = a.device();
  options.count = a.num_samples;
  options.seed = a.run.seed;
  make_samples(a.shards, a.work / "training", options, tools::console_progress());
  options.part = mini_data::Part::kHeldOut;
  options.count = a.num_samples / 20;
  make_samples(a.shards, a.work / "held_out", options, tools::console_progress());
}

void print_captions(const Arguments& a) {
  const mini_data::Dataset dataset = mini_data::read_dataset(a.shards, mini_data::Part::kTraining);
  const mini_data::Catalog catalog = mini_data::catalog_of(dataset);
  for (int64_t i = 0; i < a.num_captions; ++i)
    std::printf("%s\n", draw_plan(catalog, 0, static_cast<uint64_t>(i), {}).caption.c_str());
}

// The trainings write their state when they are stopped; whatever else is killed goes on from its files.
RunOptions begun_training(const Arguments& a) {
  stop_on_signals();
  RunOptions run = a.run;
  run.workers = default_workers(a.device());
  return run;
}

void train_the_vae(const Arguments& a) {
  VaeTraining options;
  options.run = begun_training(a);
  options.decoder_only = a.decoder_only;
  options.device = a.device();
  if (a.batch > 0) options.batch = a.batch;
  train_vae(a.work, a.model, options);
}

void train_the_decoder(const Arguments& a) {
  AdversarialTraining options;
  options.run = begun_training(a);
  options.run.warm_up_steps = 50;
  options.device = a.device();
  if (a.batch > 0) options.batch = a.batch;
  train_adversarially(a.work, a.model, options);
}

void train_the_denoiser(const Arguments& a) {
  DenoiserTraining options;
  options.run = begun_training(a);
  options.from_model = a.from_model;
  options.device = a.device();
  if (a.batch > 0) {
    options.crops = a.batch;
    options.views = std::max<int64_t>(1, a.batch / 4);
    options.grids = std::max<int64_t>(1, a.batch / 16);
  }
  train_denoiser(a.work, a.model, options);
}

// Options that several commands have.
void add_folders(CLI::App& command, Arguments& a) {
  command.add_option("WORK", a.work, "Folder of the samples and of the trainings' states")->required();
  command.add_option("MODEL", a.model, "Folder with config.json of every component; gets the weights")
      ->required();
}
void add_seed(CLI::App& command, Arguments& a) {
  command.add_option("--seed", a.run.seed, "Of all that is random")->check(tools::whole_number(0));
}
void add_device(CLI::App& command, Arguments& a) {
  command.add_flag("--cuda", a.cuda, "On the GPU");
}
void add_training(CLI::App& command, Arguments& a) {
  add_folders(command, a);
  command.add_option("--minutes", a.run.minutes, "How long")
      ->check(tools::positive_number())
      ->capture_default_str();
  command.add_option("--rate", a.run.rate, "Of learning")
      ->check(tools::positive_number())
      ->capture_default_str();
  command.add_flag("--settle", a.run.settle, "The rate falls to zero");
  add_seed(command, a);
}
void add_batch(CLI::App& command, Arguments& a) {
  command.add_option("--batch", a.batch, "Samples a step; the training's own if it is not given")
      ->check(tools::whole_number(1));
  add_device(command, a);
}

void add_data_commands(CLI::App& program, Arguments& a) {
  CLI::App& samples =
      *program.add_subcommand("samples", "Compose training samples, and a twentieth as many held out");
  samples.add_option("SHARDS", a.shards, "What make_dataset packed")->required();
  samples.add_option("WORK", a.work, "Folder that gets them")->required();
  samples.add_option("--count", a.num_samples, "Training samples")
      ->check(tools::whole_number(1))
      ->capture_default_str();
  add_seed(samples, a);
  add_device(samples, a);
  samples.callback([&a] { compose_samples(a); });

  CLI::App& captions = *program.add_subcommand("captions", "Print captions, for the tokenizer");
  captions.add_option("SHARDS", a.shards, "What make_dataset packed")->required();
  captions.add_option("--count", a.num_captions, "How many")
      ->check(tools::whole_number(1))
      ->capture_default_str();
  captions.callback([&a] { print_captions(a); });

  CLI::App& latents = *program.add_subcommand("latents", "Encode the samples with the autoencoder");
  add_folders(latents, a);
  add_device(latents, a);
  latents.callback([&a] { encode_latents(a.work, a.model, a.device()); });

  CLI::App& decoder_data = *program.add_subcommand(
      "decoder-data", "Encode samples and edit them with the model as it is, for vae-adversarial");
  add_folders(decoder_data, a);
  decoder_data.add_option("--count", a.num_samples, "Samples, at most")
      ->check(tools::whole_number(1))
      ->capture_default_str();
  add_seed(decoder_data, a);
  decoder_data.callback([&a] { make_decoder_data(a.work, a.model, a.num_samples, a.run.seed); });
}

void add_training_commands(CLI::App& program, Arguments& a) {
  CLI::App& vae = *program.add_subcommand("vae", "Train the autoencoder");
  add_training(vae, a);
  add_batch(vae, a);
  vae.add_flag("--decoder-only", a.decoder_only, "The encoder, and so the latents, stay as they are");
  vae.callback([&a] { train_the_vae(a); });

  CLI::App& decoder = *program.add_subcommand(
      "vae-adversarial", "Finish the autoencoder's decoder against a discriminator; the latents stay");
  add_training(decoder, a);
  add_batch(decoder, a);
  decoder.callback([&a] { train_the_decoder(a); });

  CLI::App& words = *program.add_subcommand(
      "words", "Teach the text encoder what words look like: a minute; refused once there is a text encoder");
  add_training(words, a);
  words.callback([&a] { train_words(a.work, a.model, begun_training(a)); });

  CLI::App& denoiser = *program.add_subcommand("denoiser", "Train text encoder, U-Net and ControlNets");
  add_training(denoiser, a);
  add_batch(denoiser, a);
  denoiser.add_flag("--from-model", a.from_model,
                    "Begin with the weights that MODEL has; with another seed than theirs, or it sees the "
                    "same noise again");
  denoiser.callback([&a] { train_the_denoiser(a); });

  CLI::App& sheet = *program.add_subcommand("sheet", "A picture of held-out objects under fixed prompts");
  add_folders(sheet, a);
  sheet.add_option("--count", a.num_rows, "Objects")->check(tools::whole_number(1))->capture_default_str();
  sheet.add_option("-o", a.sheet, "PNG to write")->required();
  sheet.callback([&a] { write_sheet(a.work, a.model, a.sheet, a.num_rows); });
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App program("Trains patina-mini (mini/docs/training.md). Every command goes on where it was stopped.",
                   "train_mini");
  program.require_subcommand(1);
  Arguments arguments;
  add_data_commands(program, arguments);
  add_training_commands(program, arguments);
  return tools::run_program(program, argc, argv);
}
