// Options of the run itself: files, the report, seed and processors.
#include <limits>

#include "patina/pipeline/option_groups.h"
#include "patina/pipeline/option_kinds.h"

namespace patina::pipeline {

using namespace option_kinds;

namespace {

const std::string kFiles = "Input and output", kMachineGroup = "Machine";

// A path of Config itself.
Option path_of_run(const About& about, unsigned parts, std::filesystem::path Config::*field) {
  Option made = described(about, kFiles, parts, path());
  made.set = [named = made, field](Config& c, const json& value) {
    if (!value.is_string()) refuse(named, value);
    c.*field = value.get<std::string>();
  };
  made.get = [field](const Config& c) { return json((c.*field).string()); };
  return made;
}

Option seed() {
  const About about{.name = "seed",
                    .placeholder = "N",
                    .help =
                        "Seed of all random numbers. The same seed gives the same bytes on the same "
                        "machine."};
  const Kind<uint64_t> kind = integer<uint64_t>(0, std::numeric_limits<uint64_t>::max());
  const auto field = [](auto& s) -> auto& {
    return s.seed;
  };
  const auto options_field = [](auto& s) -> auto& {
    return s.options.seed;
  };
  return joined({option(Place<RenderSettings>{kMachineGroup, &Config::render, kRender}, about, kind, field),
                 option(Place<EditSettings>{kMachineGroup, &Config::edit, kEdit}, about, kind, options_field),
                 option(Place<FitSettings>{kMachineGroup, &Config::fit, kFit}, about, kind, options_field),
                 option(Place<ReportSettings>{kMachineGroup, &Config::report, kReport}, about, kind, field)});
}

Option keep() {
  Option made = described(
      About{.name = "keep",
            .help = "Keep pictures of the run folder that were changed by hand when their stage runs again. "
                    "Without it they are replaced, and a copy stays beside them.",
            .default_text = "false"},
      kFiles, kRender | kEdit | kFit, truth());
  made.set = [named = made](Config& c, const json& value) {
    if (!value.is_boolean()) refuse(named, value);
    c.keep = value.get<bool>();
  };
  made.get = [](const Config& c) { return json(c.keep); };
  return made;
}

Option threads() {
  const Kind<int> kind = integer(0, 1024);
  Option made = described(
      About{
          .name = "threads", .aliases = {"-j"}, .placeholder = "N", .help = "Processors to use. 0 uses all."},
      kMachineGroup, kMachine, kind);
  made.set = [named = made, kind](Config& c, const json& value) {
    const std::optional<int> decoded = kind.decode(value);
    if (!decoded) refuse(named, value);
    c.num_threads = *decoded;
  };
  made.get = [](const Config& c) { return json(c.num_threads); };
  made.default_text = "0";
  return made;
}

}  // namespace

std::vector<Option> input_output_options() {
  return {
      path_of_run({.name = "output",
                   .aliases = {"-o"},
                   .placeholder = "OUT.glb",
                   .help = "Where the enhanced asset goes: .glb, .gltf or .obj."},
                  kOutput, &Config::output),
      path_of_run({.name = "run",
                   .placeholder = "DIR",
                   .help = "Folder for everything in between. The same command continues a killed run "
                           "there.",
                   .default_text = "beside the output, OUT.patina-run"},
                  kInputs, &Config::run),
      keep(),
      list_option(
          Place<InputSettings>{kFiles, &Config::inputs, kInputs | kFit},
          {.name = "material",
           .placeholder = "NAME",
           .help = "Only these materials may change, by the names that `patina info` shows.",
           .default_text = "all with usable UVs"},
          text(), [](auto& s) -> auto& { return s.materials; }),
      option(
          Place<ReportSettings>{kFiles, &Config::report, kReport},
          {.name = "turntable",
           .placeholder = "FRAMES",
           .help = "Frames of the report's turntable, which shows the whole asset from 20 degrees above. 0 "
                   "leaves it out."},
          integer(0, 360), [](auto& s) -> auto& { return s.turntable_frames; }),
  };
}

std::vector<Option> machine_options() {
  return {seed(), threads()};
}

}  // namespace patina::pipeline
