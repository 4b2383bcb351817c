// The data of patina-mini in memory: objects seen by cameras with light and geometry kept apart from
// materials, and photographed materials. What compose.h makes training samples of.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "mini_data/shard.h"
#include "patina/base/math.h"

namespace patina::mini_data {

/// Pixels a side of a view, and texels a side of a material.
inline constexpr int kViewSide = 256, kTextureSide = 256;

/// What is known of every pixel of a view. Objects are scaled and moved so that the unit sphere holds them.
/// Outside the object every plane but the coverage goes on smoothly.
enum ViewPlane {
  kCoverage,  // share of the pixel that the object fills
  kNormalX,   // shading normal in the camera's frame, ½ + ½ n; z follows and points to the camera
  kNormalY,
  kDepth,            // (depth along the viewing axis − (distance − 1)) / 2
  kOcclusion,        // share of the cosine-weighted hemisphere that is open
  kCrevice,          // the same with walls farther than a quarter counted as open
  kCurvatureFine,    // mean curvature of the surface, averaged over about 0.03; ½ is flat, 1 a sharp convex
                     // edge
  kCurvatureCoarse,  // averaged over about 0.12
  kFlow,             // how much would drip or run down to here from ledges and crevices above
  kLightR,           // radiance of a white diffuse surface under the light straight from the environment
  kLightG,
  kLightB,
  kBounce,  // what a white object adds to that by its own reflections, as a share of it (½ of the share)
  kLightX,  // unit vector toward the mean of the diffuse light, camera's frame, ½ + ½ d
  kLightY,
  kLightZ,
  kGloss0R,  // mean radiance that a glossy surface of kGlossRoughness[0] gathers (no Fresnel term), then
  kNumViewPlanes = kGloss0R + 9,  // green and blue, then the other two roughnesses
};
/// Perceptual roughnesses for which gathered radiance is kept; at 1 it is nearly that of diffuse light.
inline constexpr std::array<float, 3> kGlossRoughness{0.15f, 0.35f, 0.65f};

/// Radiance is kept as √(x / (1 + x)): fine in the dark, bounded in the bright. x is in units of the object's
/// mean diffuse light (log-average over its views).
inline float light_code(float x) {
  return std::sqrt(x / (1.0f + x));
}
inline float light_of_code(float code) {
  const float c = square(glm::clamp(code, 0.0f, 0.999f));
  return c / (1.0f - c);
}

struct ViewData {
  mat3 world_from_camera{1.0f};
  float distance = 0;           // from the eye to the centre of the unit sphere, on the axis
  float fov_y = 0;              // radians
  std::vector<uint8_t> planes;  // [kNumViewPlanes, H, W], 255 means 1; kDepth is empty here
  std::vector<float> depth;     // [H, W], kDepth
};

/// The environment blurred to the lobes of kGlossRoughness, as if nothing stood in the way.
inline constexpr int kGlossMapHeight = 32, kGlossMapWidth = 64;

struct ObjectData {
  std::string name;
  std::vector<std::string> words;  // what it may be called in a caption
  std::string environment;
  bool held_out = false;           // its shape or its environment is for testing only
  std::vector<ViewData> views;     // at equal steps of azimuth
  std::vector<uint8_t> gloss_map;  // [9, kGlossMapHeight, kGlossMapWidth] light codes, as Environment maps
};

enum MaterialPlane {
  kBaseR,
  kBaseG,
  kBaseB,
  kSurfaceX,
  kSurfaceY,
  kRoughness,
  kMetallic,
  kHeight,
  kNumMaterialPlanes
};

struct MaterialData {
  std::string name, material_class, words;
  bool held_out = false;
  bool is_mask = false;         // class grunge: only kHeight says something, white is dirt or scratch
  std::vector<uint8_t> planes;  // [kNumMaterialPlanes, H, W]; colour sRGB, normals ½ + ½ n
};

struct Dataset {
  std::vector<ObjectData> objects;
  std::vector<MaterialData> materials;
};

/// Which part of the data: held-out shapes, environments and materials are never mixed with the others.
enum class Part { kTraining, kHeldOut, kAll };

/// Reads every *.shard of `folder`. Throws Error{kNotFound, kFormat} naming shard and entry.
Dataset read_dataset(const std::filesystem::path& folder, Part part);

/// Between entries and data; `material_entry` takes [8][256²] planes as in MaterialPlane.
Entry view_entry(const std::string& object, int index, const ViewData& camera,
                 const std::vector<std::vector<float>>& planes);
Entry object_entry(const ObjectData& object, const std::vector<std::vector<float>>& gloss_map);
Entry material_entry(const MaterialData& material, const std::vector<std::vector<float>>& planes,
                     const nlohmann::json& credit);

}  // namespace patina::mini_data
