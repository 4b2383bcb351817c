// What a surface is made of, pixel by pixel: clean materials and layers of age. Internal to composition.
#pragma once

#include <span>

#include "mini_data/fields.h"
#include "mini_data/shading.h"

namespace patina::mini_data {

SurfaceValues clean_surface(const Library& library, const Fields& fields,
                            std::span<const Plan* const> samples);

/// The target's surface.
struct AgedSurface {
  SurfaceValues surface;
  at::Tensor mask;  // [B,1,H,W] how much the layers made up, [0,1]
};
AgedSurface aged_surface(const Library& library, const Fields& fields, std::span<const Plan* const> samples,
                         const SurfaceValues& clean, int64_t num_plans);

}  // namespace patina::mini_data
