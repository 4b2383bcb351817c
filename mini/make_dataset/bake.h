// Renders what shading needs of an object, once: geometry, ageing fields, and light apart from any material.
#pragma once

#include <span>
#include <vector>

#include "mesh.h"
#include "mini_data/dataset.h"
#include "patina/base/progress.h"
#include "patina/render/environment.h"

namespace patina::make_dataset {

struct BakeOptions {
  int num_views = 4;  // at equal steps of azimuth, as the product's orbit
  float elevation = 0.35f, azimuth_start = 0, fov_y = 0.61f;  // radians
  int diffuse_strata = 8;  // squared: rays toward the hemisphere, and as many toward the lights
  int gloss_strata = 6;    // squared: rays a roughness
  uint64_t seed = 0;
};

/// Everything of one object as shard entries: first the object, then its views.
struct BakedObject {
  mini_data::ObjectData object;               // without views and gloss map
  std::vector<std::vector<float>> gloss_map;  // [9][kGlossMapHeight · kGlossMapWidth] light codes
  std::vector<mini_data::ViewData> cameras;
  std::vector<std::vector<std::vector<float>>>
      planes;  // [view][kNumViewPlanes][256²], encoded as ViewPlane says
};

/// `finished` lies in the unit sphere.
BakedObject bake(const Finished& finished, const render::Environment& environment, const BakeOptions& options,
                 const Progress& progress = {});

std::vector<mini_data::Entry> entries_of(const BakedObject& baked);

}  // namespace patina::make_dataset
