// Targets: config files, and what lies in a run folder that came from elsewhere.
#include <fstream>

#include "bytes.h"
#include "options_cli.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/pipeline/options.h"
#include "patina/pipeline/run_folder.h"
#include "targets.h"

namespace patina::fuzz {

namespace fs = std::filesystem;

void config(std::span<const uint8_t> bytes) {
  CLI::App command;
  const auto given = app::add_options(command, "ASSET", "", pipeline::kEverything);
  given->config_file = scratch_file("x.toml", bytes).string();
  pipeline::Config made;
  app::apply_options(*given, made);
  const nlohmann::json values = pipeline::to_json(made);
  pipeline::Config again;
  pipeline::apply_json(again, values, "config.json");
  require(pipeline::to_json(again) == values, "what config.json keeps is what was set");
}

// The first byte says which file of the folder the others are.
void run_folder(std::span<const uint8_t> all) {
  Bytes bytes(all);
  const uint8_t kind = bytes.byte();
  if (kind == 'c') {
    pipeline::Config made;
    pipeline::apply_json(made, pipeline::read_json(scratch_file("config.json", bytes.rest())), "config.json");
    return;
  }
  const fs::path folder = scratch_folder() / "around" / "run";
  fs::remove_all(folder.parent_path());
  fs::create_directories(folder);
  std::ofstream(folder.parent_path() / "outside.txt") << "not of the run";
  write_file(folder / ".lock", std::string_view());
  write_file(folder / (kind == 'k' ? ".fit.checkpoint" : "stages.json"), bytes.rest());
  {
    pipeline::RunFolder run(folder);
    run.run_stage("fit", "key", {}, [&] {
      run.load_checkpoint("fit", "key");
      write_file(folder / "out.txt", std::string_view("made"));
      return pipeline::RunFolder::StageResult{.outputs = {"out.txt"}, .metrics = {}, .warnings = {}};
    });
    run.clear();
  }
  require(fs::exists(folder.parent_path() / "outside.txt"), "nothing outside of a run folder is touched");
}

}  // namespace patina::fuzz
