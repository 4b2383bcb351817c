// patina show-attention ASSET --prompt TEXT -o FILE: what one surface point attends to.
#include <fmt/format.h>

#include "commands.h"
#include "console.h"
#include "options_cli.h"
#include "patina/base/error.h"
#include "patina/nn/threads.h"
#include "patina/pipeline/options.h"
#include "patina/pipeline/show_attention.h"
#include "point_cli.h"

namespace patina::app {
namespace {

void print_layers(const pipeline::Config& config, const GivenOptions& given) {
  Console console(given.style());
  for (const diffusion::AttentionLayer& layer : pipeline::list_attention_layers(config, console.progress()))
    fmt::print("{:<32} {} × {} latent pixels, {} heads of {}\n", diffusion::short_name(layer), layer.width,
               layer.height, layer.num_heads, layer.head_dim);
}

}  // namespace

void add_show_attention(CLI::App& program) {
  CLI::App* command = program.add_subcommand("show-attention",
                                             "Show what one surface point attends to in the U-Net, without "
                                             "and with the attention bias, over the view grid.");
  struct Own {
    std::string output, layer, step;
  };
  const auto own = std::make_shared<Own>();
  command->add_option("-o,--output", own->output, "A page with the numbers (.html) or one picture (.png).")
      ->type_name("FILE")
      ->group("Input and output");
  const auto point = add_point_options(*command, "What is shown");
  command
      ->add_option(
          "--layer", own->layer,
          "Self-attention of the U-Net, e.g. up_blocks.2.attentions.0; `--layer list` prints all and "
          "does nothing else. "
          "[the last of the finest]")
      ->type_name("NAME")
      ->group("What is shown");
  command->add_option("--step", own->step, "Which evaluation of the network, from 1. [the middle one]")
      ->type_name("K")
      ->group("What is shown");
  using namespace pipeline;
  const auto given = add_options(*command, "ASSET", "The asset: .glb, .gltf or .obj.",
                                 kInputs | kRender | kEdit | kMachine, {"material", "seeds", "exemplar"});
  command->callback([=] {
    find_positional(*given);
    pipeline::Config config;
    apply_options(*given, config);
    config.inputs.asset = given->positional;
    if (own->layer == "list") return print_layers(config, *given);
    require_prompt(config);
    if (own->output.empty())
      throw Error(ErrorCode::kUsage, "output", "say where the picture goes, e.g. -o attention.html");
    pipeline::check_attention_output(own->output);
    pipeline::AttentionOptions options;
    options.layer = own->layer;
    options.point = point->options();
    if (!own->step.empty()) options.evaluation = parse_count("step", own->step);

    const std::filesystem::path output = own->output;
    if (config.run.empty()) config.run = output.parent_path() / (output.stem().string() + ".patina-run");
    nn::set_num_threads(config.num_threads);
    Console console(given->style());
    pipeline::RunFolder run(config.run);
    const pipeline::ShownAttention shown = pipeline::show_attention(config, options, run, console.progress());
    pipeline::write_attention(shown, config, output);
    const report::AttentionFigure& figure = shown.figure;
    console.say(
        fmt::format("{}, evaluation {} of {}: {} of {} keys are biased; their share of the attention is "
                    "{:.4g} % without and "
                    "{:.4g} % with the bias",
                    diffusion::short_name(shown.captured.layer), shown.captured.evaluation,
                    shown.captured.num_evaluations, figure.biased_keys.size(), figure.with.size(),
                    100 * report::share_of(figure.without, figure.biased_keys),
                    100 * report::share_of(figure.with, figure.biased_keys)));
    console.result({{"attention", output}});
  });
}

}  // namespace patina::app
