// Options of the run itself: files, the report, seed and processors.
#include <limits>

#include "patina/pipeline/option_groups.h"
#include "patina/pipeline/option_kinds.h"

namespace patina::pipeline {

using namespace option_kinds;

namespace {

const std::string kFiles = "Input and output", kMachineGroup = "Machine";

// An option that fills a field of Config itself.
template <class T>
Option option_of_run(const About& about, const std::string& group, unsigned parts, const Kind<T>& kind,
                     T Config::*field) {
  Option made = described(about, group, parts, kind);
  made.set = [named = made, kind, field](Config& c, const json& value) {
    const std::optional<T> decoded = kind.decode(value);
    if (!decoded) refuse(named, value);
    c.*field = *decoded;
  };
  made.get = [kind, field](const Config& c) { return kind.encode(c.*field); };
  const json usual = made.get(Config{});
  if (made.default_text.empty())
    made.default_text = usual.is_string() ? usual.get<std::string>() : usual.dump();
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

}  // namespace

std::vector<Option> input_output_options() {
  return {
      option_of_run({.name = "output",
                     .aliases = {"-o"},
                     .placeholder = "OUT.glb",
                     .help = "Where the enhanced asset goes: .glb, .gltf or .obj."},
                    kFiles, kOutput, path(), &Config::output),
      option_of_run({.name = "blend",
                     .placeholder = "X",
                     .help = "Share of the new textures in the output: 1 takes them as they are, 0 the old "
                             "ones. Another share fits nothing again."},
                    kFiles, kOutput, number(0, 1), &Config::blend),
      option_of_run({.name = "run",
                     .placeholder = "DIR",
                     .help = "Folder for everything in between. The same command continues a killed run "
                             "there.",
                     .default_text = "beside the output, OUT.patina-run"},
                    kFiles, kInputs, path(), &Config::run),
      option_of_run(
          {.name = "keep",
           .help = "Keep pictures of the run folder that were changed by hand when their stage runs again. "
                   "Without it they are replaced, and a copy stays beside them."},
          kFiles, kRender | kEdit | kFit, truth(), &Config::keep),
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
  return {seed(),
          option(
              Place<EditSettings>{kMachineGroup, &Config::edit, kEdit},
              {.name = "edit-seed",
               .placeholder = "N",
               .help = "Seed of the edit alone, where it shall not be that of --seed: another edit of the "
                       "same renders."},
              integer<uint64_t>(0, std::numeric_limits<uint64_t>::max()),
              [](auto& s) -> auto& { return s.options.seed; }),
          option_of_run(
              {.name = "seeds",
               .placeholder = "N",
               .help = "Edit the views with N seeds, from --edit-seed on, show them on one page and end "
                       "there. Then run again with the --edit-seed that you like: its edit is kept."},
              kMachineGroup, kEdit, integer(1, 64), &Config::num_seeds),
          option_of_run({.name = "threads",
                         .aliases = {"-j"},
                         .placeholder = "N",
                         .help = "Processors to use. 0 uses all."},
                        kMachineGroup, kMachine, integer(0, 1024), &Config::num_threads)};
}

}  // namespace patina::pipeline
