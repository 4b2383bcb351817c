// patina enhance ASSET --prompt TEXT -o OUT: the whole way.
#include <fmt/format.h>

#include "commands.h"
#include "console.h"
#include "options_cli.h"
#include "patina/base/error.h"
#include "patina/base/parallel.h"
#include "patina/pipeline/enhance.h"

namespace patina::app {

void add_enhance(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "enhance", "Give an asset new detail: asset and prompt in, the same asset with new textures out.");
  auto asset = std::make_shared<std::string>();
  command->add_option("ASSET", *asset, "The asset: .glb, .gltf or .obj.")->required()->type_name("");
  const auto given = add_options(*command, ~0u);
  command->callback([=] {
    pipeline::Config config;
    apply_options(*given, config);
    config.asset = *asset;
    require_prompt(config);
    if (config.output.empty())
      throw Error(ErrorCode::kUsage, "--output", "say where the result goes, e.g. -o rusty.glb");
    set_num_threads(config.num_threads);
    Console console(given->quiet ? Verbosity::kQuiet : Verbosity::kNormal);
    pipeline::RunFolder run(pipeline::run_folder_path(config));
    pipeline::enhance(config, run, console.progress());
    console.finish();
    console.say(
        fmt::format("asset   {}\nreport  {}", config.output.string(), run.file("report.html").string()));
  });
}

}  // namespace patina::app
