// The sizes of Stable Diffusion 1.x and 2.x, real and small, and their config.json files.
#pragma once

#include <string>

#include "patina/diffusion/files/config.h"
#include "patina/diffusion/files/families.h"

namespace patina::make_checkpoint {

using diffusion::Family;

enum class Size {
  kSmall,  // a few million parameters; widths keep what shapes do not tell: 32 groups, 8 heads or heads of 64
  kFull,
};

struct Configs {
  Family family = Family::kSd1;
  diffusion::UNetConfig unet;
  diffusion::VaeConfig vae;
  diffusion::TextEncoderConfig text_encoder;
  diffusion::ControlNetConfig controlnet;
};
/// `vocabulary` tokens of the text encoder; 0: CLIP's 49408.
Configs configs_of(Family family, Size size, int64_t vocabulary = 0);

/// The text of config.json as diffusers and transformers write it.
std::string config_json(const diffusion::UNetConfig& config);
std::string config_json(const diffusion::ControlNetConfig& config);
std::string config_json(const diffusion::VaeConfig& config);
std::string config_json(const diffusion::TextEncoderConfig& config);

}  // namespace patina::make_checkpoint
