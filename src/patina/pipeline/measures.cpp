#include "patina/pipeline/measures.h"

#include "patina/correspond/consistency.h"
#include "patina/inverse/loss.h"

namespace patina::pipeline {

std::vector<Image> measure_weights(const Strength& strength, const RenderedViews& views,
                                   int boundary_pixels) {
  std::vector<Image> weights;
  for (const views::View& view : views.set.views)
    weights.push_back(inverse::loss_weight(view.gbuffer, strength.enhanced, boundary_pixels));
  return weights;
}

nlohmann::json consistency_metrics(const Workbench& bench, const RenderedViews& views,
                                   std::span<const Image> edited) {
  const correspond::Consistency consistency =
      correspond::edit_consistency(*bench.scene, views.set, views.tile, edited);
  return {{"edit_correlation", json_number(consistency.edit_correlation)},
          {"edit_psnr", json_number(consistency.edit_psnr)},
          {"covisible_pixels", consistency.covisible_pixels}};
}

}  // namespace patina::pipeline
