// The baked planes of a batch of views as tensors, in world space. Internal to composition.
#pragma once

#include <span>
#include <vector>

#include <ATen/core/Tensor.h>

#include "mini_data/library.h"
#include "mini_data/plan.h"

namespace patina::mini_data {

/// All [B,·,H,W] f32. B samples.
struct Fields {
  int64_t reduction = 1;
  at::Tensor rotation;                                                    // [B,3,3] world from camera
  at::Tensor coverage;                                                    // [B,1]
  at::Tensor position;                                                    // [B,3] object's radius is 1
  at::Tensor normal;                                                      // [B,3] unit, world
  at::Tensor to_eye;                                                      // [B,3] unit, world
  at::Tensor pixel_size;                                                  // [B,1] of the surface seen face on
  at::Tensor occlusion, crevice, curvature_fine, curvature_coarse, flow;  // [B,1] as ViewPlane says
  at::Tensor light;         // [B,3] radiance of a white diffuse surface
  at::Tensor bounce;        // [B,1] share that a white object adds
  at::Tensor toward_light;  // [B,3] world
  at::Tensor gloss;         // [B,9]
  at::Tensor gloss_map;     // [B,9,h,w + 2]
  at::Tensor detail;        // [B,4] noise of small features, for all masks

  at::Tensor to_camera(const at::Tensor& world) const;  // [B,3,H,W]
};

/// `reduction` (1, 2 or 4) pixels of the baked views become one, each way.
Fields read_fields(const Library& library, std::span<const Plan* const> samples,
                   const std::vector<int64_t>& view_of_sample, int64_t reduction);

/// Noise channels [B,4,H,W] at positions [B,3,H,W]; `size` [B,1,1,1] of the largest features; `shift`
/// [B,3,1,1] periods.
at::Tensor noise_at(const Library& library, const at::Tensor& position, const at::Tensor& size,
                    const at::Tensor& shift);

/// Rotates vectors [B,3,H,W] by matrices [B,3,3].
at::Tensor rotated(const at::Tensor& matrix, const at::Tensor& vectors);

/// A [B,1,1,1] or [B,n,1,1] tensor of what `value` says of each sample (n floats).
template <class Value>
at::Tensor per_sample(std::span<const Plan* const> samples, const at::Tensor& like, int64_t n,
                      const Value& value);

at::Tensor luminance(const at::Tensor& rgb);  // [B,3,H,W] → [B,1,H,W]
at::Tensor srgb_from_linear(const at::Tensor& linear);
at::Tensor linear_from_srgb(const at::Tensor& srgb);

/// For per_sample: a host vector as a tensor on the device of `like`, [size / n, n, 1, 1].
at::Tensor column(const std::vector<float>& values, int64_t n, const at::Tensor& like);

template <class Value>
at::Tensor per_sample(std::span<const Plan* const> samples, const at::Tensor& like, int64_t n,
                      const Value& value) {
  std::vector<float> values;
  for (const Plan* plan : samples) value(*plan, values);
  return column(values, n, like);
}

}  // namespace patina::mini_data
