// glTF and GLB out: the source's JSON text with few members changed, its buffers as they were, new images
// behind them or beside the file. An image that only the changed slot uses is replaced in its place; any
// other keeps its users and the slot gets a new one.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "patina/asset/export.h"
#include "patina/asset/gltf_container.h"
#include "patina/asset/json_patch.h"
#include "patina/asset/texture_bake.h"
#include "patina/asset/uri.h"
#include "patina/base/check.h"
#include "patina/base/files.h"
#include "patina/base/portable_math.h"
#include "patina/image/image_header.h"
#include "patina/image/image_io.h"

namespace patina::asset {
namespace {

using Json = nlohmann::ordered_json;

size_t array_size(const nlohmann::json& root, const char* name) {
  const auto found = root.find(name);
  return found == root.end() ? 0 : found->size();
}

// How many texture slots use each texture, and how many textures each image.
struct UseCounts {
  std::vector<int> of_texture, of_image;

  explicit UseCounts(const nlohmann::json& root)
      : of_texture(array_size(root, "textures"), 0), of_image(array_size(root, "images"), 0) {
    if (root.contains("materials")) count_slots(root["materials"]);
    if (root.contains("textures"))
      for (const auto& texture : root["textures"]) count_sources(texture);
    if (root.contains("extensions"))
      count_sources(root["extensions"]);  // image-based lights name images directly
  }

 private:
  // Any object under a name that ends in "Texture" is a slot, also inside extensions.
  void count_slots(const nlohmann::json& json) {
    if (!json.is_structured()) return;
    for (const auto& [name, value] : json.items()) {
      if (value.is_object() && name.ends_with("Texture") && value.contains("index") &&
          value["index"].is_number_unsigned()) {
        const auto index = value["index"].get<size_t>();
        if (index < of_texture.size()) ++of_texture[index];
      }
      count_slots(value);
    }
  }

  // Every "source" (a texture's, also in its extensions) and every number in arrays of image-based lights.
  void count_sources(const nlohmann::json& json) {
    if (!json.is_structured()) return;
    for (const auto& [name, value] : json.items()) {
      const bool names_image = name == "source" || name == "specularImages" || json.is_array();
      if (names_image && value.is_number_unsigned() && value.get<size_t>() < of_image.size())
        ++of_image[value.get<size_t>()];
      count_sources(value);
    }
  }
};

bool same_mapping(const TextureRef& ref, const Map& map) {
  return ref.uv_set == map.uv_set && ref.uv_transform == map.uv_transform && ref.wrap_s == map.wrap_s &&
         ref.wrap_t == map.wrap_t;
}

int wrap_number(Wrap wrap) {
  return wrap == Wrap::kClampToEdge ? 33071 : wrap == Wrap::kMirroredRepeat ? 33648 : 10497;
}

// A matrix as KHR_texture_transform's offset, rotation and scale.
Json transform_json(const mat3& m, const std::string& name) {
  const float scale_x = std::hypot(m[0].x, m[0].y);
  const float angle = portable::atan2(-m[0].y, m[0].x);
  const float c = std::cos(angle), s = std::sin(angle);
  const float scale_y = s * m[1].x + c * m[1].y, shear = c * m[1].x - s * m[1].y;
  if (std::abs(shear) > 1e-4f * std::max(scale_x, std::abs(scale_y)))
    throw Error(ErrorCode::kUnsupported, name,
                "a sheared texture transform cannot be written as KHR_texture_transform");
  return {{"offset", {m[2].x, m[2].y}}, {"rotation", angle}, {"scale", {scale_x, scale_y}}};
}

class GltfExporter {
 public:
  explicit GltfExporter(const ExportRequest& request)
      : request_(request),
        d_(*request.asset.source),
        root_(d_.json),
        to_glb_(request.plan.kind == OutputKind::kGlb),
        uses_(root_),
        sidecars_(request),
        num_textures_(array_size(root_, "textures")),
        num_images_(array_size(root_, "images")),
        num_views_(array_size(root_, "bufferViews")),
        num_samplers_(array_size(root_, "samplers")) {}

  void write() {
    if (to_glb_) begin_bin();
    for (size_t i = 0; i < request_.asset.materials.size(); ++i)
      if (request_.changed[i].any()) write_material(i);
    if (plan().packs_everything) pack_images();
    carry_over_files();
    std::vector<uint8_t> file;
    if (to_glb_) {
      end_bin();
      const bool identity = patch_.empty() && d_.kind == SourceDocument::Kind::kGlb;
      file =
          identity ? d_.file : glb_bytes(patched_json(d_.json_text(), patch_), bin_, request_.path.string());
    } else {
      unpack_bin();
      const std::string text = patched_json(d_.json_text(), patch_);
      file.assign(text.begin(), text.end());
    }
    sidecars_.write();
    write_file(request_.path, std::span<const uint8_t>(file));
  }

 private:
  const Asset& asset() const { return request_.asset; }
  const ExportPlan& plan() const { return request_.plan; }
  bool was_replaced(size_t image) const {
    return std::find(replaced_.begin(), replaced_.end(), image) != replaced_.end();
  }

  // ---- materials and textures ----

  void write_material(size_t i) {
    const Material& material = asset().materials[i];
    const MaterialMaps& maps = request_.maps[i];
    const MapSet& changed = request_.changed[i];
    const BakedMaterial out = baked(asset(), material, request_.before[i], maps, changed);
    const bool is_new = i >= array_size(root_, "materials");
    const nlohmann::json old = is_new ? nlohmann::json::object() : root_["materials"][i];
    const std::string name = material.name.empty() ? fmt::format("material{}", i) : material.name;

    JsonPatch patch = JsonPatch::object();
    if (out.base_color) {
      JsonPatch& pbr = patch["pbrMetallicRoughness"];
      set_texture(pbr["baseColorTexture"], material.base_color, maps.base_color, *out.base_color,
                  slot(old, "baseColorTexture"), name, "base_color", 1);
      if (out.base_color_factor != vec3(material.base_color_factor))
        pbr["baseColorFactor"] = {out.base_color_factor.r, out.base_color_factor.g, out.base_color_factor.b,
                                  material.base_color_factor.a};
    }
    if (out.metallic_roughness) {
      JsonPatch& pbr = patch["pbrMetallicRoughness"];
      const bool has_roughness = has(changed, MapSlot::kRoughness);
      const Map& map = has_roughness ? maps.roughness : maps.metallic;
      const bool one_only = has_roughness != has(changed, MapSlot::kMetallic);
      if (one_only && material.metallic_roughness && !same_mapping(material.metallic_roughness, map))
        throw Error(ErrorCode::kUnsupported, request_.path.string(),
                    fmt::format("material '{}': roughness and metallic share one texture, so one of them "
                                "cannot be moved to other UVs alone",
                                printable(name, 60)));
      const auto *packed = slot(old, "metallicRoughnessTexture"), *occlusion = slot(old, "occlusionTexture");
      const bool occlusion_too = packed && occlusion && (*packed)["index"] == (*occlusion)["index"];
      set_texture(pbr["metallicRoughnessTexture"], material.metallic_roughness, map, *out.metallic_roughness,
                  packed, name, "metallic_roughness", occlusion_too ? 2 : 1);
      if (out.roughness_factor != material.roughness_factor) pbr["roughnessFactor"] = out.roughness_factor;
      if (out.metallic_factor != material.metallic_factor) pbr["metallicFactor"] = out.metallic_factor;
    }
    if (out.normal) {
      JsonPatch& info = patch["normalTexture"];
      set_texture(info, material.normal, maps.normal, *out.normal, slot(old, "normalTexture"), name, "normal",
                  1);
      if (out.normal_scale != material.normal_scale) info["scale"] = out.normal_scale;
    }
    prune(patch);
    if (patch.empty()) return;
    if (!is_new) {
      patch_["materials"][std::to_string(i)] = std::move(patch);
      return;
    }
    patch["name"] = name;
    patch_["materials"]["+"].push_back(patch);
    give_material_to_bare_primitives(i);
  }

  // A texture slot of a material as the file has it, or null.
  static const nlohmann::json* slot(const nlohmann::json& material, const char* name) {
    const auto pbr = material.find("pbrMetallicRoughness");
    for (const nlohmann::json* parent : {&material, pbr == material.end() ? nullptr : &*pbr})
      if (parent && parent->contains(name)) return &(*parent)[name];
    return nullptr;
  }

  // Empty objects that indexing has made, where nothing had to change.
  static void prune(JsonPatch& patch) {
    for (auto it = patch.begin(); it != patch.end();) {
      if (it->is_object()) prune(*it);
      if (it->is_object() && it->empty())
        it = patch.erase(it);
      else
        ++it;
    }
  }

  // Puts `image` into a slot. `own_uses` counts the slots of this material that may share the texture and are
  // served by the new image too.
  void set_texture(JsonPatch& info, const TextureRef& ref, const Map& map, const Image& image,
                   const nlohmann::json* old, const std::string& material, const std::string& slot_name,
                   int own_uses) {
    std::vector<uint8_t> bytes = encode_png(image);
    info = JsonPatch::object();
    const bool keeps_mapping = ref && old && same_mapping(ref, map);
    const size_t texture = keeps_mapping ? (*old)["index"].get<size_t>() : 0;
    if (keeps_mapping) {
      const auto source = static_cast<size_t>(ref.image);
      if (uses_.of_texture[texture] == own_uses && uses_.of_image[source] == 1 &&
          !root_["textures"][texture].contains("extensions")) {
        replace_image(source, std::move(bytes), material, slot_name);
        return;
      }
    }
    Json new_texture = {{"source", add_image(std::move(bytes), material, slot_name)}};
    if (keeps_mapping) {
      if (const auto& before = root_["textures"][texture]; before.contains("sampler"))
        new_texture["sampler"] = before["sampler"];
    } else if (map.wrap_s != Wrap::kRepeat || map.wrap_t != Wrap::kRepeat) {
      patch_["samplers"]["+"].push_back(
          {{"wrapS", wrap_number(map.wrap_s)}, {"wrapT", wrap_number(map.wrap_t)}});
      new_texture["sampler"] = num_samplers_++;
    }
    patch_["textures"]["+"].push_back(std::move(new_texture));
    info["index"] = num_textures_++;
    if (keeps_mapping) return;
    info["texCoord"] = map.uv_set;
    if (map.uv_transform != mat3(1.0f)) {
      info["extensions"] = {
          {"KHR_texture_transform", {{"=", transform_json(map.uv_transform, request_.path.string())}}}};
      use_extension("KHR_texture_transform");
    } else if (old && old->contains("extensions") && (*old)["extensions"].contains("KHR_texture_transform")) {
      info["extensions"]["KHR_texture_transform"] = nullptr;
    }
  }

  void use_extension(const std::string& name) {
    if (!extension_added_ && std::find(asset().extensions_used.begin(), asset().extensions_used.end(),
                                       name) == asset().extensions_used.end())
      patch_["extensionsUsed"]["+"].push_back(name);
    extension_added_ = true;
  }

  size_t add_image(std::vector<uint8_t> bytes, const std::string& material, const std::string& slot_name) {
    Json image;
    if (to_glb_)
      image = {
          {"bufferView", add_view(bytes)}, {"mimeType", "image/png"}, {"name", material + "_" + slot_name}};
    else
      image = {{"uri", percent_encoded(sidecars_.add_texture(material, slot_name, std::move(bytes)))}};
    patch_["images"]["+"].push_back(std::move(image));
    return num_images_++;
  }

  void replace_image(size_t index, std::vector<uint8_t> bytes, const std::string& material,
                     const std::string& slot_name) {
    replaced_.push_back(index);
    Json image;
    if (to_glb_) {
      image = {{"bufferView", add_view(bytes)}, {"mimeType", "image/png"}, {"uri", nullptr}};
    } else {
      image = {{"uri", percent_encoded(sidecars_.add_texture(material, slot_name, std::move(bytes)))},
               {"bufferView", nullptr}};
      if (root_["images"][index].contains("mimeType")) image["mimeType"] = "image/png";
    }
    patch_["images"][std::to_string(index)] = std::move(image);
  }

  void give_material_to_bare_primitives(size_t index) {
    const nlohmann::json empty = nlohmann::json::array();
    const nlohmann::json& meshes = root_.contains("meshes") ? root_["meshes"] : empty;
    for (size_t m = 0; m < meshes.size(); ++m)
      for (size_t p = 0; p < meshes[m]["primitives"].size(); ++p)
        if (!meshes[m]["primitives"][p].contains("material"))
          patch_["meshes"][std::to_string(m)]["primitives"][std::to_string(p)]["material"] = index;
  }

  // ---- the GLB's BIN chunk ----

  void begin_bin() {
    if (plan().packs_everything) return pack_buffers();
    bin_.assign(d_.file.begin() + static_cast<std::ptrdiff_t>(d_.bin_begin),
                d_.file.begin() + static_cast<std::ptrdiff_t>(d_.bin_end));
  }

  // All buffers with data become one, the first. Those without (only a compression extension could fill them)
  // follow behind it.
  void pack_buffers() {
    struct Place {
      size_t buffer, offset;
    };
    std::vector<Place> places;
    Json buffers = Json::array({Json::object()});
    for (size_t i = 0; i < d_.buffers.size(); ++i) {
      if (d_.buffers[i].bytes.empty()) {
        places.push_back({buffers.size(), 0});
        buffers.push_back(Json::parse(root_["buffers"][i].dump()));
        continue;
      }
      if (buffers[0].empty()) buffers[0] = Json::parse(root_["buffers"][i].dump());
      align_bin();
      places.push_back({0, bin_.size()});
      bin_.insert(bin_.end(), d_.buffers[i].bytes.begin(), d_.buffers[i].bytes.end());
    }
    const auto moved = [&](const nlohmann::json& at) -> Json {
      const Place& place = places[at["buffer"].get<size_t>()];
      return {{"buffer", place.buffer}, {"byteOffset", at.value("byteOffset", size_t{0}) + place.offset}};
    };
    const auto stays = [&](const nlohmann::json& at) {
      const auto buffer = at["buffer"].get<size_t>();
      return places[buffer].buffer == buffer && places[buffer].offset == 0;
    };
    for (size_t v = 0; v < num_views_; ++v) {
      const auto& view = root_["bufferViews"][v];
      if (!stays(view)) patch_["bufferViews"][std::to_string(v)] = moved(view);
      for (const char* name : {"EXT_meshopt_compression", "KHR_meshopt_compression"}) {
        if (!view.contains("extensions") || !view["extensions"].contains(name)) continue;
        const auto& compressed = view["extensions"][name];
        if (names_buffer(compressed) && !stays(compressed))
          patch_["bufferViews"][std::to_string(v)]["extensions"][name] = moved(compressed);
      }
    }
    if (d_.buffers.empty()) return;
    if (buffers.size() == 1 && d_.buffers.size() == 1) {
      patch_["buffers"]["0"]["uri"] = nullptr;
      return;
    }
    if (bin_.empty()) bin_.assign(4, 0);  // a buffer must have bytes
    buffers[0].erase("uri");
    buffers[0]["byteLength"] = bin_.size();
    patch_["buffers"]["="] = std::move(buffers);
  }

  bool names_buffer(const nlohmann::json& json) const {
    return json.is_object() && json.contains("buffer") && json["buffer"].is_number_unsigned() &&
           json["buffer"].get<size_t>() < d_.buffers.size() &&
           (!json.contains("byteOffset") || json["byteOffset"].is_number_unsigned());
  }

  // Every image becomes part of the GLB, unless it was replaced just now or cannot be read.
  void pack_images() {
    for (size_t i = 0; i < array_size(root_, "images"); ++i) {
      const auto& left = plan().left_images;
      if (!root_["images"][i].contains("uri") || was_replaced(i) ||
          std::find(left.begin(), left.end(), i) != left.end())
        continue;
      const EncodedImage encoded = encoded_image(d_, i);
      Json image = {{"uri", nullptr}, {"bufferView", add_view(encoded.bytes)}};
      const std::string type(mime_type(encoded.bytes));
      if (root_["images"][i].value("mimeType", "") != type) image["mimeType"] = type;
      patch_["images"][std::to_string(i)] = std::move(image);
    }
  }

  void align_bin() { bin_.resize((bin_.size() + 3) / 4 * 4, 0); }

  size_t add_view(std::span<const uint8_t> bytes) {
    align_bin();
    patch_["bufferViews"]["+"].push_back(
        {{"buffer", 0}, {"byteOffset", bin_.size()}, {"byteLength", bytes.size()}});
    bin_.insert(bin_.end(), bytes.begin(), bytes.end());
    bin_grew_ = true;
    return num_views_++;
  }

  void end_bin() {
    if (!bin_grew_) return;
    if (d_.buffers.empty())
      patch_["buffers"]["+"] = Json::array({Json{{"byteLength", bin_.size()}}});
    else if (patch_.contains("buffers") && patch_["buffers"].contains("="))
      patch_["buffers"]["="][0]["byteLength"] = bin_.size();
    else
      patch_["buffers"]["0"]["byteLength"] = bin_.size();
  }

  // ---- files beside the output ----

  // A GLB's own chunk becomes a file beside the .gltf.
  void unpack_bin() {
    if (!has_bin(d_)) return;
    const std::string name = sidecars_.add(request_.path.stem().string(), ".bin",
                                           {d_.buffers[0].bytes.begin(), d_.buffers[0].bytes.end()});
    patch_["buffers"]["0"]["uri"] = percent_encoded(name);
  }

  // Files that the output still refers to.
  void carry_over_files() {
    if (!plan().packs_everything)
      for (const SourceBuffer& buffer : d_.buffers)
        if (!buffer.reference.empty()) sidecars_.carry_over(buffer.reference);
    for (size_t i = 0; i < array_size(root_, "images"); ++i) {
      const auto& left = plan().left_images;
      const bool packed = plan().packs_everything && std::find(left.begin(), left.end(), i) == left.end();
      if (packed || was_replaced(i)) continue;
      if (const auto reference = image_reference(d_, i)) sidecars_.carry_over(*reference);
    }
  }

  const ExportRequest& request_;
  const SourceDocument& d_;
  const nlohmann::json& root_;
  bool to_glb_;
  UseCounts uses_;
  SidecarFiles sidecars_;
  JsonPatch patch_ =
      JsonPatch::object();  // members lie in a vector: no reference into it survives an insertion
  size_t num_textures_, num_images_, num_views_, num_samplers_;
  std::vector<size_t> replaced_;
  std::vector<uint8_t> bin_;
  bool bin_grew_ = false, extension_added_ = false;
};

}  // namespace

void export_gltf(const ExportRequest& request) {
  GltfExporter(request).write();
}

}  // namespace patina::asset
