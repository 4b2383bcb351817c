// patina doctor: what patina finds on this machine, and what to do about each problem.
#include <unistd.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "bundled_model.h"
#include "commands.h"
#include "patina/attention/attention.h"
#include "patina/base/error.h"
#include "patina/base/memory.h"
#include "patina/base/parallel.h"
#include "patina/base/processor.h"
#include "patina/diffusion/check_model.h"
#include "patina/diffusion/list_models.h"
#include "patina/diffusion/model.h"

namespace patina::app {
namespace {

namespace fs = std::filesystem;

// The fit of the demo, nine views of 256² with patina-mini, peaks at 0.96 GB; larger textures take more.
constexpr double kUsualMemory = 1.2e9;  // bytes
constexpr double kUsualSpace = 0.1e9;   // bytes

// Facts are printed as they are found; problems are kept for the end.
class Examination {
 public:
  static void fact(const char* topic, const std::string& text) { fmt::print("{:<11}{}\n", topic, text); }

  void problem(const char* topic, const std::string& text, const std::string& advice) {
    fact(topic, text);
    problems_.push_back(fmt::format("{}: {}. {}", topic, text, advice));
  }

  // Throws Error if there are problems, after naming them.
  void conclude() const {
    if (problems_.empty()) {
      fmt::print("\nAll is well.\n");
      return;
    }
    fmt::print("\nProblems:\n");
    for (const std::string& problem : problems_) fmt::print("  {}\n", problem);
    throw Error(ErrorCode::kDevice, "doctor",
                problems_.size() == 1 ? "there is a problem"
                                      : fmt::format("there are {} problems", problems_.size()));
  }

 private:
  std::vector<std::string> problems_;
};

std::string gigabytes(double bytes) {
  return fmt::format("{:.1f} GB", bytes * 1e-9);
}

void examine_processor(Examination& examination) {
  const int threads = num_threads();
  examination.fact("processor", fmt::format("{}, {} thread{}", printable(processor_name()), threads,
                                            threads == 1 ? "" : "s"));
  const auto best = [](attention::Element element) {
    return attention::name_of(attention::supported_isas(element).back());
  };
  examination.fact("kernels", fmt::format("{} for f32, {} for bf16", best(attention::Element::kF32),
                                          best(attention::Element::kBf16)));
}

void examine_memory(Examination& examination) {
  const auto available = static_cast<double>(available_bytes());
  const std::string text =
      fmt::format("{} available of {}", gigabytes(available), gigabytes(static_cast<double>(total_bytes())));
  if (available > 0 && available < kUsualMemory)
    examination.problem(
        "memory", text,
        fmt::format("A run with patina-mini takes about {}: close other programs, or use --low-memory "
                    "and fewer views (--views 4)",
                    gigabytes(kUsualMemory)));
  else
    examination.fact("memory", text);
}

void examine_gpu(Examination& examination) {
  std::error_code ignored;
  const bool has_card = fs::exists("/proc/driver/nvidia/version", ignored);
  if (diffusion::has_cuda())
    examination.fact("GPU", "NVIDIA; networks run there, unless --device cpu says otherwise");
  else if (has_card)
    examination.fact(
        "GPU", "NVIDIA, but not used: this patina was built without CUDA (CONTRIBUTING.md, preset cuda)");
  else
    examination.fact("GPU", "none used: everything runs on the processor");
}

// Reads all of the tensors.
void examine_model(Examination& examination, const fs::path& path) {
  const std::string name = printable(path.string(), 400);
  try {
    (void)diffusion::check_path(path);
    examination.fact("model", name + ": whole");
  } catch (const Error& e) {
    examination.problem("model",
                        fmt::format("{}: {}", printable(e.context(), 400), printable(e.message(), 1000)),
                        "Copy or unpack the model again, or give another with --model");
  }
}

void examine_bundled_model(Examination& examination) {
  if (const fs::path bundled = bundled_model(); !bundled.empty()) {
    examine_model(examination, bundled);
    return;
  }
  std::vector<std::string> places;
  for (const fs::path& place : bundled_model_places()) places.push_back(printable(place.string(), 400));
  examination.problem(
      "model", fmt::format("patina-mini is neither in {}", fmt::join(places, " nor in ")),
      "Unpack the whole package and leave its folders beside each other, or give --model DIR");
}

void examine_folder_of_models(Examination& examination, const fs::path& folder) {
  const std::string name = printable(folder.string(), 400);
  try {
    const std::vector<diffusion::ModelEntry> entries = diffusion::list_models({&folder, 1});
    examination.fact("models", fmt::format("{} in {}; `patina models` lists them", entries.size(), name));
    for (const diffusion::ModelEntry& entry : entries)
      if (!entry.refusal.empty())
        examination.problem(
            "models",
            fmt::format("{}: {}", printable(entry.path.string(), 400), printable(entry.refusal, 400)),
            "Replace the file, or leave it: patina refuses it when it is chosen");
  } catch (const Error& e) {
    examination.problem("models", fmt::format("{}: {}", name, printable(e.message(), 400)),
                        "Give a folder that is there with --model-dir");
  }
}

// Run folders are made where the output goes; patina writes nothing elsewhere.
void examine_space(Examination& examination) {
  std::error_code error;
  const fs::path here = fs::current_path(error);
  const fs::space_info space = fs::space(here, error);
  const std::string name = printable(here.string(), 400);
  if (error)
    examination.problem("folder", "the current folder cannot be read: " + error.message(),
                        "Change to another");
  else if (::access(here.c_str(), W_OK) != 0)
    examination.fact("folder", name + " cannot be written; give -o a path elsewhere");
  else if (static_cast<double>(space.available) < kUsualSpace)
    examination.problem("folder",
                        fmt::format("{} free in {}", gigabytes(static_cast<double>(space.available)), name),
                        "Make room, or give -o a path on another disk");
  else
    examination.fact("folder",
                     fmt::format("{} free in {}", gigabytes(static_cast<double>(space.available)), name));
}

}  // namespace

void add_doctor(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "doctor",
      "Say what patina finds here: processor, kernels, memory, GPU, models, room for results; and what to do "
      "about each problem. Exit code 1 if there is one.");
  auto model = std::make_shared<std::string>();
  command
      ->add_option("--model", *model, "Also check this model, as --model of `patina enhance` would take it.")
      ->type_name("DIR|FILE");
  auto folders = std::make_shared<std::vector<std::string>>();
  command->add_option("--model-dir", *folders, "Also look at the models in these folders.")
      ->type_name("DIR...");
  command->callback([=] {
    Examination examination;
    examination.fact("patina", PATINA_VERSION);
    examine_processor(examination);
    examine_memory(examination);
    examine_gpu(examination);
    examine_bundled_model(examination);
    if (!model->empty()) examine_model(examination, *model);
    for (const std::string& folder : *folders) examine_folder_of_models(examination, folder);
    examine_space(examination);
    examination.conclude();
  });
}

}  // namespace patina::app
