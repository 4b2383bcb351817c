#include "composer.h"

#include <cmath>

#include <ATen/ATen.h>

#include "mini_data/compose.h"

namespace patina::bench {

using mini_data::Part;

namespace {

// [C,H,W] to [H,W,C].
Image image_of(const at::Tensor& chw) {
  const at::Tensor hwc = chw.permute({1, 2, 0}).to(at::kFloat).contiguous();
  Image out(static_cast<int>(hwc.size(1)), static_cast<int>(hwc.size(0)), static_cast<int>(hwc.size(2)));
  std::copy_n(hwc.data_ptr<float>(), out.pixels.size(), out.pixels.begin());
  return out;
}

// Whether the light on a white object averages to white within a quarter of a stop, red and blue against
// green.
bool in_white_light(const mini_data::ObjectData& object) {
  double sum[3] = {};
  for (const mini_data::ViewData& view : object.views) {
    const size_t pixels = view.planes.size() / mini_data::kNumViewPlanes;
    for (size_t i = 0; i < pixels; ++i) {
      if (view.planes[mini_data::kCoverage * pixels + i] < 255) continue;
      for (size_t c = 0; c < 3; ++c)
        sum[c] += mini_data::light_of_code(
            static_cast<float>(view.planes[(mini_data::kLightR + c) * pixels + i]) / 255.0f);
    }
  }
  constexpr double kMost = 0.18;
  return std::abs(std::log(sum[0] / sum[1])) < kMost && std::abs(std::log(sum[2] / sum[1])) < kMost;
}

}  // namespace

struct Composer::State {
  mini_data::Dataset dataset;
  mini_data::Catalog catalog;
  std::shared_ptr<const mini_data::Library> library;
};

Composer::Composer(const std::filesystem::path& shards, Part objects, Part materials)
    : state_(std::make_unique<State>()) {
  mini_data::Dataset& data = state_->dataset;
  data = mini_data::read_dataset(shards, objects == materials ? objects : Part::kAll);
  std::erase_if(data.objects, [&](const mini_data::ObjectData& object) {
    return object.held_out != (objects == Part::kHeldOut) || !in_white_light(object);
  });
  std::erase_if(data.materials, [&](const mini_data::MaterialData& material) {
    return !material.is_mask && material.held_out != (materials == Part::kHeldOut);
  });
  state_->catalog = mini_data::catalog_of(state_->dataset);
  state_->library = mini_data::make_library(data, at::kCPU);
  // The library has copied all planes; plans need but names and numbers.
  for (mini_data::ObjectData& object : data.objects)
    for (mini_data::ViewData& view : object.views) view.planes = {}, view.depth = {};
  for (mini_data::MaterialData& material : data.materials) material.planes = {};
}
Composer::~Composer() = default;

const mini_data::Catalog& Composer::catalog() const {
  return state_->catalog;
}

std::vector<Composed> Composer::compose(std::span<const mini_data::Plan> plans) const {
  const mini_data::Batch batch = mini_data::compose(*state_->library, plans);
  std::vector<Composed> out;
  for (int64_t i = 0; i < batch.tile.size(0); ++i)
    out.push_back({.before = image_of(batch.tile[i]),
                   .after = image_of(batch.target[i]),
                   .coverage = image_of(batch.coverage[i]),
                   .age_mask = image_of(batch.age_mask[i])});
  return out;
}

}  // namespace patina::bench
