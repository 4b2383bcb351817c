#include "patina/asset/gltf_materials.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "patina/asset/extensions.h"
#include "patina/asset/gltf_container.h"
#include "patina/asset/uri.h"
#include "patina/base/parallel.h"
#include "patina/base/utf8.h"
#include "patina/image/image_header.h"
#include "patina/image/image_io.h"

namespace patina::asset {
namespace {

std::optional<JsonView> extension(const JsonView& json, std::string_view name) {
  const auto extensions = json.find("extensions");
  return extensions ? extensions->find(name) : std::nullopt;
}

Wrap wrap_of(const JsonView& json, std::vector<std::string>& warnings) {
  switch (json.integer(INT32_MIN, INT32_MAX)) {
    case 33071:
      return Wrap::kClampToEdge;
    case 33648:
      return Wrap::kMirroredRepeat;
    case 10497:
      return Wrap::kRepeat;
    default:
      warnings.push_back(json.where() + ": unknown wrap mode, taken as repeat");
      return Wrap::kRepeat;
  }
}

// KHR_texture_transform: translation · rotation · scale on (u, v, 1); positive rotation takes +u towards -v.
mat3 transform_of(const JsonView& json) {
  const auto vec2_or = [&](std::string_view key, const vec2& otherwise) {
    const auto found = json.find(key);
    return found ? found->vector<vec2>() : otherwise;
  };
  const vec2 offset = vec2_or("offset", vec2(0.0f)), scale = vec2_or("scale", vec2(1.0f));
  const auto rotation = json.find("rotation");
  const float angle = rotation ? static_cast<float>(rotation->number()) : 0.0f;
  const float c = std::cos(angle), s = std::sin(angle);
  return mat3(vec3(c * scale.x, -s * scale.x, 0.0f), vec3(s * scale.y, c * scale.y, 0.0f),
              vec3(offset, 1.0f));
}

// The extensions that give a texture another kind of image than PNG or JPEG.
constexpr std::array kImageExtensions = {"KHR_texture_basisu", "EXT_texture_webp", "EXT_texture_avif",
                                         "MSFT_texture_dds"};

// A texture whose image patina cannot read is an error where a mesh shows it, else a note.
TextureRef texture_ref(const SourceDocument& d, const JsonView& info, bool is_shown,
                       std::vector<std::string>& warnings) {
  TextureRef ref;
  const auto textures = d.root().find("textures");
  const size_t index = info.at("index").index(textures ? textures->size() : 0, "texture");
  if (const auto set = info.find("texCoord")) ref.uv_set = static_cast<int>(set->integer(0, 15));
  if (const auto transform = extension(info, "KHR_texture_transform")) {
    ref.uv_transform = transform_of(*transform);
    if (const auto set = transform->find("texCoord")) ref.uv_set = static_cast<int>(set->integer(0, 15));
  }
  const JsonView texture = (*textures)[index];
  if (const auto sampler_index = texture.find("sampler")) {
    const auto samplers = d.root().find("samplers");
    const JsonView sampler =
        (samplers ? *samplers : d.root())[sampler_index->index(samplers ? samplers->size() : 0, "sampler")];
    if (const auto wrap = sampler.find("wrapS")) ref.wrap_s = wrap_of(*wrap, warnings);
    if (const auto wrap = sampler.find("wrapT")) ref.wrap_t = wrap_of(*wrap, warnings);
  }
  const auto source = texture.find("source");
  if (!source) {
    for (const char* name : kImageExtensions)
      if (extension(texture, name) && is_shown)
        texture.fail(fmt::format("its image exists only through the extension {}, which patina does not "
                                 "read; convert it to PNG or JPEG",
                                 name),
                     ErrorCode::kUnsupported);
    warnings.push_back(texture.where() + ": has no image and is left out");
    return {};
  }
  const auto images = d.root().find("images");
  ref.image = static_cast<int>(source->index(images ? images->size() : 0, "image"));
  return ref;
}

void warn_of_unread_extensions(const JsonView& material, std::vector<std::string>& warnings) {
  const auto extensions = material.find("extensions");
  if (!extensions || !extensions->json().is_object()) return;
  std::string names;
  for (const auto& [name, unused] : extensions->json().items()) {
    const ExtensionRow* row = find_extension(name);
    if (!row || (row->use != ExtensionUse::kObeyed && row->use != ExtensionUse::kCarriedOver))
      names += (names.empty() ? "" : ", ") + printable(name, 60);
  }
  if (!names.empty()) warnings.push_back(material.where() + ": carried over but not rendered: " + names);
}

Material read_material(const SourceDocument& d, const JsonView& json, bool is_shown,
                       std::vector<std::string>& warnings) {
  Material m;
  const auto unit_number = [&](const JsonView& parent, std::string_view key, float otherwise) {
    const auto found = parent.find(key);
    if (!found) return otherwise;
    const double value = found->number();
    if (value < 0 || value > 1) warnings.push_back(found->where() + ": is outside of [0, 1] and is clamped");
    return static_cast<float>(std::clamp(value, 0.0, 1.0));
  };
  const auto texture = [&](const JsonView& parent, std::string_view key) {
    const auto found = parent.find(key);
    return found ? texture_ref(d, *found, is_shown, warnings) : TextureRef{};
  };
  if (const auto name = json.find("name")) m.name = short_name(name->string());
  if (const auto pbr = json.find("pbrMetallicRoughness")) {
    if (const auto factor = pbr->find("baseColorFactor")) {
      m.base_color_factor = factor->vector<vec4>();
      const vec4 clamped = glm::clamp(m.base_color_factor, 0.0f, 1.0f);
      if (clamped != m.base_color_factor)
        warnings.push_back(factor->where() + ": is outside of [0, 1] and is clamped");
      m.base_color_factor = clamped;
    }
    m.base_color = texture(*pbr, "baseColorTexture");
    m.metallic_factor = unit_number(*pbr, "metallicFactor", 1.0f);
    m.roughness_factor = unit_number(*pbr, "roughnessFactor", 1.0f);
    m.metallic_roughness = texture(*pbr, "metallicRoughnessTexture");
  } else if (extension(json, "KHR_materials_pbrSpecularGlossiness")) {
    warnings.push_back(json.where() +
                       ": is described by KHR_materials_pbrSpecularGlossiness alone, which is not read");
  }
  if (const auto normal = json.find("normalTexture")) {
    m.normal = texture_ref(d, *normal, is_shown, warnings);
    if (const auto scale = normal->find("scale")) m.normal_scale = static_cast<float>(scale->number());
  }
  m.occlusion = texture(json, "occlusionTexture");
  m.emissive = texture(json, "emissiveTexture");
  if (const auto factor = json.find("emissiveFactor"))
    m.emissive_factor = glm::max(factor->vector<vec3>(), 0.0f);
  if (const auto strength = extension(json, "KHR_materials_emissive_strength"))
    if (const auto value = strength->find("emissiveStrength"))
      m.emissive_factor *= std::max(static_cast<float>(value->number()), 0.0f);
  if (const auto mode = json.find("alphaMode")) {
    const std::string& text = mode->string();
    if (text == "MASK")
      m.alpha_mode = AlphaMode::kMask;
    else if (text == "BLEND")
      m.alpha_mode = AlphaMode::kBlend;
    else if (text != "OPAQUE")
      mode->fail("expected OPAQUE, MASK or BLEND, found '" + printable(text, 40) + "'");
  }
  if (const auto cutoff = json.find("alphaCutoff"))
    m.alpha_cutoff = std::max(static_cast<float>(cutoff->number()), 0.0f);
  if (const auto sided = json.find("doubleSided")) m.double_sided = sided->boolean();
  warn_of_unread_extensions(json, warnings);
  return m;
}

// Materials that some mesh uses. What is wrong with the textures of any other is a note.
std::set<int> materials_of_meshes(const nlohmann::json& root) {
  std::set<int> used;
  const auto meshes = root.find("meshes");
  if (meshes == root.end() || !meshes->is_array()) return used;
  for (const auto& mesh : *meshes) {
    if (!mesh.is_object() || !mesh.contains("primitives") || !mesh["primitives"].is_array()) continue;
    for (const auto& primitive : mesh["primitives"])
      if (primitive.is_object() && primitive.contains("material") &&
          primitive["material"].is_number_integer())
        used.insert(primitive["material"].get<int>());
  }
  return used;
}

std::array<TextureRef*, 5> textures_of(Material& m) {
  return {&m.base_color, &m.metallic_roughness, &m.normal, &m.occlusion, &m.emissive};
}

struct PendingImage {
  size_t index;
  std::string where;
  EncodedImage encoded;
  ImageHeader header;
  Image decoded;  // already, where no mesh shows it: whether it can be is known then
};

// Bytes of the image, or the note that stands in for them: a file that is not there costs its texture, not
// the asset, and an image that no mesh shows may be broken in any way.
std::optional<PendingImage> pending_image(const SourceDocument& d, size_t index, bool is_shown,
                                          Asset& asset) {
  const JsonView image = d.root().at("images")[index];
  try {
    PendingImage pending{index, image.where(), encoded_image(d, index), {}, {}};
    pending.header = inspect_image(pending.encoded.bytes, pending.where);
    if (!is_shown) pending.decoded = decode_image(pending.encoded.bytes, pending.where);
    return pending;
  } catch (const Error& e) {
    if (is_shown && e.code() != ErrorCode::kNotFound) throw;
    asset.warnings.push_back(fmt::format("{}; materials go without it, and it stays as it is in the output",
                                         std::string(e.what())));
    return std::nullopt;
  }
}

// Keeps the name of an image that is not there if it stands for one file a UDIM tile.
void note_tiles(SourceDocument& d, int image, Asset& asset) {
  const auto uri = d.root().at("images")[static_cast<size_t>(image)].find("uri");
  if (!uri) return;
  const std::string file = percent_decoded(uri->string(), uri->where());
  if (!names_tiles(file)) return;
  for (Material& m : asset.materials)
    for (const TextureRef* ref : textures_of(m))
      if (ref->image == image)
        return d.tiled_textures.push_back({m.name, file, tiles_on_disk(d.folder(), "", file)});
}

// Decodes the images that materials refer to, several at a time.
void read_images(SourceDocument& d, Asset& asset, const std::set<int>& shown_materials) {
  const auto images = d.root().find("images");
  if (!images) return;
  const size_t count = images->size();
  asset.images.resize(count);
  asset.image_names.resize(count);
  d.image_files.resize(count);
  std::set<int> used, shown;
  for (size_t m = 0; m < asset.materials.size(); ++m)
    for (const TextureRef* ref : textures_of(asset.materials[m])) {
      if (!*ref) continue;
      used.insert(ref->image);
      if (shown_materials.contains(static_cast<int>(m))) shown.insert(ref->image);
    }

  std::vector<PendingImage> pending;
  const uint64_t allowed = memory_budget(source_bytes(d)).image_bytes;
  uint64_t encoded_bytes = 0, decoded_bytes = 0;
  for (size_t i = 0; i < count; ++i) {
    const JsonView image = (*images)[i];
    if (const auto name = image.find("name")) asset.image_names[i] = short_name(name->string());
    if (!used.contains(static_cast<int>(i))) continue;
    auto found = pending_image(d, i, shown.contains(static_cast<int>(i)), asset);
    if (!found) {
      if (shown.contains(static_cast<int>(i))) note_tiles(d, static_cast<int>(i), asset);
      for (Material& m : asset.materials)
        for (TextureRef* ref : textures_of(m))
          if (ref->image == static_cast<int>(i)) *ref = {};
      continue;
    }
    pending.push_back(*std::move(found));
    const PendingImage& p = pending.back();
    d.image_files[i] = p.encoded.reference;
    if (asset.image_names[i].empty())
      asset.image_names[i] = short_name(as_utf8(std::filesystem::path(p.encoded.reference).stem().string()));
    encoded_bytes += p.encoded.reference.empty() ? 0 : p.encoded.bytes.size();
    decoded_bytes += uint64_t{4} * static_cast<uint64_t>(p.header.width) *
                     static_cast<uint64_t>(p.header.height) * static_cast<uint64_t>(p.header.channels);
    if (decoded_bytes > allowed + 200 * encoded_bytes)
      image.fail(fmt::format("the images up to this one decode to {} MiB, more than files of this size may",
                             decoded_bytes >> 20),
                 ErrorCode::kLimit);
  }
  parallel_for(0, static_cast<int64_t>(pending.size()), 1, [&](int64_t begin, int64_t end) {
    for (auto k = static_cast<size_t>(begin); k < static_cast<size_t>(end); ++k) {
      PendingImage& p = pending[k];
      asset.images[p.index] =
          p.decoded.empty() ? decode_image(p.encoded.bytes, p.where) : std::move(p.decoded);
      p.encoded.bytes = {};
    }
  });
}

}  // namespace

Material default_material() {
  Material m;
  m.name = "default";
  return m;
}

std::string short_name(const std::string& name) {
  constexpr size_t kMaxLength = 200;
  if (name.size() <= kMaxLength) return name;
  size_t end = kMaxLength;
  while (end > 0 && (static_cast<unsigned char>(name[end]) & 0xC0u) == 0x80u)
    --end;  // not inside a UTF-8 sequence
  return name.substr(0, end);
}

void read_materials(SourceDocument& d, Asset& asset) {
  const std::set<int> shown = materials_of_meshes(d.json);
  if (const auto materials = d.root().find("materials"))
    for (size_t i = 0; i < materials->size(); ++i)
      asset.materials.push_back(
          read_material(d, (*materials)[i], shown.contains(static_cast<int>(i)), asset.warnings));
  read_images(d, asset, shown);
}

}  // namespace patina::asset
