// Scenes and camera rigs on which noise and correspondences are tested.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "../render/scenes.h"
#include "patina/correspond/noise_agreement.h"
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

/// What artists and exporters do to UVs.
enum class UvState {
  kClean,
  kSeams,        // every triangle is a chart of its own, anywhere on the texture
  kMirrored,     // left and right halves share texels
  kOverlapping,  // every ring of faces is the same strip
  kTiled,        // seven times across
  kTiny,         // the whole sphere on a tenth of a texel of 1024
  kHuge,         // ten thousand times across
  kPoint,        // one place for all: no UV area
  kNotFinite,    // every ninth vertex
  kMissing,
};
inline constexpr std::array kUvStates{
    UvState::kClean, UvState::kSeams, UvState::kMirrored, UvState::kOverlapping, UvState::kTiled,
    UvState::kTiny,  UvState::kHuge,  UvState::kPoint,    UvState::kNotFinite,   UvState::kMissing};
/// A unit sphere at the origin whose UVs are in that state. The same triangles in the same order for all.
World sphere_world(UvState state, int rings = 48);
/// The clean sphere whose texture is moved, turned and scaled by KHR_texture_transform.
World transformed_sphere_world(int rings = 48);
/// The clean sphere in bands of five materials, each a primitive, all with the same UVs.
World banded_sphere_world(int rings = 48);
/// The clean sphere with triangles of no area strewn among its own: points, needles and repeated corners.
World degenerate_sphere_world(int rings = 48);

/// Square cameras around the origin at these azimuths (degrees), elevation 20°, field of view 35°, a sphere
/// of `radius` just fits.
std::vector<render::Camera> cameras_at(const std::vector<float>& azimuths_degrees, int resolution,
                                       float radius = 1.0f);

/// How much of the correlation that two views can have at most their noise has.
inline double share_of_bound(const NoiseAgreement& agreement) {
  return agreement.bound > 0 ? agreement.correlation / agreement.bound : 0;
}

}  // namespace patina::correspond::test
