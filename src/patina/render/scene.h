// What can be rendered: the asset and its context as triangles in Embree, materials, lights, environment.
#pragma once

#include <array>
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
  float offset = 0;  // metres: how far along n_geometric a new ray must start not to meet this surface again
  vec3 n_geometric;  // unit, on the side the ray came from
  vec3 n_interpolated;      // unit vertex normal, flipped where needed to n_geometric's side
  vec3 tangent, bitangent;  // with n_interpolated the frame in which the normal map is read (right-handed or
                            // mirrored); flipped together with it
  vec3 n_shading;           // normal map applied, kept where wo sees it (visible_shading_normal)
  bool front_face = true;
  int material = 0;  // into Scene::materials()
  std::vector<vec2>::size_type num_uv_sets = 0;
  std::array<vec2, 4> uv{};  // up to four UV sets as the mesh has them
  vec3 vertex_color{1.0f};   // multiplies the base colour map
  BsdfParams bsdf;           // maps evaluated, vertex colour applied
  vec3 emission{0.0f};       // W/m²/sr
};

/// The ray that leaves a surface toward the unit vector `direction`, above or below.
Ray spawn_ray(const SurfacePoint& point, const vec3& direction);
/// The same with t_max just short of `p_target`, itself a point of a surface: for asking whether one sees the
/// other.
Ray spawn_segment(const SurfacePoint& point, const vec3& p_target);

class Lights;

/// Owns the Embree scene; geometry never changes after construction, materials may be replaced. Refers to
/// `asset` and `context`, which must live and stay as they are for as long as the scene does. All const
/// members may be called from many threads. Surfaces are rendered from both sides whatever `double_sided`
/// says: culling back faces, as rasterisers do, would let light through closed walls. Emission leaves both
/// sides too.
class Scene {
 public:
  struct Options {
    BsdfModel bsdf_model = BsdfModel::kGltf;
  };

  /// `maps` has one entry a material of `asset`. `context` (or null) is rendered, casts shadows and light,
  /// and is never enhanced.
  Scene(const asset::Asset& asset, std::vector<asset::MaterialMaps> maps, Environment environment,
        const asset::Asset* context, const Options& options);
  Scene(const asset::Asset& asset, std::vector<asset::MaterialMaps> maps, Environment environment)
      : Scene(asset, std::move(maps), std::move(environment), nullptr, Options{}) {}
  ~Scene();
  Scene(Scene&&) noexcept;
  Scene& operator=(Scene&&) noexcept;

  /// First surface along the ray. Masked texels below their cutoff are passed through; blended ones count as
  /// hit with probability alpha: `u_alpha` in [0,1) decides (0.5: alpha above one half; through several
  /// layers, the one at which the opacity gathered so far passes one half).
  std::optional<Hit> intersect(const Ray& ray, float u_alpha = 0.5f) const;
  /// True if anything lies between t_min and t_max; alpha as above.
  bool occluded(const Ray& ray, float u_alpha = 0.5f) const;
  SurfacePoint surface(const Ray& ray, const Hit& hit) const { return surface(ray, hit, asset_materials()); }
  /// The same with other maps of the asset than the scene's own (num_asset_materials entries). Opacity and
  /// emission are still the scene's where rays are cast and lights are sampled, so they must be the same.
  SurfacePoint surface(const Ray& ray, const Hit& hit,
                       std::span<const asset::MaterialMaps> asset_materials) const;

  /// Number of primitives (they come first) and materials that belong to the asset and not to the context.
  int num_asset_primitives() const;
  int num_asset_materials() const;
  const std::vector<const asset::Primitive*>& primitives() const;  // asset's, then context's
  const std::vector<asset::MaterialMaps>& materials() const;       // asset's, then context's
  std::span<const asset::MaterialMaps> asset_materials() const;    // the first num_asset_materials of them
  /// Replaces the asset's materials (num_asset_materials entries).
  void set_asset_materials(std::vector<asset::MaterialMaps> maps);
  const Environment& environment() const;
  std::span<const asset::Light> lights() const;  // the asset's punctual lights, then the context's
  /// Samples everything that gives light: environment, emissive triangles, punctual lights.
  const Lights& light_sampler() const;
  /// Bounds of all geometry.
  asset::Bounds bounds() const;
  /// Whether some surface lets a part of the light through (alpha mode BLEND).
  bool has_blended() const;
  BsdfModel bsdf_model() const;

  struct State;  // scene_state.h

 private:
  std::unique_ptr<State> state_;
};

}  // namespace patina::render
