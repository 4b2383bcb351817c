// Edits to choose from: the same views edited with several seeds, on one page, before anything is fitted.
#pragma once

#include "patina/pipeline/stages.h"

namespace patina::pipeline {

/// Whether a run ends with edited views: for several seeds, or for a draft.
bool only_edits(const Config& config);

/// The page of a run folder that shows the edits.
std::filesystem::path variants_page(const RunFolder& run);

/// Edits the views with Config::num_seeds seeds, from the edit's own on → variants/seed_N/, each laid out as
/// a run folder, and variants/variants.html. Edits that are there already stay. The first becomes the
/// run's own edit.
void edit_variants(const Workbench& bench, const Strength& strength, const RenderedViews& views,
                   const Config& config, ResolvedModel& model, RunFolder& run, const RunProgress& progress);

/// Takes over the edit of this seed, if edit_variants() made it for the same `key`.
void adopt_variant(RunFolder& run, uint64_t seed, const std::string& key);

}  // namespace patina::pipeline
