#include "patina/pipeline/variants.h"

#include <fmt/format.h>

#include "patina/report/variants_page.h"

namespace patina::pipeline {

namespace fs = std::filesystem;

namespace {

fs::path variant_folder(const RunFolder& run, uint64_t seed) {
  return run.file("variants") / fmt::format("seed_{}", seed);
}

}  // namespace

bool only_edits(const Config& config) {
  return config.num_seeds > 1 || config.preset == Preset::kDraft;
}

fs::path variants_page(const RunFolder& run) {
  return run.file("variants") / "variants.html";
}

void edit_variants(const Workbench& bench, const Strength& strength, const RenderedViews& views,
                   const Config& config, ResolvedModel& model, RunFolder& run, const RunProgress& progress) {
  report::VariantsPage page;
  page.title = bench.asset.path.filename().string();
  page.before = views.tile;
  for (int i = 0; i < config.num_seeds; ++i) {
    EditSettings settings = config.edit;
    settings.options.seed += static_cast<uint64_t>(i);
    RunFolder variant(variant_folder(run, settings.options.seed));
    page.variants.push_back({fmt::format("seed {}", settings.options.seed),
                             edit_stage(bench, strength, views, settings, model, variant, progress)});
    const Prompts prompts = prompts_of(variant);
    page.prompt = prompts.prompt, page.negative_prompt = prompts.negative_prompt;
    report::write_variants(variants_page(run), page);
    progress.tell_preview(variants_page(run));
  }
  // The first is the run's own until another is chosen.
  edit_stage(bench, strength, views, config.edit, model, run, progress);
}

void adopt_variant(RunFolder& run, uint64_t seed, const std::string& key) {
  const fs::path folder = variant_folder(run, seed);
  if (!fs::exists(folder)) return;
  const RunFolder variant(folder);
  if (const StageRecord* edit = variant.stage("detail"); edit && edit->key == key)
    run.adopt_stage(variant, "detail");
}

}  // namespace patina::pipeline
