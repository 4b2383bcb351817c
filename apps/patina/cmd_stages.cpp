// patina render | detail | fit | report: the stages one by one on a run folder, so that pictures can be
// edited by hand in between.
#include <fmt/format.h>

#include <functional>

#include "commands.h"
#include "console.h"
#include "options_cli.h"
#include "patina/base/error.h"
#include "patina/base/parallel.h"
#include "patina/pipeline/enhance.h"
#include "patina/pipeline/options.h"

namespace patina::app {
namespace {

using StageFunction = void (*)(const pipeline::Workbench&, const pipeline::Config&, pipeline::RunFolder&,
                               const Progress&);

// Opens the run folder with the options it was made with and those given now, and runs one stage on it.
void run_stage(pipeline::Config config, const GivenOptions& given, StageFunction stage,
               std::string_view made) {
  apply_options(given, config);
  set_num_threads(config.num_threads);
  Console console(given.quiet ? Verbosity::kQuiet : Verbosity::kNormal);
  pipeline::RunFolder run(pipeline::run_folder_path(config));
  pipeline::write_config(config, run);
  const pipeline::Workbench bench = pipeline::open_workbench(config, console.progress());
  stage(bench, config, run, console.progress());
  console.finish();
  console.say(fmt::format("{}  {}", made, run.path().string()));
}

void add_stage_on_run(CLI::App& program, const std::string& name, const std::string& help, unsigned stages,
                      StageFunction stage, const std::string& made) {
  CLI::App* command = program.add_subcommand(name, help);
  auto folder = std::make_shared<std::string>();
  command->add_option("RUN", *folder, "The run folder, as `patina render` or `patina enhance` made it.")
      ->required()
      ->type_name("");
  // A preset would change the number of views, which the folder's renders have settled.
  const auto given = add_options(*command, stages, {"run", "preset"});
  command->callback([=] { run_stage(pipeline::read_config(*folder), *given, stage, made); });
}

}  // namespace

void add_render(CLI::App& program) {
  CLI::App* command =
      program.add_subcommand("render", "Stage 1: render the views of an asset into a run folder (views/).");
  auto asset = std::make_shared<std::string>();
  command->add_option("ASSET", *asset, "The asset: .glb, .gltf or .obj.")->required()->type_name("");
  const auto given = add_options(*command, pipeline::kRenderStage);
  command->callback([=] {
    pipeline::Config config;
    config.asset = *asset;
    run_stage(
        config, *given,
        [](const auto& bench, const auto& c, auto& run, const Progress& progress) {
          pipeline::render_stage(bench, c, run, progress);
        },
        "views/");
  });
}

void add_detail(CLI::App& program) {
  add_stage_on_run(
      program, "detail",
      "Stage 2: let the diffusion model edit the views of a run folder (views/ → detail/).",
      pipeline::kDetailStage,
      [](const auto& bench, const auto& c, auto& run, const Progress& progress) {
        pipeline::detail_stage(bench, pipeline::load_views(bench, run), c, run, progress);
      },
      "detail/");
}

void add_fit(CLI::App& program) {
  add_stage_on_run(
      program, "fit",
      "Stage 3: carry the edited views of a run folder into textures (detail/ → textures/, and the asset "
      "with -o).",
      pipeline::kFitStage,
      [](const auto& bench, const auto& c, auto& run, const Progress& progress) {
        const auto views = pipeline::load_views(bench, run);
        const auto fitted =
            pipeline::fit_stage(bench, views, pipeline::load_edited(views, run), c, run, progress);
        pipeline::write_output(bench, fitted, c);
      },
      "textures/");
}

void add_report(CLI::App& program) {
  add_stage_on_run(
      program, "report",
      "Stage 4: measure and show the result of a run folder (report.html, metrics.json, turntable.webp).",
      pipeline::kReportStage,
      [](const auto& bench, const auto& c, auto& run, const Progress& progress) {
        const auto views = pipeline::load_views(bench, run);
        pipeline::report_stage(bench, views, pipeline::load_edited(views, run),
                               pipeline::load_fitted(bench, run), c, run, progress);
      },
      "report.html");
}

}  // namespace patina::app
