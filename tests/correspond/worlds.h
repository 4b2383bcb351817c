// Scenes and camera rigs on which noise and correspondences are tested.
#pragma once

#include <memory>
#include <vector>

#include "../render/scenes.h"
#include "patina/render/scene.h"

namespace patina::correspond::test {

namespace scenes = render::test;

/// A scene with the assets it points into.
struct World {
  std::unique_ptr<asset::Asset> asset, context;
  std::unique_ptr<render::Scene> scene;
};
World make_world(const std::vector<scenes::Part>& parts, const std::vector<scenes::Part>& context = {},
                 bool double_sided = false);

/// What an artist may do to UVs.
enum class UvState { kClean, kMirrored, kOverlapping, kTiled, kPoint, kMissing };
/// A unit sphere at the origin whose UVs are in that state.
World sphere_world(UvState state, int rings = 48);

/// Square cameras around the origin at these azimuths (degrees), elevation 20°, field of view 35°, a sphere
/// of `radius` just fits.
std::vector<render::Camera> cameras_at(const std::vector<float>& azimuths_degrees, int resolution,
                                       float radius = 1.0f);

}  // namespace patina::correspond::test
