#include "patina/asset/extensions.h"

#include <algorithm>
#include <array>
#include <set>

namespace patina::asset {
namespace {

using enum ExtensionUse;

constexpr const char* kLook = "what it adds to the look is not rendered";
constexpr const char* kNoLook = "changes nothing in a still picture";
constexpr const char* kCompressed = "the mesh is decompressed for the views; its data stays as it was";

constexpr std::array kTable = {
    ExtensionRow{"ADOBE_materials_clearcoat_specular", kNoted, kLook},
    ExtensionRow{"ADOBE_materials_clearcoat_tint", kNoted, kLook},
    ExtensionRow{"ADOBE_materials_thin_transparency", kNoted, kLook},
    ExtensionRow{"AGI_articulations", kNoted, "the pose is that of the nodes"},
    ExtensionRow{"AGI_stk_metadata", kCarriedOver, kNoLook},
    ExtensionRow{"CESIUM_primitive_outline", kNoted, "outlines are not drawn"},
    ExtensionRow{"EXT_instance_features", kCarriedOver, kNoLook},
    ExtensionRow{"EXT_lights_ies", kNoted, "lights with measured profiles are not read"},
    ExtensionRow{"EXT_lights_image_based", kNoted, "the environment is the one that the user chooses"},
    ExtensionRow{"EXT_mesh_features", kCarriedOver, kNoLook},
    ExtensionRow{"EXT_mesh_gpu_instancing", kObeyed, "every instance is in the views"},
    ExtensionRow{"EXT_mesh_manifold", kCarriedOver, kNoLook},
    ExtensionRow{"EXT_meshopt_compression", kObeyed, kCompressed},
    ExtensionRow{"EXT_structural_metadata", kCarriedOver, kNoLook},
    ExtensionRow{"EXT_texture_avif", kNoted, "the PNG or JPEG beside it is read"},
    ExtensionRow{"EXT_texture_procedurals_mx_1_39", kNoted, "procedural textures are not read"},
    ExtensionRow{"EXT_texture_webp", kNoted, "the PNG or JPEG beside it is read"},
    ExtensionRow{"FB_geometry_metadata", kCarriedOver, kNoLook},
    ExtensionRow{"GODOT_single_root", kCarriedOver, kNoLook},
    ExtensionRow{"GRIFFEL_bim_data", kCarriedOver, kNoLook},
    ExtensionRow{"KHR_accessor_float64", kRefused, "export with single precision"},
    ExtensionRow{"KHR_animation_pointer", kCarriedOver, "views show the asset at rest"},
    ExtensionRow{"KHR_audio_graph", kCarriedOver, kNoLook},
    ExtensionRow{"KHR_collision_shapes", kCarriedOver, kNoLook},
    ExtensionRow{"KHR_draco_mesh_compression", kObeyed, kCompressed},
    ExtensionRow{"KHR_gaussian_splatting", kRefused, "splats have no surface to texture"},
    ExtensionRow{"KHR_interactivity", kCarriedOver, "views show the asset at rest"},
    ExtensionRow{"KHR_lights_punctual", kObeyed, "the lights light the views"},
    ExtensionRow{"KHR_materials_anisotropy", kNoted, kLook},
    ExtensionRow{"KHR_materials_clearcoat", kNoted, kLook},
    ExtensionRow{"KHR_materials_diffuse_transmission", kNoted, kLook},
    ExtensionRow{"KHR_materials_dispersion", kNoted, kLook},
    ExtensionRow{"KHR_materials_emissive_strength", kObeyed, "emission is multiplied by it"},
    ExtensionRow{"KHR_materials_ior", kNoted, kLook},
    ExtensionRow{"KHR_materials_iridescence", kNoted, kLook},
    ExtensionRow{"KHR_materials_pbrSpecularGlossiness", kRefused, "convert it to metallic-roughness"},
    ExtensionRow{"KHR_materials_sheen", kNoted, kLook},
    ExtensionRow{"KHR_materials_specular", kNoted, kLook},
    ExtensionRow{"KHR_materials_subsurface", kNoted, kLook},
    ExtensionRow{"KHR_materials_transmission", kNoted, kLook},
    ExtensionRow{"KHR_materials_unlit", kNoted, "the material is lit like any other"},
    ExtensionRow{"KHR_materials_variants", kCarriedOver, "the default variant is in the views"},
    ExtensionRow{"KHR_materials_volume", kNoted, kLook},
    ExtensionRow{"KHR_mesh_quantization", kObeyed, "small integers are read as the numbers they stand for"},
    ExtensionRow{"KHR_meshopt_compression", kObeyed,
                 "as EXT_meshopt_compression; version 1 of its codec and filtered colours are refused"},
    ExtensionRow{"KHR_node_hoverability", kCarriedOver, kNoLook},
    ExtensionRow{"KHR_node_selectability", kCarriedOver, kNoLook},
    ExtensionRow{"KHR_node_visibility", kObeyed, "hidden nodes and all below them are left out of the views"},
    ExtensionRow{"KHR_physics_rigid_bodies", kCarriedOver, kNoLook},
    ExtensionRow{"KHR_techniques_webgl", kRefused, "materials are shader programs"},
    ExtensionRow{"KHR_texture_basisu", kNoted, "the PNG or JPEG beside it is read"},
    ExtensionRow{"KHR_texture_procedurals", kNoted, "procedural textures are not read"},
    ExtensionRow{"KHR_texture_transform", kObeyed, "textures lie where it puts them"},
    ExtensionRow{"KHR_texture_video", kNoted, "the still picture beside it is read"},
    ExtensionRow{"KHR_xmp", kCarriedOver, kNoLook},
    ExtensionRow{"KHR_xmp_json_ld", kCarriedOver, kNoLook},
    ExtensionRow{"MPEG_accessor_timed", kRefused, "its data comes from a stream"},
    ExtensionRow{"MPEG_animation_timing", kCarriedOver, "views show the asset at rest"},
    ExtensionRow{"MPEG_audio_spatial", kCarriedOver, kNoLook},
    ExtensionRow{"MPEG_buffer_circular", kRefused, "its data comes from a stream"},
    ExtensionRow{"MPEG_media", kCarriedOver, "nothing is streamed"},
    ExtensionRow{"MPEG_mesh_linking", kNoted, "meshes stand as the file has them"},
    ExtensionRow{"MPEG_scene_dynamic", kNoted, "the views show the scene of the file"},
    ExtensionRow{"MPEG_texture_video", kNoted, "the still picture beside it is read"},
    ExtensionRow{"MPEG_viewport_recommended", kCarriedOver, kNoLook},
    ExtensionRow{"MSFT_lod", kNoted,
                 "the views show the finest level; coarser ones keep their meshes and materials"},
    ExtensionRow{"MSFT_packing_normalRoughnessMetallic", kNoted, "its packed texture stays as it was"},
    ExtensionRow{"MSFT_packing_occlusionRoughnessMetallic", kNoted, "its packed textures stay as they were"},
    ExtensionRow{"MSFT_texture_dds", kNoted, "the PNG or JPEG beside it is read"},
    ExtensionRow{"NV_materials_mdl", kNoted, "metallic-roughness beside it is read"},
};

static_assert(std::is_sorted(kTable.begin(), kTable.end(), [](const ExtensionRow& a, const ExtensionRow& b) {
  return std::string_view(a.name) < b.name;
}));

void collect(const nlohmann::json& json, std::set<std::string>& names) {
  if (!json.is_structured()) return;
  if (json.is_object())
    if (const auto found = json.find("extensions"); found != json.end() && found->is_object())
      for (const auto& [name, unused] : found->items()) names.insert(name);
  for (const auto& value : json) collect(value, names);
}

}  // namespace

std::span<const ExtensionRow> extension_table() {
  return kTable;
}

const ExtensionRow* find_extension(std::string_view name) {
  const auto found =
      std::lower_bound(kTable.begin(), kTable.end(), name,
                       [](const ExtensionRow& row, std::string_view n) { return row.name < n; });
  return found != kTable.end() && found->name == name ? &*found : nullptr;
}

std::vector<std::string> extensions_in(const nlohmann::json& json) {
  std::set<std::string> names;
  collect(json, names);
  if (const auto used = json.find("extensionsUsed"); used != json.end() && used->is_array())
    for (const auto& name : *used)
      if (name.is_string()) names.insert(name.get<std::string>());
  return {names.begin(), names.end()};
}

}  // namespace patina::asset
