// The tensors of a data set on one device. Internal to composition.
#pragma once

#include <cstdint>
#include <vector>

#include <ATen/core/Tensor.h>

namespace patina::mini_data {

struct Library {
  at::Tensor planes;     // [views, kNumViewPlanes, H, W] u8
  at::Tensor depth;      // [views, H, W] f32, kDepth
  at::Tensor rotation;   // [views, 3, 3] f32, world from camera
  at::Tensor distance;   // [views] f32
  at::Tensor focal;      // [views] f32, distance from the eye to the image plane in pixels
  at::Tensor gloss_map;  // [objects, 9, kGlossMapHeight, kGlossMapWidth + 2] f32 radiance, wrapped in azimuth
  at::Tensor materials;  // [materials, kNumMaterialPlanes, H, W] u8
  at::Tensor noise;      // [1, 4, n + 2, n + 2, n + 2] f32, one period wrapped: see noise_volume.h
  at::Tensor albedo;     // [1, 3, 32, 32] f32 over (cosine of view, roughness): see shading.h
  std::vector<int64_t> first_view;  // of each object
};

}  // namespace patina::mini_data
