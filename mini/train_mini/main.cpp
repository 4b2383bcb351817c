// train_mini: trains patina-mini. See mini/docs/training.md.
#include <charconv>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "console/console_progress.h"
#include "denoiser_training.h"
#include "mini_data/plan.h"
#include "patina/base/error.h"
#include "samples.h"
#include "sheet.h"
#include "vae_training.h"
#include "words_training.h"
#include "workers.h"

namespace {

using namespace patina;
using namespace patina::train_mini;
namespace fs = std::filesystem;

constexpr const char* kUsage =
    "usage: train_mini samples SHARDS WORK [--count N]        compose N training samples and N/20 held out "
    "(resumable)\n"
    "       train_mini captions SHARDS [--count N]            print captions, for the tokenizer\n"
    "       train_mini vae WORK MODEL [--decoder-only]        train the autoencoder\n"
    "       train_mini latents WORK MODEL                     encode the samples with it\n"
    "       train_mini words WORK MODEL                       teach the text encoder what words look like\n"
    "       train_mini denoiser WORK MODEL                    train text encoder, U-Net and ControlNets\n"
    "       train_mini sheet WORK MODEL [--count 6] -o PNG    look: held-out objects, fixed prompts\n"
    "options of the trainings: --minutes M (60), --rate R, --settle (the rate falls to zero); of them and "
    "of\n"
    "samples: --seed S (0); of vae and denoiser: --batch N, --cuda; of denoiser: --from-model (begin with "
    "the\n"
    "weights that MODEL has; with another seed than theirs, or it sees the same noise again)\n"
    "Each goes on where it was stopped or killed; words, which takes a minute, is refused once there is a\n"
    "text encoder. MODEL holds config.json of every component and gets the weights.\n";

constexpr int64_t kSheetRows = 6;

struct Arguments {
  std::vector<std::string> positional;
  int64_t count = 5000;
  int64_t batch = 0;
  RunOptions run;
  double rate = 0;
  fs::path output;
  bool decoder_only = false, from_model = false, cuda = false, good = true;
};

Arguments parsed(int argc, char** argv) {
  Arguments out;
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
      number(out.rate);
    else if (word == "--settle")
      out.run.settle = true;
    else if (word == "--decoder-only")
      out.decoder_only = true;
    else if (word == "--from-model")
      out.from_model = true;
    else if (word == "-o" && i + 1 < argc)
      out.output = argv[++i];
    else if (word == "--cuda")
      out.cuda = true;
    else if (word.rfind("-", 0) == 0)
      out.good = false;
    else
      out.positional.push_back(word);
  }
  return out;
}

void print_captions(const fs::path& shards, int64_t count) {
  const mini_data::Dataset dataset = mini_data::read_dataset(shards, mini_data::Part::kTraining);
  const mini_data::Catalog catalog = mini_data::catalog_of(dataset);
  for (int64_t i = 0; i < count; ++i)
    std::printf("%s\n", draw_plan(catalog, 0, static_cast<uint64_t>(i), {}).caption.c_str());
}

int run(const std::string& command, Arguments arguments) {
  const std::vector<std::string>& names = arguments.positional;
  const c10::Device device = arguments.cuda ? c10::kCUDA : c10::kCPU;
  // The trainings write their state when they are stopped; whatever else is killed goes on from its files.
  if (command == "vae" || command == "words" || command == "denoiser") stop_on_signals();
  arguments.run.workers = default_workers(device);
  if (arguments.rate > 0) arguments.run.rate = arguments.rate;
  if (command == "samples" && names.size() == 2) {
    SampleOptions options;
    options.device = device;
    options.count = arguments.count;
    options.seed = arguments.run.seed;
    make_samples(names[0], fs::path(names[1]) / "training", options, tools::console_progress());
    options.part = mini_data::Part::kHeldOut;
    options.count = arguments.count / 20;
    make_samples(names[0], fs::path(names[1]) / "held_out", options, tools::console_progress());
  } else if (command == "captions" && names.size() == 1) {
    print_captions(names[0], arguments.count);
  } else if (command == "vae" && names.size() == 2) {
    VaeTraining options;
    options.run = arguments.run;
    options.decoder_only = arguments.decoder_only;
    options.device = device;
    if (arguments.batch > 0) options.batch = arguments.batch;
    train_vae(names[0], names[1], options);
  } else if (command == "words" && names.size() == 2) {
    train_words(names[0], names[1], arguments.run);
  } else if (command == "latents" && names.size() == 2) {
    encode_latents(names[0], names[1], device);
  } else if (command == "denoiser" && names.size() == 2) {
    DenoiserTraining options;
    options.run = arguments.run;
    options.from_model = arguments.from_model;
    options.device = device;
    if (arguments.batch > 0) {
      options.crops = arguments.batch;
      options.views = std::max<int64_t>(1, arguments.batch / 4);
      options.grids = std::max<int64_t>(1, arguments.batch / 16);
    }
    train_denoiser(names[0], names[1], options);
  } else if (command == "sheet" && names.size() == 2 && !arguments.output.empty()) {
    write_sheet(names[0], names[1], arguments.output,
                static_cast<int>(std::min<int64_t>(arguments.count, kSheetRows)));
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
    std::fprintf(stderr, "train_mini: %s\n", error.what());
    return 1;
  }
}
