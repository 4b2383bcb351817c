// Training samples out of the data: materials laid over baked views, aged as plans say, and lit, all as
// batched tensor operations on any device.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include <ATen/core/Tensor.h>
#include <c10/core/Device.h>

#include "mini_data/plan.h"

namespace patina::mini_data {

/// A data set's tensors on one device: about 1.7 MB a view, 0.5 MB a material.
struct Library;
std::shared_ptr<const Library> make_library(const Dataset& dataset, c10::Device device);

/// What a picture shows, pixel by pixel: f32 on the library's device. Outside the object the values go on
/// smoothly.
struct MaterialMaps {
  at::Tensor base_color;  // [B,3,H,W] linear Rec. 709
  at::Tensor roughness;   // [B,1,H,W] perceptual
  at::Tensor metallic;    // [B,1,H,W]
  at::Tensor normal;  // [B,3,H,W] unit, with the materials' relief; camera's frame, z points to the camera
};

/// B = number of plans × views a plan; samples of one plan follow each other. f32 on the library's device.
struct Batch {
  at::Tensor
      tile;  // [B,3,H,W] sRGB [0,1]: the clean render over the neutral backdrop, as views::tile_control
  at::Tensor normal;                  // [B,3,H,W] [0,1], as views::normal_control
  at::Tensor target;                  // [B,3,H,W] sRGB [0,1]: the aged render, same light and exposure
  at::Tensor coverage;                // [B,1,H,W]
  at::Tensor age_mask;                // [B,1,H,W] how much of the surface's colour the layers made up, [0,1]
  MaterialMaps clean, aged;           // what tile and target were lit from
  std::vector<std::string> captions;  // [B]
  std::vector<float> exposure_ev;     // [plans], in units of the object's mean light
};

/// Carries out plans that all have the same number of views. H = W = `side`, which is kViewSide, half or a
/// quarter of it: planes and textures are averaged first, so that smaller samples cost less and do not alias.
/// No gradients are recorded.
Batch compose(const Library& library, std::span<const Plan> plans, int side = kViewSide);

}  // namespace patina::mini_data
