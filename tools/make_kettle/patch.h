// A piece of surface over the unit square and the island it gets in its material's texture.
#pragma once

#include <functional>
#include <string>

#include "curve.h"

namespace patina::kettle {

enum class MaterialId { kEnamel, kSteel, kWood };
inline constexpr int kNumMaterials = 3;

/// How the unit square (s, t) lies in the texture, so that a metre of surface gets about the same number of
/// texels everywhere.
///   strip: s runs right along the circumference, t down
///   disc:  t runs outward from inner_radius, s around; for what is seen from straight above or below
enum class IslandKind { kStrip, kDisc };

struct Patch {
  std::string name;
  MaterialId material = MaterialId::kEnamel;
  std::function<dvec3(double s, double t)>
      position;                  // metres, +Y up; s, t in [0,1], t in proportion to arc length
  int steps_s = 1, steps_t = 1;  // quads of the mesh
  IslandKind island = IslandKind::kStrip;
  double width = 0, height = 0;  // of the island, metres; of a strip: mean circumference × length
  double inner_radius = 0;       // of a disc, metres
  bool painted_line = false;     // whether the enamel carries the cream line
  // Set by the packing: the island's corner in the unit square, and texture lengths a metre.
  glm::dvec2 uv_corner{0.0};
  double uv_scale = 0;
};

/// Texture coordinates in [0,1]², origin top left.
dvec2 uv_at(const Patch& patch, double s, double t);

/// The inverse, clamped to the patch: which point of the surface a texel in or beside the island shows.
struct Parameter {
  double s, t;
};
Parameter parameter_at(const Patch& patch, const dvec2& uv);

/// The surface point, its unit normal, and the unit direction in which the island's u grows (the glTF
/// tangent).
struct Frame {
  dvec3 position, normal, along_u;
};
Frame frame_at(const Patch& patch, double s, double t);

}  // namespace patina::kettle
