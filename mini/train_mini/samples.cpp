#include "samples.h"

#include <fstream>
#include <sstream>

#include <ATen/ATen.h>
#include <nlohmann/json.hpp>

#include "mini_data/compose.h"
#include "patina/base/error.h"

namespace patina::train_mini {
namespace {

namespace fs = std::filesystem;
using mini_data::kViewSide;

constexpr int64_t kPictures = 3;
constexpr int64_t kRecordBytes = kPictures * 3 * kViewSide * kViewSide;
constexpr uint64_t kPlansOfOneView = 3;  // between two plans of four
constexpr int kGroupViews = 4;

fs::path pictures_file(const fs::path& folder) {
  return folder / "pictures.u8";
}
fs::path lines_file(const fs::path& folder) {
  return folder / "samples.jsonl";
}

std::vector<Sample> read_samples(const fs::path& file) {
  std::vector<Sample> samples;
  std::istringstream lines(read_text_file(file));
  for (std::string line; std::getline(lines, line);) {
    const auto json = nlohmann::json::parse(line, nullptr, /*allow_exceptions=*/false);
    if (!json.is_object()) break;  // the line at which a run was killed
    samples.push_back(
        {json.value("caption", ""), json.value("class", ""), json.value("views", 1), json.value("view", 0)});
  }
  return samples;
}

std::string line_of(const Sample& sample) {
  const nlohmann::json json{{"caption", sample.caption},
                            {"class", sample.asked_class},
                            {"views", sample.group_views},
                            {"view", sample.view}};
  return json.dump() + "\n";
}

/// Whole groups that both files hold, and the number of plans they took; the files are cut to them.
struct Progressed {
  int64_t samples = 0;
  uint64_t plans = 0;
};
Progressed keep_whole_groups(const fs::path& folder) {
  Progressed kept;
  if (!fs::exists(pictures_file(folder)) || !fs::exists(lines_file(folder))) return kept;
  const std::vector<Sample> samples = read_samples(lines_file(folder));
  const auto stored = static_cast<int64_t>(fs::file_size(pictures_file(folder))) / kRecordBytes;
  std::string lines;
  while (kept.samples < static_cast<int64_t>(samples.size())) {
    const int64_t next = kept.samples + samples[static_cast<size_t>(kept.samples)].group_views;
    if (next > stored || next > static_cast<int64_t>(samples.size())) break;
    for (; kept.samples < next; ++kept.samples) lines += line_of(samples[static_cast<size_t>(kept.samples)]);
    ++kept.plans;
  }
  write_file(lines_file(folder), lines);
  fs::resize_file(pictures_file(folder), static_cast<uintmax_t>(kept.samples * kRecordBytes));
  return kept;
}

}  // namespace

SampleFolder::SampleFolder(const fs::path& folder)
    : file_(pictures_file(folder)), samples_(read_samples(lines_file(folder))) {
  const size_t stored = file_.bytes().size() / kRecordBytes;
  if (stored == 0 || samples_.empty())
    throw Error(ErrorCode::kFormat, folder.string(), "holds no samples; make them with: train_mini samples");
  samples_.resize(std::min(samples_.size(), stored));
}

at::Tensor SampleFolder::pictures(int64_t index) const {
  auto* data = const_cast<uint8_t*>(file_.bytes().data()) + index * kRecordBytes;
  return at::from_blob(data, {kPictures, 3, kViewSide, kViewSide}, at::kByte);
}

void make_samples(const fs::path& shards, const fs::path& folder, const SampleOptions& options,
                  const Progress& progress) {
  fs::create_directories(folder);
  Progressed done = keep_whole_groups(folder);
  if (done.samples >= options.count) return;

  const mini_data::Dataset dataset = mini_data::read_dataset(shards, options.part);
  const auto library = mini_data::make_library(dataset, options.device);
  const mini_data::Catalog catalog = mini_data::catalog_of(dataset);
  std::ofstream pictures(pictures_file(folder), std::ios::binary | std::ios::app);
  std::ofstream lines(lines_file(folder), std::ios::app);
  while (done.samples < options.count) {
    const int views = done.plans % (kPlansOfOneView + 1) == kPlansOfOneView ? kGroupViews : 1;
    const int num_plans =
        views == 1 ? static_cast<int>(kPlansOfOneView - done.plans % (kPlansOfOneView + 1)) : 1;
    mini_data::PlanOptions plan_options;
    plan_options.views = views;
    std::vector<mini_data::Plan> plans;
    for (int i = 0; i < num_plans; ++i)
      plans.push_back(mini_data::draw_plan(catalog, options.seed, done.plans++, plan_options));
    const mini_data::Batch batch = mini_data::compose(*library, plans);
    const at::Tensor bytes = at::stack({batch.tile, batch.normal, batch.target}, 1)
                                 .mul(255.0)
                                 .round()
                                 .clamp(0, 255)
                                 .to(at::kByte)
                                 .cpu()
                                 .contiguous();
    pictures.write(static_cast<const char*>(bytes.data_ptr()), bytes.numel());
    for (const mini_data::Plan& plan : plans) {
      for (int view = 0; view < views; ++view)
        lines << line_of({plan.caption, plan.asked_class, views, view});
    }
    if (!pictures.flush() || !lines.flush())
      throw Error(ErrorCode::kIo, folder.string(), "could not be written; is the disk full?");
    done.samples += num_plans * views;
    progress.update("samples", static_cast<double>(done.samples), static_cast<double>(options.count));
    progress.throw_if_stopped();
  }
}

}  // namespace patina::train_mini
