// Small scenes made by formula, for tests of the renderer.
#pragma once

#include "patina/asset/asset.h"
#include "patina/asset/material_maps.h"
#include "patina/render/camera.h"

namespace patina::render::test {

/// A material of constant maps.
struct Constant {
  vec3 base_color{0.5f};
  float roughness = 1.0f, metallic = 0.0f;
  vec3 emission{0.0f};
  float alpha = 1.0f;
  asset::AlphaMode alpha_mode = asset::AlphaMode::kOpaque;
};
asset::Material material(const Constant& constant);
asset::MaterialMaps maps(const Constant& constant);

/// Triangles with UV set 0 and no material yet (index 0). Winding: counter-clockwise seen from outside / from
/// +normal.
asset::Primitive sphere(const vec3& center, float radius, int rings);
/// A parallelogram with corners origin, origin + a, origin + a + b, origin + b; its front faces cross(a, b).
asset::Primitive quad(const vec3& origin, const vec3& a, const vec3& b);
/// A square of side 2·half in the plane y = `height`, centred on the y axis, facing up.
asset::Primitive floor(float half, float height = 0.0f);

/// An asset of primitives, each with its own constant material.
struct Part {
  asset::Primitive primitive;
  Constant constant;
};
asset::Asset make_asset(const std::vector<Part>& parts);
std::vector<asset::MaterialMaps> make_maps(const std::vector<Part>& parts);

}  // namespace patina::render::test
