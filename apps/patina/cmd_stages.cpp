// patina render | detail | fit | report: the stages one by one on a run folder, so that pictures can be
// edited by hand in between.
#include <fmt/format.h>

#include "commands.h"
#include "console.h"
#include "options_cli.h"
#include "patina/base/error.h"
#include "patina/nn/threads.h"
#include "patina/pipeline/compare_runs.h"
#include "patina/pipeline/enhance.h"
#include "patina/pipeline/options.h"

namespace patina::app {
namespace {

using Stage = void (*)(pipeline::Config, pipeline::RunFolder&, const pipeline::RunProgress&);

// Runs one stage on the run folder of `config`; `made` is what it leaves there.
void run_stage(const pipeline::Config& config, const GivenOptions& given, Stage stage, const char* made) {
  nn::set_num_threads(config.num_threads);
  Console console(given.style());
  pipeline::RunFolder run(pipeline::run_folder_path(config));
  stage(config, run, console.progress());
  console.result({{made, run.path()}});
}

std::shared_ptr<GivenOptions> add_run_options(CLI::App& command, unsigned parts) {
  // A preset would change the number of views, which the folder's renders have settled.
  return add_options(command, "RUN", "The run folder, as `patina render` or `patina enhance` made it.",
                     parts | pipeline::kMachine, {"preset"});
}

void run_stage_on(GivenOptions& given, Stage stage, const char* made) {
  find_positional(given);
  pipeline::Config config = pipeline::read_config(given.positional);
  apply_options(given, config);
  run_stage(config, given, stage, made);
}

void add_stage_on_run(CLI::App& program, const char* name, const char* help, unsigned parts, Stage stage,
                      const char* made) {
  CLI::App* command = program.add_subcommand(name, help);
  const auto given = add_run_options(*command, parts);
  command->callback([=] { run_stage_on(*given, stage, made); });
}

// The run given first, if any, and those of --compare on one page.
void compare(const GivenOptions& given, const std::vector<std::string>& others, const std::string& page) {
  for (const GivenOptions::Item& item : given.items)
    if (item.cli->count() > 0)
      throw Error(ErrorCode::kUsage, item.name,
                  "has no effect with --compare, which runs nothing; leave it out");
  if (!given.config_file.empty())
    throw Error(ErrorCode::kUsage, "config",
                "has no effect with --compare, which runs nothing; leave it out");
  std::vector<std::filesystem::path> runs(others.begin(), others.end());
  if (!given.positional.empty()) runs.insert(runs.begin(), given.positional);
  if (runs.size() < 2)
    throw Error(ErrorCode::kUsage, "compare", "expected two run folders or more, found one");
  Console console(given.style());
  pipeline::compare_runs(runs, page);
  console.result({{"page", page}});
}

}  // namespace

void add_render(CLI::App& program) {
  using namespace pipeline;
  CLI::App* command =
      program.add_subcommand("render", "Stage 1: render the views of an asset into a run folder (views/).");
  const auto given = add_options(*command, "ASSET", "The asset: .glb, .gltf or .obj.",
                                 kInputs | kRender | kOutput | kMachine);
  command->callback([=] {
    find_positional(*given);
    Config config;
    apply_options(*given, config);
    config.inputs.asset = given->positional;
    app::run_stage(config, *given, run_render, "views");
  });
}

void add_detail(CLI::App& program) {
  add_stage_on_run(program, "detail",
                   "Stage 2: let the diffusion model edit the views of a run folder (views/ → detail/).",
                   pipeline::kEdit | pipeline::kMasks, pipeline::run_edit, "detail");
}

void add_fit(CLI::App& program) {
  add_stage_on_run(program, "fit",
                   "Stage 3: carry the edited views of a run folder into textures (detail/ → textures/, and "
                   "the asset with -o).",
                   pipeline::kFit | pipeline::kMasks | pipeline::kOutput, pipeline::run_fit, "textures");
}

void add_report(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "report",
      "Stage 4: measure and show the result of a run folder (report.html, metrics.json, turntable.webp), or "
      "lay several finished runs side by side.");
  struct Own {
    std::vector<std::string> runs;
    std::string page;
  };
  const auto own = std::make_shared<Own>();
  command
      ->add_option("--compare", own->runs,
                   "Lay these finished runs side by side in one page instead: prompts, options that differ, "
                   "pictures, measures.")
      ->type_name("RUN")
      ->expected(1, CLI::detail::expected_max_vector_size)
      ->group("Comparison");
  command->add_option("--page", own->page, "With --compare: where the page goes. [comparison.html]")
      ->type_name("PAGE.html")
      ->group("Comparison");
  const auto given = add_run_options(*command, pipeline::kReport);
  command->callback([=] {
    if (own->runs.empty()) {
      if (!own->page.empty())
        throw Error(ErrorCode::kUsage, "page",
                    "is for --compare; the report of one run is report.html in its folder");
      run_stage_on(*given, pipeline::run_report, "report");
    } else {
      compare(*given, own->runs, own->page.empty() ? "comparison.html" : own->page);
    }
  });
}

}  // namespace patina::app
