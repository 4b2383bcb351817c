#include "records.h"

#include <fstream>

#include <ATen/ATen.h>
#include <c10/core/GradMode.h>

#include "mini_data/compose.h"
#include "mini_data/fields.h"
#include "patina/base/error.h"

namespace patina::train_material {
namespace {

namespace fs = std::filesystem;
using at::Tensor;
using mini_data::kViewSide;

constexpr int64_t kRecordBytes = int64_t{kNumPlanes} * kViewSide * kViewSide;
constexpr int64_t kThroughAutoencoderOneIn = 3;
constexpr int kAtOnce = 2;  // samples composed together

fs::path records_file(const fs::path& folder) {
  return folder / "records.u8";
}

Tensor coded(const Tensor& unit) {
  return 0.5 + 0.5 * unit;
}
Tensor unit_of(const Tensor& code) {
  const Tensor n = 2 * code - 1;
  return n / n.norm(2, {1}, true).clamp_min(1e-3);
}

Tensor planes_of(const mini_data::Batch& batch) {
  using mini_data::srgb_from_linear;
  return at::cat(
      {batch.target, batch.tile, coded(batch.clean.normal), srgb_from_linear(batch.clean.base_color),
       batch.clean.roughness, batch.clean.metallic, srgb_from_linear(batch.aged.base_color),
       batch.aged.roughness, batch.aged.metallic, coded(batch.aged.normal), batch.coverage},
      1);
}

}  // namespace

Records::Records(const fs::path& folder)
    : file_(records_file(folder)), size_(static_cast<int64_t>(file_.bytes().size()) / kRecordBytes) {
  if (size_ == 0)
    throw Error(ErrorCode::kFormat, folder.string(),
                "holds no samples; make them with: train_material samples");
}

Tensor Records::record(int64_t index) const {
  auto* data = const_cast<uint8_t*>(file_.bytes().data()) + index * kRecordBytes;
  return at::from_blob(data, {kNumPlanes, kViewSide, kViewSide}, at::kByte).to(at::kFloat) / 255;
}

void make_records(const fs::path& shards, const fs::path& folder, const RecordOptions& options,
                  const Progress& progress) {
  const at::NoGradGuard no_gradients;
  fs::create_directories(folder);
  const fs::path file = records_file(folder);
  int64_t done = fs::exists(file) ? static_cast<int64_t>(fs::file_size(file)) / kRecordBytes : 0;
  if (done >= options.count) return;

  const mini_data::Dataset dataset = mini_data::read_dataset(shards, options.part);
  const auto library = mini_data::make_library(dataset, at::kCPU);
  const mini_data::Catalog catalog = mini_data::catalog_of(dataset);
  std::ofstream out(file, std::ios::binary | std::ios::app);
  fs::resize_file(file, static_cast<uintmax_t>(done * kRecordBytes));  // without the one that was cut off
  while (done < options.count) {
    std::vector<mini_data::Plan> plans;
    for (int i = 0; i < kAtOnce; ++i)
      plans.push_back(draw_plan(catalog, options.seed, static_cast<uint64_t>(done + i), {}));
    mini_data::Batch batch = mini_data::compose(*library, plans);
    for (int i = 0; options.through_autoencoder && i < kAtOnce; ++i) {
      if ((done + i) % kThroughAutoencoderOneIn != 0) continue;
      const Tensor picture = batch.target.slice(0, i, i + 1);
      picture.copy_(options.through_autoencoder(picture));
    }
    const Tensor bytes = planes_of(batch).clamp(0, 1).mul(255.0).round().to(at::kByte).contiguous();
    out.write(static_cast<const char*>(bytes.data_ptr()), bytes.numel());
    if (!out.flush()) throw Error(ErrorCode::kIo, file.string(), "could not be written; is the disk full?");
    done += kAtOnce;
    progress.update("samples", static_cast<double>(done), static_cast<double>(options.count));
    progress.throw_if_stopped();
  }
}

prior::MaterialInputs inputs_of(const Tensor& planes) {
  const auto plane = [&](int64_t first, int64_t count) { return planes.slice(1, first, first + count); };
  prior::MaterialInputs out;
  out.edited = plane(kEdited, 3), out.render = plane(kRender, 3);
  out.mask = (plane(kCoverage, 1) > 0.5).to(at::kFloat);
  out.normal = unit_of(plane(kCleanNormal, 3)) * out.mask;
  out.base_color = plane(kCleanBase, 3) * out.mask;
  out.roughness = plane(kCleanRoughness, 1) * out.mask;
  out.metallic = plane(kCleanMetallic, 1) * out.mask;
  return out;
}

Truth truth_of(const Tensor& planes) {
  const auto plane = [&](int64_t first, int64_t count) { return planes.slice(1, first, first + count); };
  Truth out;
  out.base_color = plane(kTrueBase, 3);
  out.roughness = plane(kTrueRoughness, 1), out.metallic = plane(kTrueMetallic, 1);
  out.weight = (plane(kCoverage, 1) > 0.99).to(at::kFloat);
  out.normal = unit_of(plane(kTrueNormal, 3));
  out.slope = prior::slopes_between(unit_of(plane(kCleanNormal, 3)), out.normal);
  return out;
}

}  // namespace patina::train_material
