// What stands behind diffusion::Model: the loaded networks. Seen only by the sources that see Torch.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "patina/diffusion/model.h"
#include "patina/diffusion/networks/controlnet.h"
#include "patina/diffusion/networks/held.h"
#include "patina/diffusion/networks/unet.h"
#include "patina/diffusion/networks/vae.h"
#include "patina/diffusion/schedulers/schedulers.h"
#include "patina/diffusion/text/text_conditioning.h"
#include "patina/diffusion/text/tokenizer.h"

namespace patina::diffusion {

/// From a prompt to tokens' vectors.
struct TextStage {
  Tokenizer tokenizer;
  Held<TextEncoder> encoder;
  LearnedWords words;
};

struct Model::State {
  Dtype dtype = Dtype::kF32;
  Device device = Device::kCpu;
  std::vector<TextStage> texts;
  UNet unet;
  Held<Vae> vae;
  std::vector<Held<ControlNet>> controlnets;  // in the order of kControlKinds
  SchedulerConfig scheduler;
  Guidance guidance;               // where the user names nothing else
  std::vector<std::string> notes;  // what was chosen without being told to, for the description
};

}  // namespace patina::diffusion
