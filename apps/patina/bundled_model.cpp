#include "bundled_model.h"

namespace patina::app {

namespace fs = std::filesystem;

std::vector<fs::path> bundled_model_places() {
  std::error_code ignored;
  const fs::path program = fs::read_symlink("/proc/self/exe", ignored);
  const fs::path installed = program.parent_path() / ".." / "share" / "patina" / "models" / "patina-mini";
  return {installed.lexically_normal(), fs::path(PATINA_SOURCE_DIR) / "models" / "patina-mini"};
}

fs::path bundled_model() {
  std::error_code ignored;
  for (const fs::path& folder : bundled_model_places())
    if (fs::exists(folder / "unet" / "diffusion_pytorch_model.safetensors", ignored)) return folder;
  return {};
}

}  // namespace patina::app
