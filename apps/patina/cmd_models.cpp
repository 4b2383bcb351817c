// patina models, patina model check: what lies in the folders of models, and whether a file is what it should
// be.
#include <utility>

#include <fmt/format.h>

#include "bundled_model.h"
#include "commands.h"
#include "patina/base/error.h"
#include "patina/diffusion/check_model.h"
#include "patina/diffusion/list_models.h"
#include "patina/pipeline/known_words.h"

namespace patina::app {
namespace {

using diffusion::ModelEntry;

std::string kind_text(const ModelEntry& entry) {
  return entry.is_model_folder ? "diffusers model" : diffusion::name_of(entry.kind);
}

std::string size_text(uintmax_t bytes) {
  const auto size = static_cast<double>(bytes);
  return size >= 1e9 ? fmt::format("{:.2f} GB", size * 1e-9) : fmt::format("{:.1f} MB", size * 1e-6);
}

std::string note_text(const ModelEntry& entry) {
  if (!entry.refusal.empty()) return "not usable: " + printable(entry.refusal, 160);
  std::string text;
  for (const std::string& lack : entry.lacks) text += (text.empty() ? "needs a " : ", a ") + lack;
  return text;
}

void print_models(const std::vector<std::filesystem::path>& folders) {
  const std::vector<ModelEntry> entries = diffusion::list_models(folders);
  if (entries.empty()) fmt::print("No models there.\n");
  for (const ModelEntry& entry : entries) {
    fmt::print("{:<16} {:<21} {:<9} {:>9}  {}\n", kind_text(entry),
               entry.family ? diffusion::name_of(*entry.family) : "-",
               entry.precision.empty() ? "-" : entry.precision, size_text(entry.bytes),
               printable(entry.path.string(), 400));
    if (const std::string note = note_text(entry); !note.empty()) fmt::print("{:<16} {}\n", "", note);
  }
  const std::vector<std::string> missing = diffusion::what_is_missing(entries, folders);
  if (!missing.empty()) fmt::print("\nMissing:\n");
  for (const std::string& part : missing) fmt::print("  {}\n", part);
}

void print_bundled_model() {
  const std::filesystem::path model = bundled_model();
  if (model.empty())
    throw Error(ErrorCode::kNotFound, "patina-mini",
                "does not lie beside the program; name folders of models: `patina models DIR`");
  print_models({model});
  fmt::print("\nIt knows these words:\n");
  std::string line = " ";
  for (const std::string& word : pipeline::known_words(model)) {
    if (line.size() + 1 + word.size() > 78) fmt::print("{}\n", std::exchange(line, " "));
    line += " " + word;
  }
  fmt::print("{}\n", line);
}

}  // namespace

void add_models(CLI::App& program) {
  CLI::App* models = program.add_subcommand(
      "models",
      "List the models in folders: what each file is, its family, precision, size and what it needs.");
  auto folders = std::make_shared<std::vector<std::string>>();
  models
      ->add_option(
          "DIR,--model-dir", *folders,
          "Folders of models: those of ComfyUI or AUTOMATIC1111, or any other. Without one: the model "
          "that comes with patina, and the words that it knows.")
      ->type_name("");
  models->callback([=] {
    if (folders->empty())
      print_bundled_model();
    else
      print_models({folders->begin(), folders->end()});
  });

  CLI::App* model = program.add_subcommand("model", "Look at one model.");
  model->require_subcommand(1);
  CLI::App* check = model->add_subcommand(
      "check", "Say what a file or folder is, and check the name, shape, type and values of every tensor.");
  auto path = std::make_shared<std::string>();
  check->add_option("PATH", *path, "A .safetensors file or a diffusers folder.")->required()->type_name("");
  check->callback([=] { fmt::print("{}", diffusion::check_path(*path)); });
}

}  // namespace patina::app
