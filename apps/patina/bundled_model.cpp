#include "bundled_model.h"

namespace patina::app {

namespace fs = std::filesystem;

fs::path bundled_model() {
  constexpr const char* kName = "patina-mini";
  constexpr const char* kWeights = "unet/diffusion_pytorch_model.safetensors";
  std::error_code ignored;
  const fs::path program = fs::read_symlink("/proc/self/exe", ignored);
  for (const fs::path& folder : {program.parent_path() / ".." / "share" / "patina" / "models" / kName,
                                 fs::path(PATINA_SOURCE_DIR) / "models" / kName}) {
    if (fs::exists(folder / kWeights, ignored)) return folder.lexically_normal();
  }
  return {};
}

}  // namespace patina::app
