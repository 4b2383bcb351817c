// Material maps: the values of a material at every texel, factors multiplied in, linear. The renderer reads
// them, inverse rendering changes them, export writes them back.
#pragma once

#include <array>
#include <bitset>
#include <filesystem>
#include <initializer_list>
#include <span>
#include <string>
#include <vector>

#include "patina/asset/asset.h"

namespace patina::asset {

/// One map and where it lies: texel values are *effective* (factor × texture) and linear.
/// A slot with no texture is a map of 1 × 1 texel.
struct Map {
  Image texels;
  int uv_set = 0;
  mat3 uv_transform{1.0f};
  Wrap wrap_s = Wrap::kRepeat;
  Wrap wrap_t = Wrap::kRepeat;
};

struct MaterialMaps {
  std::string name;
  Map base_color;  // [3] linear Rec. 709, [0,1]
  Map alpha;       // [1] [0,1]
  Map roughness;   // [1] perceptual roughness, [0,1]
  Map metallic;    // [1] [0,1]
  Map normal;      // [3] unit vectors in tangent space, z > 0; (0,0,1) where there is no normal map
  Map emission;    // [3] linear, W/m²/sr
  AlphaMode alpha_mode = AlphaMode::kOpaque;
  float alpha_cutoff = 0.5f;
  bool double_sided = false;
};

/// The maps that a fit may change and export may write, in the order of every table over them (map_slots.h).
enum class MapSlot : uint8_t { kBaseColor, kRoughness, kMetallic, kNormal };
inline constexpr size_t kNumMapSlots = 4;
constexpr size_t index_of(MapSlot slot) {
  return static_cast<size_t>(slot);
}

/// Some of these maps: those that a fit may change, those that it has changed and export shall write.
using MapSet = std::bitset<kNumMapSlots>;
constexpr MapSet set_of(std::initializer_list<MapSlot> slots) {
  unsigned long long bits = 0;
  for (const MapSlot slot : slots) bits |= 1ull << index_of(slot);
  return MapSet(bits);
}
inline bool has(const MapSet& set, MapSlot slot) {
  return set[index_of(slot)];
}

/// One entry a material of the asset, in order.
std::vector<MaterialMaps> resolve_materials(const Asset& asset);

/// `uv` as the mesh has it → the map's own UV (transform applied, not wrapped).
inline vec2 map_uv(const Map& map, const vec2& uv) {
  return vec2(map.uv_transform * vec3(uv, 1.0f));
}

/// The four texels and weights of a bilinear look-up at `uv_map` (from map_uv), wrap modes applied. Indices
/// are pixel offsets y·width + x, weights sum to one: the same look-up serves reading and splatting
/// gradients.
struct BilinearTap {
  std::array<int, 4> texel;
  std::array<float, 4> weight;
};
BilinearTap bilinear_tap(const Map& map, const vec2& uv_map);
/// Whether one tap serves both maps at any point of the surface. Maps of a material mostly share their
/// layout.
bool same_layout(const Map& a, const Map& b);

/// Value of a map with 1 or 3 channels, by a tap of its layout or by its own.
float read1(const Map& map, const BilinearTap& tap);
vec3 read3(const Map& map, const BilinearTap& tap);
float sample1(const Map& map, const vec2& uv_map);
vec3 sample3(const Map& map, const vec2& uv_map);

/// `map` resampled to width × height texels (area-averaged down, bilinear up, wrap modes honoured; normals
/// renormalised by the caller).
Map resized(const Map& map, int width, int height);

/// Writes the asset with the changed maps of its materials to `path` (.glb, .gltf or .obj by extension;
/// textures of .gltf and .obj beside it). maps and changed have one entry a material. Materials without a
/// change, and every other byte of JSON and buffers (extensions, extras, animation, skins, names), are
/// carried over as they were. Packed channels (occlusion), samplers, texture transforms and texCoord are
/// kept; images shared with an unchanged slot are copied first. Atomic: the old file or the whole new one.
/// Throws Error{kIo, kUnsupported}.
void export_asset(const Asset& asset, std::span<const MaterialMaps> maps, std::span<const MapSet> changed,
                  const std::filesystem::path& path);

/// The UV set on which slots of a material get a texture that have none: set 0; where no mesh has area there,
/// the set of the material's own textures.
int texture_uv_set(const Asset& asset, int material);

/// What `patina info` tells of the UVs of one material, on the set that its textures use or would use; texel
/// figures on a 1024² raster of the unit tile (UVs wrapped).
struct UvState {
  int uv_set = 0;
  bool missing = false;       // no mesh part of the material has the set
  int parts_without = 0;      // mesh parts that lack it
  float covered = 0;          // share of the tile that some triangle covers
  float overlapping = 0;      // share of the covered texels that more than one triangle covers
  float mirrored = 0;         // share of triangles in the minority winding
  float zero_area = 0;        // share of triangles without UV area
  vec2 min{0.0f}, max{0.0f};  // range before wrapping
};
std::vector<UvState> uv_states(const Asset& asset);

}  // namespace patina::asset
