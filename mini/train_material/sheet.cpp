#include "sheet.h"

#include <algorithm>
#include <vector>

#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>

#include "evaluation.h"
#include "patina/image/image_io.h"
#include "patina/report/report.h"

namespace patina::train_material {
namespace {

using at::Tensor;

constexpr int kTileWidth = 192;
constexpr double kWhiteError = 0.2;

Image image_of(const Tensor& nchw) {
  const Tensor hwc = nchw[0].clamp(0, 1).expand({3, -1, -1}).permute({1, 2, 0}).contiguous();
  Image out(static_cast<int>(hwc.size(1)), static_cast<int>(hwc.size(0)), 3);
  std::copy_n(hwc.data_ptr<float>(), out.pixels.size(), out.pixels.begin());
  return out;
}

}  // namespace

void write_sheet(const prior::MaterialNetwork& network, const Records& records, int64_t rows, bool disturb,
                 const std::filesystem::path& file) {
  const c10::InferenceMode inference;
  std::vector<Image> pictures;
  EvaluationOptions options;
  options.disturb = disturb;
  rows = std::min(rows, records.size());
  for (int64_t row = 0; row < rows; ++row) {
    const Tensor planes = evaluated_sample(records, row * records.size() / rows, options);
    const prior::MaterialInputs inputs = inputs_of(planes);
    const Truth truth = truth_of(planes);
    const prior::MaterialOutputs y = network(inputs);
    const Tensor& mask = inputs.mask;
    const auto normals = [&](const Tensor& n) { return (0.5 + 0.5 * n) * mask; };
    for (const Tensor& picture :
         {inputs.edited, inputs.render, y.base_color * mask, truth.base_color * mask, y.roughness * mask,
          truth.roughness * mask, y.metallic_logit.sigmoid() * mask, truth.metallic * mask,
          normals(prior::bent_normals(inputs.normal, y.slope)), normals(truth.normal),
          at::cat({y.base_color_error, y.roughness_error, y.slope_error}, 1) * mask / kWhiteError})
      pictures.push_back(image_of(picture));
  }
  write_image(file, report::contact_sheet(pictures, 11, kTileWidth));
}

}  // namespace patina::train_material
