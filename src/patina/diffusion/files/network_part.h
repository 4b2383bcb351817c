// One network of a model before it is built: where its tensors lie and how large it is. No Torch here.
#pragma once

#include <filesystem>

#include "patina/diffusion/files/config.h"
#include "patina/diffusion/files/tensor_table.h"

namespace patina::diffusion {

template <class Config>
struct NetworkPart {
  TensorTable table;
  Config config;
};

using UNetPart = NetworkPart<UNetConfig>;
using VaePart = NetworkPart<VaeConfig>;
using TextEncoderPart = NetworkPart<TextEncoderConfig>;
using ControlNetPart = NetworkPart<ControlNetConfig>;

/// `path` is the folder of a diffusers component, whose config.json tells the sizes, or a file that holds the
/// network alone or among others, in any naming; there the sizes are told from the tensors, unless it is a
/// diffusers file with its config.json beside it. Throws Error that names file and tensor or key.
UNetPart open_unet(const std::filesystem::path& path);
VaePart open_vae(const std::filesystem::path& path);
TextEncoderPart open_text_encoder(const std::filesystem::path& path);
ControlNetPart open_controlnet(const std::filesystem::path& path);

}  // namespace patina::diffusion
