// OBJ out: the source's text with its material libraries merged into one beside it, in which only the
// statements of changed materials differ; and OBJ to GLB, where a glTF document is made from the meshes as
// they were read.
#include <algorithm>
#include <map>
#include <set>

#include <fmt/format.h>

#include "patina/asset/export.h"
#include "patina/asset/mtl_reader.h"
#include "patina/asset/obj_files.h"
#include "patina/asset/obj_text.h"
#include "patina/asset/texture_bake.h"
#include "patina/base/files.h"
#include "patina/base/text.h"
#include "patina/base/utf8.h"
#include "patina/image/image_io.h"

namespace patina::asset {
namespace {

namespace fs = std::filesystem;
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
  const BakedMaterial out = baked(request.asset, material, request.before[i], maps, changed);
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

// A texture statement as it has to stand beside the output: names are relative to the library's folder, which
// may lie below the asset's, and files that were found elsewhere are named where they are. Empty where the
// line can stay as it is.
std::string moved_statement(const TextLine& line, const SourceDocument& d, const fs::path& base) {
  if (!names_picture(lowered(line.keyword))) return "";
  const TextureStatement parsed = texture_statement(line.rest);
  const auto found = parsed.file.empty() ? std::nullopt : find_named_file(d.folder(), base, parsed.file);
  if (!found || (base.empty() && found->as_written)) return "";
  return fmt::format("{} {}{}", line.keyword, parsed.options, found->relative.generic_string());
}

// One library's text as it stands beside the output, with the statements of changed materials put in behind
// their newmtl and the old ones taken out. `written` notes which materials that were.
std::string changed_library(const SourceDocument& d, const std::string& reference,
                            const std::map<std::string, Statements>& by_material,
                            std::set<std::string>& written) {
  const std::string text = read_mtl_text(d.folder() / reference);
  std::string out;
  size_t at = 0;
  std::vector<std::string> replaced;  // keywords that the current material gets anew
  const auto take_to = [&](size_t end) {
    out.append(text, at, end - at);
    at = end;
  };
  for (const TextLine& line : text_lines(text)) {
    const std::string keyword = lowered(line.keyword);
    if (keyword == "newmtl") {
      replaced.clear();
      const auto found = by_material.find(line.rest);
      if (found == by_material.end()) continue;
      for (const auto& [name, unused] : found->second) replaced.push_back(lowered(name));
      take_to(line.next);
      if (!out.ends_with('\n') && !out.ends_with('\r')) out += '\n';
      out += joined(found->second);
      written.insert(line.rest);
    } else if (std::find(replaced.begin(), replaced.end(), keyword) != replaced.end()) {
      take_to(line.begin);
      at = line.next;
    } else if (const std::string moved = moved_statement(line, d, fs::path(reference).parent_path());
               !moved.empty()) {
      take_to(line.begin);
      out += moved;
      at = line.end;
    }
  }
  take_to(text.size());
  if (out.starts_with("\xEF\xBB\xBF")) out.erase(0, 3);
  if (!out.empty() && !out.ends_with('\n') && !out.ends_with('\r')) out += '\n';
  return out;
}

// The OBJ text that names `library` in place of its own libraries, and gives a material to faces before the
// first usemtl.
std::string with_library(std::string_view text, const std::string& library,
                         const std::string& first_material) {
  const char* line_end = text.find('\n') == text.npos && text.find('\r') != text.npos ? "\r" : "\n";
  std::string out = "mtllib " + library + line_end;
  if (!first_material.empty()) out += "usemtl " + first_material + line_end;
  size_t at = text.starts_with("\xEF\xBB\xBF") ? 3 : 0;
  for (const TextLine& line : text_lines(text)) {
    if (line.keyword != "mtllib") continue;
    out.append(text.substr(at, line.begin - at));
    at = line.next;
  }
  return out.append(text.substr(at));
}

// The stem of a library's file name that every reader takes for one word.
std::string library_stem(const fs::path& output) {
  std::string name = output.stem().string();
  for (char& c : name)
    if (static_cast<unsigned char>(c) <= ' ' || c == '"' || c == '#' || c == '\\' || c == 0x7F) c = '_';
  return name + ".patina";
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
  void use_extension(const std::string& name) {
    Json& used = root_["extensionsUsed"];
    if (std::find(used.begin(), used.end(), name) == used.end()) used.push_back(name);
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
  builder.use_extension("KHR_texture_transform");
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
  const BakedMaterial out = baked(asset, m, request.before[i], maps, changed);
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
  if (strength > 1.0f) {
    json["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"] = strength;
    builder.use_extension("KHR_materials_emissive_strength");
  }
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
  SidecarFiles sidecars(request);
  for (const std::string& reference : d.references)
    if (!request.any_changed() ||
        std::find(d.mtl_references.begin(), d.mtl_references.end(), reference) == d.mtl_references.end())
      sidecars.carry_over(reference);
  if (!request.any_changed()) {
    sidecars.write();
    return write_file(request.path, std::span<const uint8_t>(d.file));
  }
  const std::set<std::string> taken(d.material_names.begin(), d.material_names.end());
  std::string nameless;  // what faces without a material are given
  std::map<std::string, Statements> by_material;
  for (size_t i = 0; i < request.asset.materials.size(); ++i) {
    if (!request.changed[i].any()) continue;
    std::string name = d.material_names[i];
    if (name.empty()) {
      name = "default";
      while (taken.contains(name)) name += "_";
      nameless = name;
    }
    by_material[name] = statements_of(request, i, sidecars);
  }

  std::string library = "# textures by patina\n";
  std::set<std::string> written;
  for (const std::string& reference : d.mtl_references)
    library += changed_library(d, reference, by_material, written);
  // What no library knew: materials that faces name without a definition, and the one of faces that name
  // none.
  for (const auto& [name, statements] : by_material)
    if (!written.contains(name)) library += fmt::format("newmtl {}\n{}", name, joined(statements));
  const std::string name = sidecars.add(library_stem(request.path), ".mtl", {library.begin(), library.end()});
  sidecars.write();
  write_file(request.path, with_library(d.obj_text(), name, nameless));
}

void export_obj_as_glb(const ExportRequest& request) {
  GlbBuilder builder;
  Json& root = builder.root();  // its members lie in a vector: no reference to one survives an insertion
  root["scenes"] = Json::array({Json{{"nodes", {0}}}});
  root["nodes"] = Json::array({Json{{"mesh", 0}, {"name", as_utf8(request.asset.path.stem().string())}}});
  const glm::dvec3& origin = request.asset.origin;
  if (origin != glm::dvec3(0.0)) root["nodes"][0]["translation"] = {origin.x, origin.y, origin.z};
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
