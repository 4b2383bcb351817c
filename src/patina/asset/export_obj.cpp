// OBJ out: the source's text with its material libraries merged into one beside it, in which only the
// statements of changed materials differ; and OBJ to GLB, where a glTF document is made from the meshes as
// they were read.
#include <algorithm>
#include <map>

#include <fmt/format.h>

#include "patina/asset/export.h"
#include "patina/asset/obj_text.h"
#include "patina/asset/texture_bake.h"
#include "patina/base/files.h"
#include "patina/base/text.h"
#include "patina/image/image_io.h"

namespace patina::asset {
namespace {

using Json = nlohmann::ordered_json;

Image channel_of(const Image& image, int channel) {
  Image out(image.width, image.height, 1);
  for (size_t i = 0; i < out.num_pixels(); ++i)
    out.pixels[i] = image.pixels[i * static_cast<size_t>(image.channels) + static_cast<size_t>(channel)];
  return out;
}

// -s and -o of an MTL texture statement; MTL's v points up.
std::string options_of(const Map& map, const std::string& name) {
  const mat3& m = map.uv_transform;
  if (m[0].y != 0 || m[1].x != 0)
    throw Error(ErrorCode::kUnsupported, name, "MTL cannot rotate a texture; export to .glb");
  std::string out;
  if (m[0].x != 1 || m[1].y != 1) out += fmt::format("-s {} {} 1 ", m[0].x, m[1].y);
  const vec2 offset(m[2].x, 1.0f - m[1].y - m[2].y);
  if (offset != vec2(0.0f)) out += fmt::format("-o {} {} 0 ", offset.x, offset.y);
  if (map.wrap_s == Wrap::kClampToEdge) out += "-clamp on ";
  return out;
}

// Statements that a changed material gets in place of its own, by lower-case keyword; an empty text only
// takes the old ones out.
using Statements = std::map<std::string, std::string>;

Statements statements_of(const ExportRequest& request, size_t i, SidecarFiles& sidecars) {
  const Material& material = request.asset.materials[i];
  const MaterialMaps& maps = request.maps[i];
  const MapSet& changed = request.changed[i];
  const BakedMaterial out = baked(request.asset, material, maps, changed);
  const std::string name = request.path.string();
  Statements statements;
  const auto texture = [&](const char* keyword, const char* slot, const Image& image, const Map& map) {
    statements[keyword] = fmt::format("{} {}{}", keyword, options_of(map, name),
                                      sidecars.add_texture(material.name, slot, encode_png(image)));
  };
  if (out.base_color) {
    texture("map_Kd", "base_color", *out.base_color, maps.base_color);
    const vec3& f = out.base_color_factor;
    statements["Kd"] = fmt::format("Kd {} {} {}", f.r, f.g, f.b);
  }
  if (has(changed, MapSlot::kRoughness)) {
    texture("map_Pr", "roughness", channel_of(*out.metallic_roughness, 1), maps.roughness);
    statements["Pr"] = fmt::format("Pr {}", out.roughness_factor);
  }
  if (has(changed, MapSlot::kMetallic)) {
    texture("map_Pm", "metallic", channel_of(*out.metallic_roughness, 2), maps.metallic);
    statements["Pm"] = fmt::format("Pm {}", out.metallic_factor);
  }
  if (out.normal) {
    const std::string scale = out.normal_scale == 1.0f ? "" : fmt::format("-bm {} ", out.normal_scale);
    texture("norm", "normal", *out.normal, maps.normal);
    statements["norm"].insert(5, scale);
    statements["map_Bump"] = statements["bump"] = statements["map_Kn"] = "";
  }
  return statements;
}

std::string joined(const Statements& statements) {
  std::string out;
  for (const auto& [keyword, text] : statements)
    if (!text.empty()) out += text + "\n";
  return out;
}

// One library's text with the statements of changed materials put in behind their newmtl and the old ones
// taken out.
std::string changed_library(const std::string& text, std::map<std::string, Statements>& by_material) {
  std::string out;
  size_t at = 0;
  std::vector<std::string> replaced;  // keywords that the current material gets anew
  for (const TextLine& line : text_lines(text)) {
    if (lowered(line.keyword) == "newmtl") {
      replaced.clear();
      const auto found = by_material.find(line.rest);
      if (found == by_material.end()) continue;
      for (const auto& [keyword, unused] : found->second) replaced.push_back(lowered(keyword));
      const size_t next = std::min(line.end + 1, text.size());
      out.append(text, at, next - at);
      if (!out.ends_with('\n')) out += '\n';
      out += joined(found->second);
      at = next;
      by_material.erase(found);
    } else if (std::find(replaced.begin(), replaced.end(), lowered(line.keyword)) != replaced.end()) {
      out.append(text, at, line.begin - at);
      at = std::min(line.end + 1, text.size());
    }
  }
  out.append(text, at);
  if (!out.empty() && !out.ends_with('\n')) out += '\n';
  return out;
}

// The OBJ text that names `library` in place of its own libraries, and gives a material to faces before the
// first usemtl.
std::string with_library(std::string_view text, const std::string& library,
                         const std::string& first_material) {
  std::string head = "mtllib " + library + "\n";
  if (!first_material.empty()) head += "usemtl " + first_material + "\n";
  std::string out = head;
  size_t at = text.starts_with("\xEF\xBB\xBF") ? 3 : 0;
  for (const TextLine& line : text_lines(text)) {
    if (line.keyword != "mtllib") continue;
    out.append(text.substr(at, line.begin - at));
    at = std::min(line.end + 1, text.size());
  }
  return out.append(text.substr(at));
}

// ---- OBJ to GLB
// ---------------------------------------------------------------------------------------------------

// Collects buffer views and accessors of a glTF document that is made from nothing.
class GlbBuilder {
 public:
  template <class T>
  size_t add_accessor(const std::vector<T>& values, const char* type, int component, int target) {
    const size_t view =
        add_bytes({reinterpret_cast<const uint8_t*>(values.data()), values.size() * sizeof(T)});
    root_["bufferViews"][view]["target"] = target;
    const bool is_index = component == 5125;
    root_["accessors"].push_back({{"bufferView", view},
                                  {"componentType", component},
                                  {"count", is_index ? values.size() * sizeof(T) / 4 : values.size()},
                                  {"type", type}});
    return root_["accessors"].size() - 1;
  }
  size_t add_bytes(std::span<const uint8_t> bytes) {
    bin_.resize((bin_.size() + 3) / 4 * 4, 0);
    root_["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", bin_.size()}, {"byteLength", bytes.size()}});
    bin_.insert(bin_.end(), bytes.begin(), bytes.end());
    return root_["bufferViews"].size() - 1;
  }
  // A texture with PNG `image`; its index.
  size_t add_texture(const Image& image, const std::string& name, const TextureRef& ref) {
    const size_t view = add_bytes(encode_png(image));
    root_["images"].push_back({{"bufferView", view}, {"mimeType", "image/png"}, {"name", name}});
    root_["textures"].push_back({{"source", root_["images"].size() - 1}});
    if (ref.wrap_s == Wrap::kClampToEdge) {
      root_["samplers"].push_back({{"wrapS", 33071}, {"wrapT", 33071}});
      root_["textures"].back()["sampler"] = root_["samplers"].size() - 1;
    }
    return root_["textures"].size() - 1;
  }
  Json& root() { return root_; }
  std::vector<uint8_t> file(const std::string& name) {
    root_["buffers"] = Json::array({Json{{"byteLength", bin_.size()}}});
    return glb_bytes(root_.dump(), bin_, name);
  }

 private:
  Json root_ = {{"asset", {{"version", "2.0"}, {"generator", "patina"}}}, {"scene", 0}};
  std::vector<uint8_t> bin_;
};

Json texture_info(GlbBuilder& builder, const Image& image, const std::string& name, const TextureRef& ref) {
  Json info = {{"index", builder.add_texture(image, name, ref)}};
  const mat3& m = ref.uv_transform;
  if (m == mat3(1.0f)) return info;
  info["extensions"]["KHR_texture_transform"] = {{"offset", {m[2].x, m[2].y}}, {"scale", {m[0].x, m[1].y}}};
  builder.root()["extensionsUsed"] = {"KHR_texture_transform"};
  return info;
}

TextureRef ref_of(const Map& map) {
  return {0, map.uv_set, map.uv_transform, map.wrap_s, map.wrap_t};
}

Json material_json(const ExportRequest& request, size_t i, GlbBuilder& builder) {
  const Asset& asset = request.asset;
  const Material& m = asset.materials[i];
  const MaterialMaps& maps = request.maps[i];
  const MapSet& changed = request.changed[i];
  const BakedMaterial out = baked(asset, m, maps, changed);
  const auto image_of = [&](const TextureRef& ref) -> const Image& {
    return asset.images[static_cast<size_t>(ref.image)];
  };
  Json pbr = Json::object();
  const vec3 factor = out.base_color ? out.base_color_factor : vec3(m.base_color_factor);
  pbr["baseColorFactor"] = {factor.r, factor.g, factor.b, m.base_color_factor.a};
  if (out.base_color)
    pbr["baseColorTexture"] =
        texture_info(builder, *out.base_color, m.name + "_base_color", ref_of(maps.base_color));
  else if (m.base_color)
    pbr["baseColorTexture"] =
        texture_info(builder, image_of(m.base_color), m.name + "_base_color", m.base_color);
  pbr["metallicFactor"] = out.metallic_roughness ? out.metallic_factor : m.metallic_factor;
  pbr["roughnessFactor"] = out.metallic_roughness ? out.roughness_factor : m.roughness_factor;
  if (out.metallic_roughness)
    pbr["metallicRoughnessTexture"] =
        texture_info(builder, *out.metallic_roughness, m.name + "_metallic_roughness",
                     ref_of(has(changed, MapSlot::kRoughness) ? maps.roughness : maps.metallic));
  else if (m.metallic_roughness)
    pbr["metallicRoughnessTexture"] = texture_info(builder, image_of(m.metallic_roughness),
                                                   m.name + "_metallic_roughness", m.metallic_roughness);
  Json json = {{"name", m.name}, {"pbrMetallicRoughness", std::move(pbr)}};
  if (out.normal || m.normal) {
    json["normalTexture"] = out.normal
                                ? texture_info(builder, *out.normal, m.name + "_normal", ref_of(maps.normal))
                                : texture_info(builder, image_of(m.normal), m.name + "_normal", m.normal);
    json["normalTexture"]["scale"] = out.normal ? out.normal_scale : m.normal_scale;
  }
  if (m.emissive)
    json["emissiveTexture"] = texture_info(builder, image_of(m.emissive), m.name + "_emissive", m.emissive);
  const float strength = std::max(1.0f, max_component(m.emissive_factor));
  if (m.emissive_factor != vec3(0.0f))
    json["emissiveFactor"] = {m.emissive_factor.r / strength, m.emissive_factor.g / strength,
                              m.emissive_factor.b / strength};
  if (m.alpha_mode == AlphaMode::kBlend) json["alphaMode"] = "BLEND";
  if (m.double_sided) json["doubleSided"] = true;
  return json;
}

Json primitive_json(const Primitive& p, GlbBuilder& builder) {
  constexpr int kFloat = 5126, kUint32 = 5125, kVertices = 34962, kIndices = 34963;
  Json attributes = {{"POSITION", builder.add_accessor(p.p_world, "VEC3", kFloat, kVertices)}};
  vec3 low = p.p_world[0], high = low;
  for (const vec3& q : p.p_world) low = glm::min(low, q), high = glm::max(high, q);
  Json& position = builder.root()["accessors"].back();
  position["min"] = {low.x, low.y, low.z};
  position["max"] = {high.x, high.y, high.z};
  attributes["NORMAL"] = builder.add_accessor(p.n_world, "VEC3", kFloat, kVertices);
  if (!p.tangent_world.empty())
    attributes["TANGENT"] = builder.add_accessor(p.tangent_world, "VEC4", kFloat, kVertices);
  for (size_t set = 0; set < p.uv.size(); ++set)
    attributes[fmt::format("TEXCOORD_{}", set)] = builder.add_accessor(p.uv[set], "VEC2", kFloat, kVertices);
  if (!p.color.empty()) attributes["COLOR_0"] = builder.add_accessor(p.color, "VEC4", kFloat, kVertices);
  return {{"attributes", std::move(attributes)},
          {"indices", builder.add_accessor(p.triangles, "SCALAR", kUint32, kIndices)},
          {"material", p.material}};
}

}  // namespace

void export_obj(const ExportRequest& request) {
  const SourceDocument& d = *request.asset.source;
  const std::string_view text(reinterpret_cast<const char*>(d.file.data()), d.file.size());
  SidecarFiles sidecars(request);
  for (const std::string& reference : d.references)
    if (!request.any_changed() ||
        std::find(d.mtl_references.begin(), d.mtl_references.end(), reference) == d.mtl_references.end())
      sidecars.carry_over(reference);
  if (!request.any_changed()) {
    sidecars.write();
    return write_file(request.path, std::span<const uint8_t>(d.file));
  }
  std::map<std::string, Statements> by_material;
  for (size_t i = 0; i < request.asset.materials.size(); ++i)
    if (request.changed[i].any())
      by_material[request.asset.materials[i].name] = statements_of(request, i, sidecars);

  std::string library = "# textures by patina\n";
  for (const std::string& reference : d.mtl_references)
    library += changed_library(read_text_file(d.folder() / reference), by_material);
  // What no library knew: materials that faces name without a definition, and the one of faces that name
  // none.
  const bool bare_faces = by_material.contains("default");
  for (const auto& [name, statements] : by_material)
    library += fmt::format("newmtl {}\n{}", name, joined(statements));
  const std::string library_name = request.path.stem().string() + ".patina.mtl";
  sidecars.add(library_name, {library.begin(), library.end()});
  sidecars.write();
  write_file(request.path, with_library(text, library_name, bare_faces ? "default" : ""));
}

void export_obj_as_glb(const ExportRequest& request) {
  GlbBuilder builder;
  Json& root = builder.root();  // its members lie in a vector: no reference to one survives an insertion
  root["scenes"] = Json::array({Json{{"nodes", {0}}}});
  root["nodes"] = Json::array({Json{{"mesh", 0}, {"name", request.asset.path.stem().string()}}});
  root["bufferViews"] = root["accessors"] = root["materials"] = Json::array();
  for (size_t i = 0; i < request.asset.materials.size(); ++i) {
    Json material = material_json(request, i, builder);
    root["materials"].push_back(std::move(material));
  }
  Json primitives = Json::array();
  for (const Primitive& p : request.asset.primitives)
    if (!p.triangles.empty()) primitives.push_back(primitive_json(p, builder));
  if (primitives.empty())
    throw Error(ErrorCode::kFormat, request.asset.path.string(),
                "the file has no faces, so there is nothing to export");
  root["meshes"] = Json::array({Json{{"primitives", std::move(primitives)}}});
  write_file(request.path, std::span<const uint8_t>(builder.file(request.path.string())));
}

}  // namespace patina::asset
