// What depends on the model: patina-mini where none is given, and the size of its training pictures.
#include <nlohmann/json.hpp>

#include "patina/base/files.h"
#include "patina/pipeline/config.h"

namespace patina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr int kUsualSampleSize = 64;  // latent pixels a side that Stable Diffusion 1.5 was trained at
constexpr int kLatentScale = 8;       // image pixels a latent pixel

/// Image pixels a side of the model's training pictures: sample_size of unet/config.json is in latent pixels.
int native_resolution(const fs::path& model) {
  const fs::path file = model / "unet" / "config.json";
  int sample_size = kUsualSampleSize;
  if (fs::is_regular_file(file)) {
    const auto json =
        nlohmann::json::parse(read_text_file(file, 1 << 24), nullptr, /*allow_exceptions=*/false);
    if (json.is_object() && json.contains("sample_size") && json["sample_size"].is_number_integer())
      sample_size = json["sample_size"].get<int>();
  }
  // Views are multiples of 64 pixels; a model that says something odd gets the usual size.
  const int resolution = kLatentScale * sample_size;
  return resolution >= 64 && resolution <= 1024 && resolution % 64 == 0 ? resolution
                                                                        : kLatentScale * kUsualSampleSize;
}

}  // namespace

void settle(Config& config) {
  fs::path& model = config.edit.model.model;
  const bool is_bundled = model.empty() || (model == config.bundled_model.filename() && !fs::exists(model));
  if (is_bundled && !config.bundled_model.empty()) model = config.bundled_model;
  int& resolution = config.inputs.orbit.resolution;
  if (resolution == 0) resolution = native_resolution(model);
}

}  // namespace patina::pipeline
