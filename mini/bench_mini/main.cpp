// How good patina's own small model is, measured on held-out shapes, materials and assets: autoencoder,
// obedience to prompts, structure kept, what the priors add, seconds. What every figure means:
// mini/docs/measuring-mini.md.
//
//   bench_mini [--model DIR] [--out FILE] [--only PART ...] [--demo COMMAND]
//
// Parts are kept in the folder named like FILE and measured again only when what they read has changed, so a
// killed run goes on. FILE holds all parts that have been measured, and null for the others' figures.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "classifier.h"
#include "composer.h"
#include "console/numbers.h"
#include "console/program.h"
#include "edits_part.h"
#include "parts.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/nn/threads.h"
#include "patina/pipeline/options.h"
#include "priors_part.h"
#include "vae_part.h"

namespace {

using namespace patina;
using namespace patina::bench;
namespace fs = std::filesystem;
using nlohmann::json;

struct Arguments {
  fs::path model = "models/patina-mini", shards = "build/mini_shards", shared, repository = ".",
           out = "build/bench/mini.json";
  std::vector<std::string> only;  // empty: all parts
  std::string demo;               // command line; empty: not measured
  int views = 4, ablation_views = 9, steps = 20, num_assets = 5, threads = 0;
  float guidance_scale = diffusion::kAutoGuidanceScale, fine_detail = 1;
  std::optional<std::string> negative_prompt;
  std::vector<float> weights{0, 1.2f, 1.8f, 3};

  bool asks_for(const std::string& part) const {
    return only.empty() || std::find(only.begin(), only.end(), part) != only.end();
  }
};

const std::vector<std::string> kParts{"vae", "edits", "sweep", "ablation", "demo"};

// The settings' every value, and the assets they are for: what a part's key is made of beside the model.
std::string settings_key(const EditSettings& settings, const std::vector<HeldOutAsset>& assets) {
  std::string key;
  for (const HeldOutAsset& asset : assets)
    key += pipeline::to_json(edit_config(asset, settings)).dump() + asset.clean_prompt +
           hash_of_all(asset.path) + "\n";
  return key;
}

// Held-out shapes with held-out materials, clean and aged, and the held-out assets as rendered.
std::vector<MaskedPicture> held_out_pictures(const Arguments& arguments, const EditSettings& settings,
                                             const std::vector<HeldOutAsset>& assets, const fs::path& folder,
                                             pipeline::ResolvedModel& model) {
  constexpr uint64_t kPlans = 16, kSeed = 91;
  std::vector<MaskedPicture> out;
  const Composer composer(arguments.shards, mini_data::Part::kHeldOut, mini_data::Part::kHeldOut);
  for (uint64_t i = 0; i < kPlans; ++i) {
    const mini_data::Plan plan = mini_data::draw_plan(composer.catalog(), kSeed, i, {});
    for (Composed& view : composer.compose({&plan, 1})) {
      out.push_back({std::move(view.before), view.coverage});
      out.push_back({std::move(view.after), std::move(view.coverage)});
    }
  }
  for (const HeldOutAsset& asset : assets) {
    const AssetEditor editor(asset, settings, folder / "edits", model);
    for (size_t v = 0; v < editor.coverage().size(); ++v)
      out.push_back({editor.views().tile[v], editor.coverage()[v]});
  }
  return out;
}

json timed_demo(const std::string& command) {
  const auto start = std::chrono::steady_clock::now();
  const int status = std::system(command.c_str());
  if (status != 0)
    throw Error(ErrorCode::kUsage, "--demo", fmt::format("'{}' failed with status {}", command, status));
  return {{"seconds", std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count()},
          {"command", command}};
}

json at_or_null(const json& values, const char* pointer) {
  const json::json_pointer at(pointer);
  return values.contains(at) ? values[at] : json();
}

void run(const Arguments& arguments) {
  const fs::path folder = fs::path(arguments.out).replace_extension();
  fs::create_directories(folder);
  nn::set_num_threads(arguments.threads);
  std::vector<HeldOutAsset> assets = held_out_assets(arguments.shared, arguments.repository);
  assets.resize(std::min(assets.size(), static_cast<size_t>(arguments.num_assets)));

  EditSettings settings{.model = {},
                        .num_views = arguments.views,
                        .num_steps = arguments.steps,
                        .guidance_scale = arguments.guidance_scale,
                        .negative_prompt = arguments.negative_prompt,
                        .fine_detail = arguments.fine_detail,
                        .num_threads = arguments.threads};
  settings.model.model = arguments.model;
  EditSettings for_priors = settings;
  for_priors.num_views = arguments.ablation_views;

  const std::string model_hash = hash_of_all(arguments.model);
  const std::string key = model_hash + "\n" PATINA_VERSION "\n" + settings_key(settings, assets);
  const std::string priors_key = model_hash + "\n" PATINA_VERSION "\n" + settings_key(for_priors, assets);
  pipeline::ResolvedModel model(edit_config(assets.front(), settings).edit);

  // A part that is not asked for is told all the same where it has been measured already.
  json parts = json::object();
  const auto add = [&](const std::string& part, const std::string& part_key,
                       const std::function<json()>& work) {
    if (arguments.asks_for(part))
      parts[part] = kept_part(folder, part, hash_text(part_key), work);
    else if (std::optional<json> kept = kept_result(folder, part, hash_text(part_key)))
      parts[part] = *std::move(kept);
  };

  const std::string materials_key = classifier_key(arguments.shards, arguments.model / "vae");
  add("vae", key + materials_key, [&] {
    return measure_vae(model.loaded(), held_out_pictures(arguments, settings, assets, folder, model),
                       folder / "vae.png");
  });
  add("edits", key + materials_key, [&] {
    const AsEditedView shown = [&](const Image& before, const Image& after) {
      return as_edited_view(model.loaded(), before, after);
    };
    const Classifier classifier = trained_classifier(arguments.shards, shown, folder, materials_key);
    return measure_edits(assets, settings, classifier.discriminant, folder / "edits", model);
  });
  if (std::optional<json> trials = kept_result(folder, kClassifierTrials, materials_key))
    parts["classifier"] = *std::move(trials);
  model.unload();  // the priors' runs load it themselves
  // The sweep first: the pages of both lie in one folder, and the one with textures shall stay.
  add("sweep", priors_key + json(arguments.weights).dump(),
      [&] { return measure_sweep(assets, for_priors, arguments.weights, folder / "priors"); });
  add("ablation", priors_key, [&] { return measure_steps(assets, for_priors, folder / "priors"); });
  if (!arguments.demo.empty())
    add("demo", model_hash + arguments.demo, [&] { return timed_demo(arguments.demo); });

  const json result = {
      {"patina", PATINA_VERSION},
      {"model", arguments.model.string()},
      {"model_hash", model_hash},
      {"vae_psnr", at_or_null(parts, "/vae/psnr")},
      {"vae_psnr_object", at_or_null(parts, "/vae/psnr_object")},
      {"vae_fine_energy", at_or_null(parts, "/vae/fine_energy")},
      {"obedience_top3", at_or_null(parts, "/edits/obedience/top3")},
      {"obedience_runs", at_or_null(parts, "/edits/obedience/runs")},
      {"obedience_classes", at_or_null(parts, "/edits/obedience/classes")},
      {"obedience_ceiling_top3", at_or_null(parts, "/classifier/truth/top3")},
      {"obedience_ceiling_top3_held_out_materials",
       at_or_null(parts, "/classifier/truth_with_held_out_materials/top3")},
      {"obedience_ceiling_top3_as_rendered", at_or_null(parts, "/classifier/truth_as_rendered/top3")},
      {"classifier_top1", at_or_null(parts, "/classifier/held_out_photographs/top1")},
      {"classifier_top3", at_or_null(parts, "/classifier/held_out_photographs/top3")},
      {"clean_prompt_psnr", at_or_null(parts, "/edits/clean/psnr")},
      {"edge_f_score", at_or_null(parts, "/edits/structure/edge_f_score")},
      {"silhouette_bleed", at_or_null(parts, "/edits/structure/silhouette_bleed")},
      {"consistency", at_or_null(parts, "/ablation/edit_correlation")},
      {"sharpness", at_or_null(parts, "/ablation/texture_sharpness")},
      {"sweep", at_or_null(parts, "/sweep")},
      {"demo_seconds", at_or_null(parts, "/demo/seconds")},
      {"parts", parts}};
  write_file(arguments.out, result.dump(1));
  for (const auto& [name, value] : result.items())
    if (value.is_number() || value.is_array() || value.is_null())
      std::printf("%-44s %s\n", name.c_str(), value.dump().c_str());
  std::printf("wrote %s; pictures lie in %s\n", arguments.out.c_str(), folder.c_str());
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  const char* shared = std::getenv("PATINA_SHARED");
  arguments.shared = shared ? shared : "../shared";
  CLI::App program("Measures patina's own small model (mini/docs/measuring-mini.md).", "bench_mini");
  program.add_option("--model", arguments.model, "Diffusers folder")->capture_default_str();
  program.add_option("--shards", arguments.shards, "What make_dataset packed")->capture_default_str();
  program.add_option("--shared", arguments.shared, "Folder of shared assets (else $PATINA_SHARED)")
      ->capture_default_str();
  program.add_option("--out", arguments.out, "Result; parts and pictures go into the folder of its name")
      ->capture_default_str();
  program.add_option("--only", arguments.only, "Parts to measure")->check(CLI::IsMember(kParts));
  program.add_option("--demo", arguments.demo, "Command line whose wall clock is demo_seconds");
  program.add_option("--views", arguments.views, "Views of each edit with a prompt")
      ->check(tools::whole_number(1))
      ->capture_default_str();
  program.add_option("--ablation-views", arguments.ablation_views, "Views of the ablation and the sweep")
      ->check(tools::whole_number(1))
      ->capture_default_str();
  program.add_option("--steps", arguments.steps, "Steps of every edit")
      ->check(tools::whole_number(1))
      ->capture_default_str();
  program
      .add_option("--guidance-scale", arguments.guidance_scale, "Of every edit; 0 is what suits the model")
      ->check(tools::number())
      ->capture_default_str();
  program.add_option("--negative-prompt", arguments.negative_prompt,
                     "Of every edit, in place of the model's own");
  program.add_option("--fine-detail", arguments.fine_detail, "Of every edit, as of patina enhance")
      ->check(tools::number())
      ->capture_default_str();
  program.add_option("--assets", arguments.num_assets, "How many of the five assets, for a quick look")
      ->check(tools::whole_number(1, 5))
      ->capture_default_str();
  program.add_option("--weights", arguments.weights, "Values of w in the sweep")
      ->check(tools::number())
      ->capture_default_str();
  program.add_option("--threads", arguments.threads, "0: all processors")
      ->check(tools::whole_number(0))
      ->capture_default_str();
  return tools::run_program(program, argc, argv, [&] { run(arguments); });
}
