// A 3D asset in memory: triangles in world space, glTF 2.0 materials, their images and lights, and the file
// it came from.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "patina/base/math.h"
#include "patina/image/image.h"

namespace patina::asset {

enum class Wrap { kRepeat, kClampToEdge, kMirroredRepeat };
enum class AlphaMode { kOpaque, kMask, kBlend };

/// How a material slot refers to an image: `image` indexes Asset::images (-1: none), `uv_transform` is
/// KHR_texture_transform as a matrix on (u, v, 1), `uv_set` chooses TEXCOORD_n after the extension's
/// override.
struct TextureRef {
  int image = -1;
  int uv_set = 0;
  mat3 uv_transform{1.0f};
  Wrap wrap_s = Wrap::kRepeat;
  Wrap wrap_t = Wrap::kRepeat;

  explicit operator bool() const { return image >= 0; }
};

/// glTF 2.0 metallic-roughness [glTF2, Sec. 3.9]. Factors are linear.
struct Material {
  std::string name;
  vec4 base_color_factor{1.0f};
  TextureRef base_color;  // sRGB RGB, linear A
  float metallic_factor = 1.0f;
  float roughness_factor = 1.0f;
  TextureRef metallic_roughness;  // roughness in G, metallic in B
  TextureRef normal;              // tangent space, +Y up
  float normal_scale = 1.0f;
  TextureRef occlusion;        // carried, not rendered: the path tracer computes occlusion
  vec3 emissive_factor{0.0f};  // times KHR_materials_emissive_strength
  TextureRef emissive;         // sRGB
  AlphaMode alpha_mode = AlphaMode::kOpaque;
  float alpha_cutoff = 0.5f;
  bool double_sided = false;
};

/// One instance of one mesh primitive, flattened into world space. Arrays are per vertex; empty where the
/// file has none (normals and, for materials with a normal map, tangents are always made).
struct Primitive {
  std::string name;                   // mesh name, for messages
  int material = 0;                   // index into Asset::materials
  std::vector<vec3> p_world;          // metres, relative to Asset::origin
  std::vector<vec3> n_world;          // unit shading normals
  std::vector<vec4> tangent_world;    // xyz unit tangent, w the bitangent's sign; b = w · cross(n, t)
  std::vector<std::vector<vec2>> uv;  // [set][vertex], origin top left
  std::vector<vec4> color;            // COLOR_0, linear, multiplies base colour and alpha
  std::vector<uvec3> triangles;       // counter-clockwise seen from the front, also under mirrored transforms
};

enum class LightKind { kDirectional, kPoint, kSpot };

/// KHR_lights_punctual in world space.
struct Light {
  LightKind kind = LightKind::kPoint;
  vec3 color{1.0f};        // linear
  float intensity = 1.0f;  // candela (point, spot) or lux (directional)
  float range = 0.0f;      // metres, 0: unlimited
  vec3 p_world{0.0f};      // relative to Asset::origin
  vec3 direction_world{0, 0, -1};
  float inner_cone_angle = 0.0f, outer_cone_angle = kPi / 4;  // radians
};

/// The bytes an asset came from, kept so that export can carry everything over. Opaque outside of asset/.
struct SourceDocument;

struct Asset {
  std::filesystem::path path;
  glm::dvec3 origin{0.0};  // in the file's world, metres; not zero only for assets that lie far from theirs
  std::vector<Primitive> primitives;
  std::vector<Material> materials;  // at least one: the default material is appended if a primitive needs it
  std::vector<Image> images;        // values as stored in the file, [0,1]
  std::vector<std::string> image_names;  // for messages and texture file names
  std::vector<Light> lights;
  std::vector<std::string> extensions_used;
  std::vector<std::string> warnings;  // what was read but is not honoured
  std::shared_ptr<const SourceDocument> source;
};

/// Reads .glb, .gltf or .obj by its content. Throws Error (kNotFound, kFormat, kUnsupported, kLimit) that
/// names the file, the JSON path or line, what was expected and what was found. No file outside the asset's
/// folder is opened.
Asset read_asset(const std::filesystem::path& path);
/// The same, `file` being the content of `path`, which need not exist.
Asset read_asset(const std::filesystem::path& path, std::vector<uint8_t> file);

/// The file itself and those that it names, found or not.
std::vector<std::filesystem::path> files_of(const Asset& asset);

/// Positions and lights relative to another origin; the asset stays where it is in the world.
void set_origin(Asset& asset, const glm::dvec3& origin);

/// Axis-aligned bounds over all primitives, metres. Throws Error{kFormat} if there is no surface or it has no
/// size.
struct Bounds {
  vec3 min, max;
  float sphere_radius = 0;  // of the smallest sphere about center() that holds every vertex; 0: not known
  vec3 center() const { return 0.5f * (min + max); }
  /// Radius of a sphere about center() that holds everything: never larger than half the box's diagonal.
  float radius() const { return sphere_radius > 0 ? sphere_radius : 0.5f * glm::length(max - min); }
};
Bounds bounds(const Asset& asset);

/// Throws Error{kFormat} where nothing can be enhanced: no surface, no size, nothing visible, or no texture
/// coordinates on any mesh (the message says how to get them). Meshes without UVs beside others that have
/// them are left as they are.
void require_enhanceable(const Asset& asset);

}  // namespace patina::asset
