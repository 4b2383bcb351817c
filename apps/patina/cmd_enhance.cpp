// patina enhance ASSET --prompt TEXT -o OUT: the whole way.
#include <fmt/format.h>

#include "commands.h"
#include "console.h"
#include "options_cli.h"
#include "patina/base/error.h"
#include "patina/nn/threads.h"
#include "patina/pipeline/enhance.h"
#include "patina/pipeline/options.h"
#include "patina/pipeline/variants.h"

namespace patina::app {

void add_enhance(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "enhance",
      "Give an asset new detail: reads an asset and a prompt, writes the same asset with new textures.");
  const auto given = add_options(*command, "ASSET", "The asset: .glb, .gltf or .obj.", pipeline::kEverything);
  command->callback([=] {
    find_positional(*given);
    pipeline::Config config;
    apply_options(*given, config);
    config.inputs.asset = given->positional;
    require_prompt(config);
    if (config.output.empty())
      throw Error(ErrorCode::kUsage, "output", "say where the result goes, e.g. -o rusty.glb");
    nn::set_num_threads(config.num_threads);
    Console console(given->style());
    pipeline::RunFolder run(pipeline::run_folder_path(config));
    pipeline::enhance(config, run, console.progress());
    if (pipeline::only_edits(config)) return console.result({{"edits", pipeline::variants_page(run)}});
    console.result({{"asset", config.output}, {"report", run.file("report.html")}});
  });
}

}  // namespace patina::app
