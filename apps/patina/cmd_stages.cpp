// patina render | detail | fit | report: the stages one by one on a run folder, so that pictures can be
// edited by hand in between.
#include <fmt/format.h>

#include "commands.h"
#include "console.h"
#include "options_cli.h"
#include "patina/nn/threads.h"
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

void add_stage_on_run(CLI::App& program, const char* name, const char* help, unsigned parts, Stage stage,
                      const char* made) {
  CLI::App* command = program.add_subcommand(name, help);
  // A preset would change the number of views, which the folder's renders have settled.
  const auto given =
      add_options(*command, "RUN", "The run folder, as `patina render` or `patina enhance` made it.",
                  parts | pipeline::kMachine, {"preset"});
  command->callback([=] {
    find_positional(*given);
    pipeline::Config config = pipeline::read_config(given->positional);
    apply_options(*given, config);
    run_stage(config, *given, stage, made);
  });
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
                   pipeline::kEdit, pipeline::run_edit, "detail");
}

void add_fit(CLI::App& program) {
  add_stage_on_run(program, "fit",
                   "Stage 3: carry the edited views of a run folder into textures (detail/ → textures/, and "
                   "the asset with -o).",
                   pipeline::kFit | pipeline::kOutput, pipeline::run_fit, "textures");
}

void add_report(CLI::App& program) {
  add_stage_on_run(program, "report",
                   "Stage 4: measure and show the result of a run folder (report.html, metrics.json, "
                   "turntable.webp).",
                   pipeline::kReport, pipeline::run_report, "report");
}

}  // namespace patina::app
