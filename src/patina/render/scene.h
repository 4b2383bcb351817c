// What can be rendered: the asset and its context as triangles in Embree, materials, lights, environment.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "patina/asset/asset.h"
#include "patina/asset/material_maps.h"
#include "patina/render/bsdf.h"
#include "patina/render/camera.h"
#include "patina/render/environment.h"

namespace patina::render {

/// A point where a ray met a triangle. `primitive` counts the asset's primitives first, then the context's.
struct Hit {
  uint32_t primitive = 0;
  uint32_t triangle = 0;
  vec2 barycentric{0.0f};  // weights of the triangle's second and third vertex
  float t = 0;             // metres along the ray
};

/// Everything about a hit that shading needs.
struct SurfacePoint {
  vec3 p_world;
  vec3 n_geometric;            // unit, on the side the ray came from
  vec3 n_interpolated;         // unit vertex normal, flipped with n_geometric
  vec3 tangent, bitangent;     // with n_interpolated the frame in which the normal map is read (right-handed or mirrored)
  vec3 n_shading;              // normal map applied, kept on wo's side
  bool front_face = true;
  int material = 0;            // into Scene::materials()
  std::vector<vec2>::size_type num_uv_sets = 0;
  std::array<vec2, 4> uv{};    // up to four UV sets as the mesh has them
  vec3 vertex_color{1.0f};     // multiplies the base colour map
  BsdfParams bsdf;             // maps evaluated, vertex colour applied
  vec3 emission{0.0f};         // W/m²/sr
};

/// Owns the Embree scene; geometry never changes after construction, materials may be replaced.
class Scene {
 public:
  struct Options {
    BsdfModel bsdf_model = BsdfModel::kGltf;
  };

  /// `maps` has one entry a material of `asset`. `context` (or null) is rendered, casts shadows and light, and is never enhanced.
  Scene(const asset::Asset& asset, std::vector<asset::MaterialMaps> maps, Environment environment,
        const asset::Asset* context, const Options& options);
  Scene(const asset::Asset& asset, std::vector<asset::MaterialMaps> maps, Environment environment)
      : Scene(asset, std::move(maps), std::move(environment), nullptr, Options{}) {}
  ~Scene();
  Scene(Scene&&) noexcept;
  Scene& operator=(Scene&&) noexcept;

  /// First surface along the ray. Masked texels below their cutoff are passed through; blended ones count as hit with
  /// probability alpha: `u_alpha` in [0,1) decides (0.5: alpha above one half).
  std::optional<Hit> intersect(const Ray& ray, float u_alpha = 0.5f) const;
  /// True if anything lies between t_min and t_max; alpha as above.
  bool occluded(const Ray& ray, float u_alpha = 0.5f) const;
  SurfacePoint surface(const Ray& ray, const Hit& hit) const;

  /// Number of primitives (they come first) and materials that belong to the asset and not to the context.
  int num_asset_primitives() const;
  int num_asset_materials() const;
  const std::vector<const asset::Primitive*>& primitives() const;   // asset's, then context's
  const std::vector<asset::MaterialMaps>& materials() const;        // asset's, then context's
  /// Replaces the asset's materials (num_asset_materials entries).
  void set_asset_materials(std::vector<asset::MaterialMaps> maps);
  const Environment& environment() const;
  std::span<const asset::Light> lights() const;
  BsdfModel bsdf_model() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace patina::render
