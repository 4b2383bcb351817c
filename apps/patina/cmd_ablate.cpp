// patina ablate ASSET --prompt TEXT -o FOLDER: what each prior adds, side by side.
#include <span>
#include <type_traits>

#include <fmt/format.h>

#include "commands.h"
#include "console.h"
#include "options_cli.h"
#include "patina/base/error.h"
#include "patina/nn/threads.h"
#include "patina/pipeline/ablate.h"
#include "patina/pipeline/options.h"
#include "point_cli.h"

namespace patina::app {
namespace {

// "0.6,1.2" and "0.6 1.2" alike.
std::vector<std::string> split_at_commas(const std::vector<std::string>& values) {
  std::vector<std::string> parts;
  for (const std::string& value : values)
    for (size_t begin = 0, end; begin <= value.size(); begin = end + 1) {
      end = std::min(value.find(',', begin), value.size());
      parts.push_back(value.substr(begin, end - begin));
    }
  return parts;
}

// Each part of the values of `name` as the pipeline's option `like` takes it, so that ranges and messages are
// the same.
template <class Member>
auto parsed(const std::string& name, const std::vector<std::string>& values, const char* like,
            Member member) {
  std::vector<std::decay_t<decltype(member(std::declval<const pipeline::Config&>()))>> out;
  const pipeline::Option& option = *pipeline::find_option(like);
  for (const std::string& part : split_at_commas(values)) {
    pipeline::Config config;
    try {
      option.set(config, pipeline::value_of_texts(option, std::span(&part, 1)));
    } catch (const Error& e) {
      throw Error(e.code(), name, e.message());
    }
    out.push_back(member(config));
  }
  return out;
}

// Options that an ablation sets itself.
const std::vector<std::string> kItsOwn{"output", "run",   "turntable", "views",
                                       "seeds",  "noise", "bias",      "bias-scaling"};

}  // namespace

void add_ablate(CLI::App& program) {
  CLI::App* command = program.add_subcommand("ablate",
                                             "Compare what each part adds to the views' consistency: "
                                             "baseline, + ControlNet tile, + noise, + attention bias.");
  struct Own {
    std::string output;
    std::vector<std::string> weights, scalings, views;
    bool no_fit = false;
  };
  const auto own = std::make_shared<Own>();
  constexpr size_t kMany = CLI::detail::expected_max_vector_size;
  command
      ->add_option("-o,--output", own->output,
                   "Folder for ablation.html, ablation.json and a run folder for each step. The same command "
                   "continues a "
                   "killed one there.")
      ->type_name("FOLDER")
      ->group("Input and output");
  command->add_option("--weights", own->weights, "Attention bias w of the last steps. [0.6,1.2,1.8,2.4]")
      ->type_name("W")
      ->expected(1, kMany)
      ->group("Comparison");
  command
      ->add_option(
          "--bias-scaling", own->scalings,
          "additive (w is added to the scaled scores), paper (divided with them by the square root of the "
          "head dimension), or both. [additive]")
      ->type_name("additive|paper")
      ->expected(1, kMany)
      ->group("Comparison");
  command
      ->add_option("--views", own->views,
                   "Number of views of all steps; further numbers add a table of time and memory of the last "
                   "step. [9]")
      ->type_name("4|9|16")
      ->expected(1, kMany)
      ->group("Comparison");
  command
      ->add_flag("--no-fit", own->no_fit,
                 "Compare only the edited views; otherwise each step is carried into textures too, which "
                 "takes longer.")
      ->group("Comparison");
  const auto point = add_point_options(*command, "Comparison");
  const auto given =
      add_options(*command, "ASSET", "The asset: .glb, .gltf or .obj.", pipeline::kEverything, kItsOwn);
  command->callback([=] {
    find_positional(*given);
    pipeline::Config config;
    apply_options(*given, config);
    config.inputs.asset = given->positional;
    require_prompt(config);
    if (own->output.empty())
      throw Error(ErrorCode::kUsage, "output", "say in which folder the comparison goes, e.g. -o ablation");
    pipeline::AblationOptions options;
    options.fit = !own->no_fit;
    options.point = point->options();
    if (!own->weights.empty())
      options.weights =
          parsed("weights", own->weights, "bias", [](const auto& c) { return c.edit.options.bias_weight; });
    if (!own->scalings.empty())
      options.scalings = parsed("bias-scaling", own->scalings, "bias-scaling",
                                [](const auto& c) { return c.edit.options.bias_scaling; });
    if (!own->views.empty())
      options.view_counts =
          parsed("views", own->views, "views", [](const auto& c) { return c.inputs.orbit.num_views; });

    nn::set_num_threads(config.num_threads);
    Console console(given->style());
    const nlohmann::json result = pipeline::ablate(config, options, own->output, console.progress());
    console.finish();
    for (const auto& step : result.at("steps")) {
      const auto& correlation = step.at("edit_correlation");
      console.say(
          fmt::format("{:<18} edit correlation {}", step.at("name").get<std::string>(),
                      correlation.is_number() ? fmt::format("{:.3f}", correlation.get<double>()) : "n/a"));
    }
    const std::filesystem::path folder = own->output;
    console.result({{"page", folder / "ablation.html"}, {"numbers", folder / "ablation.json"}});
  });
}

}  // namespace patina::app
