// Looks at a model folder without loading it, so that a wrong path is told before hours of rendering.
#include <array>
#include <utility>

#include "patina/base/error.h"
#include "patina/diffusion/component.h"
#include "patina/diffusion/detail.h"
#include "patina/diffusion/unet.h"
#include "patina/nn/safetensors.h"

namespace patina::diffusion {

namespace fs = std::filesystem;

void check_model(const ModelPaths& paths) {
  nn::refuse_pickle_name(paths.model);
  if (!fs::is_directory(paths.model))
    throw Error(ErrorCode::kNotFound, paths.model.string(),
                fs::exists(paths.model) ? "is a file; expected a model folder in the diffusers layout"
                                        : "does not exist; expected a model folder in the diffusers layout");
  const std::array<std::pair<const char*, fs::path>, 5> networks = {
      {{"text_encoder", {}},
       {"unet", {}},
       {"vae", paths.vae},
       {"controlnet_tile", paths.controlnet_tile},
       {"controlnet_normal", paths.controlnet_normal}}};
  for (const auto& [name, given] : networks) {
    const fs::path folder = given.empty() ? paths.model / name : given;
    nn::refuse_pickle_name(folder);
    if (!fs::exists(folder))
      throw Error(ErrorCode::kNotFound, folder.string(),
                  given.empty() ? "is missing from the model; put it there or name another folder (--vae, "
                                  "--controlnet-tile, --controlnet-normal)"
                                : "does not exist");
    if (fs::is_directory(folder)) nn::SafeTensors(weight_file(folder));  // reads and checks the header alone
  }
}

}  // namespace patina::diffusion
