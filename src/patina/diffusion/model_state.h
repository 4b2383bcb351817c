// What stands behind diffusion::Model: the loaded networks. Seen only by the sources that see Torch.
#pragma once

#include <filesystem>
#include <optional>

#include "patina/diffusion/model.h"
#include "patina/diffusion/model_parts.h"
#include "patina/diffusion/networks/controlnet.h"
#include "patina/diffusion/networks/held.h"
#include "patina/diffusion/networks/unet.h"
#include "patina/diffusion/networks/vae.h"
#include "patina/diffusion/schedulers/schedulers.h"
#include "patina/diffusion/text/text_conditioning.h"
#include "patina/diffusion/text/tokenizer.h"

namespace patina::diffusion {

struct Model::State {
  Dtype dtype = Dtype::kF32;
  Device device = Device::kCpu;
  Tokenizer tokenizer;
  Held<TextEncoder> text_encoder;
  UNet unet;
  Held<Vae> vae;
  Held<ControlNet> controlnet_tile, controlnet_normal;
  SchedulerConfig scheduler;
  Guidance guidance;  // where the user names nothing else
  LearnedWords words;
  std::vector<std::string> notes;  // what was chosen without being told to, for the description
};

}  // namespace patina::diffusion
