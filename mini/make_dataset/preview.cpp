#include "preview.h"

#include <algorithm>

#include <ATen/ATen.h>

#include "mini_data/compose.h"
#include "patina/base/files.h"
#include "patina/image/image_io.h"
#include "patina/report/report.h"

namespace patina::make_dataset {
namespace {

using namespace mini_data;

Image image_of(const at::Tensor& chw) {
  const at::Tensor hwc = chw.permute({1, 2, 0}).contiguous().cpu();
  Image out(static_cast<int>(hwc.size(1)), static_cast<int>(hwc.size(0)), static_cast<int>(hwc.size(2)));
  std::copy_n(hwc.data_ptr<float>(), out.pixels.size(), out.pixels.begin());
  return out;
}

}  // namespace

void write_preview(const std::filesystem::path& shards, const std::filesystem::path& sheet,
                   const PreviewOptions& options) {
  const Dataset dataset = read_dataset(shards, options.held_out ? Part::kHeldOut : Part::kTraining);
  const auto library = make_library(dataset, at::kCPU);
  const Catalog catalog = catalog_of(dataset);
  std::vector<Image> pictures;
  std::string captions;
  constexpr int kBatch = 4, kSamplesARow = 3;
  for (int i = 0; i < kSamplesARow * options.rows; i += kBatch) {
    std::vector<Plan> plans;
    for (int k = i; k < std::min(i + kBatch, kSamplesARow * options.rows); ++k) {
      const auto index = static_cast<uint64_t>(k);
      plans.push_back(options.only.empty() ? draw_plan(catalog, options.seed, index, {})
                                           : plan_of(catalog, options.only, k % 3, options.seed, index, {}));
    }
    const Batch batch = compose(*library, plans);
    for (size_t k = 0; k < plans.size(); ++k) {
      const auto sample = static_cast<int64_t>(k);
      for (const at::Tensor& picture : {batch.tile[sample], batch.normal[sample], batch.target[sample]})
        pictures.push_back(image_of(picture));
      captions += std::to_string(i + static_cast<int>(k)) + "  " +
                  (plans[k].caption.empty() ? "(empty)" : plans[k].caption) + "\n";
    }
  }
  write_image(sheet, report::contact_sheet(pictures, 3 * kSamplesARow, options.tile_width));
  std::filesystem::path text = sheet;
  text += ".txt";
  write_file(text, captions);
}

}  // namespace patina::make_dataset
