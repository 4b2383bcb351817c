#include "patina/diffusion/component.h"

#include "patina/base/error.h"

namespace patina::diffusion {

std::filesystem::path weight_file(const std::filesystem::path& folder) {
  namespace fs = std::filesystem;
  for (const char* name : {"diffusion_pytorch_model.safetensors", "model.safetensors",
                           "diffusion_pytorch_model.fp16.safetensors", "model.fp16.safetensors"}) {
    if (fs::exists(folder / name)) return folder / name;
  }
  for (const char* name : {"diffusion_pytorch_model.bin", "pytorch_model.bin",
                           "diffusion_pytorch_model.fp16.bin", "pytorch_model.fp16.bin"}) {
    if (fs::exists(folder / name)) nn::refuse_pickle_name(folder / name);
  }
  throw Error(ErrorCode::kNotFound, folder.string(),
              "holds no weights; expected diffusion_pytorch_model.safetensors or model.safetensors");
}

}  // namespace patina::diffusion
