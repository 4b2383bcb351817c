#include "patina/pipeline/bundled_model.h"

#include <nlohmann/json.hpp>

#include "patina/base/files.h"

namespace patina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr const char* kName = "patina-mini";
constexpr const char* kWeights = "unet/diffusion_pytorch_model.safetensors";
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

fs::path bundled_model() {
  std::error_code ignored;
  const fs::path program = fs::read_symlink("/proc/self/exe", ignored);
  for (const fs::path& folder : {program.parent_path() / ".." / "share" / "patina" / "models" / kName,
                                 fs::path(PATINA_SOURCE_DIR) / "models" / kName}) {
    if (fs::exists(folder / kWeights, ignored)) return folder.lexically_normal();
  }
  return {};
}

void settle(Config& config) {
  if (config.model.model.empty()) config.model.model = bundled_model();
  if (config.orbit.resolution == 0) config.orbit.resolution = native_resolution(config.model.model);
}

}  // namespace patina::pipeline
