// The ControlNets of an edit, one row each: where its weights lie, which views it sees, how strong it is.
// What loads, checks, counts or runs ControlNets goes over this table. No Torch here.
#pragma once

#include <array>
#include <filesystem>
#include <vector>

#include "patina/diffusion/edit.h"
#include "patina/diffusion/options.h"

namespace patina::diffusion {

struct ControlKind {
  const char* name;       // in messages, and in the names of its files
  const char* component;  // its folder in a diffusers model
  std::filesystem::path ModelPaths::*path;
  std::vector<Image> EditInputs::*views;
  float EditOptions::*scale;
};
inline constexpr std::array<ControlKind, 2> kControlKinds{{
    {"tile", "controlnet_tile", &ModelPaths::controlnet_tile, &EditInputs::tile_views,
     &EditOptions::tile_scale},
    {"normal", "controlnet_normal", &ModelPaths::controlnet_normal, &EditInputs::normal_views,
     &EditOptions::normal_scale},
}};

}  // namespace patina::diffusion
