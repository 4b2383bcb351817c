#include "patina/asset/obj_materials.h"

#include <algorithm>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "patina/asset/gltf_materials.h"
#include "patina/asset/obj_text.h"
#include "patina/base/files.h"
#include "patina/base/utf8.h"
#include "patina/image/image_header.h"
#include "patina/image/image_io.h"

namespace patina::asset {
namespace {

void add_new(std::vector<std::string>& list, const std::string& item) {
  if (std::find(list.begin(), list.end(), item) == list.end()) list.push_back(item);
}

// A grey picture is a height field, a bluish one a normal map.
bool is_height(const Image& image) {
  if (image.channels < 3) return true;
  double red = 0, blue = 0;
  for (size_t i = 0; i < image.num_pixels(); ++i) {
    red += image.pixels[i * static_cast<size_t>(image.channels)];
    blue += image.pixels[i * static_cast<size_t>(image.channels) + 2];
  }
  return blue < 1.1 * red;
}

// The value that -imfchan takes out of a texel; grey pictures have it in every colour.
float channel_of(const float* texel, int channels, char channel) {
  const bool is_grey = channels < 3;
  switch (channel) {
    case 'g':
      return texel[is_grey ? 0 : 1];
    case 'b':
      return texel[is_grey ? 0 : 2];
    case 'm':
      return channels == 2 ? texel[1] : channels == 4 ? texel[3] : 1.0f;
    case 'l':
      return is_grey ? texel[0] : 0.2126f * texel[0] + 0.7152f * texel[1] + 0.0722f * texel[2];
    default:
      return texel[0];
  }
}

}  // namespace

void ObjMaterials::warn_once(const std::string& message) {
  add_new(asset_.warnings, message);
}

void ObjMaterials::read_libraries(const std::string& rest, const std::string& where) {
  const auto whole = find_named_file(document_.folder(), "", rest);
  if (whole && whole->as_written) return read_library(whole->relative);
  for (const std::string& name : separate_names(rest)) {
    if (name == "#") break;  // a comment behind the names
    const auto found = find_named_file(document_.folder(), "", name);
    if (!found) {
      missing_.push_back(
          fmt::format("{}: the material library '{}' does not exist", where, printable(name, 100)));
      continue;
    }
    if (!found->as_written)
      warn_once(fmt::format("{}: the material library '{}' is taken from '{}'", where, printable(name, 100),
                            printable(found->relative.string(), 100)));
    read_library(found->relative);
  }
}

void ObjMaterials::end_libraries() {
  if (missing_.empty()) return;
  const auto beside = find_named_file(document_.folder(), "", document_.path.stem().string() + ".mtl");
  for (const std::string& note : missing_)
    warn_once(beside
                  ? fmt::format("{}; '{}' is read in its place", note, printable(beside->relative.string()))
                  : note);
  if (beside) read_library(beside->relative);
}

void ObjMaterials::read_library(const std::filesystem::path& relative) {
  const std::string name = relative.string();
  const auto& known = document_.mtl_references;
  if (std::find(known.begin(), known.end(), name) != known.end()) return;
  document_.mtl_references.push_back(name);
  add_new(document_.references, name);
  MtlLibrary library = read_mtl(document_.name, document_.folder(), relative);
  for (const std::string& reference : library.references) add_new(document_.references, reference);
  for (const std::string& note : library.notes) warn_once(note);
  for (auto& [material_name, mtl] : library.materials) {
    if (numbers_.contains(material_name)) continue;
    const int index = add_material(material_name, mtl.material);
    unused_[static_cast<size_t>(index)] = std::move(mtl);
  }
}

int ObjMaterials::add_material(const std::string& name, Material material) {
  const int index = static_cast<int>(asset_.materials.size());
  asset_.materials.push_back(std::move(material));
  document_.material_names.push_back(name);
  unused_.emplace_back();
  numbers_[name] = index;
  for (const std::string& spelling : name_spellings(name)) aliases_.try_emplace(spelling, index);
  return index;
}

int ObjMaterials::named(const std::string& rest) {
  int index = -1;
  if (const auto known = numbers_.find(rest); known != numbers_.end()) index = known->second;
  for (const std::string& spelling : name_spellings(rest)) {
    if (index >= 0) break;
    if (const auto known = aliases_.find(spelling); known != aliases_.end()) index = known->second;
  }
  if (index < 0) {
    const std::string name = short_name(as_utf8(unquoted(rest)));
    warn_once(
        fmt::format("material '{}' is not in any material library that was read; it gets default values",
                    printable(name, 60)));
    Material material = default_material();
    material.name = name;
    material.metallic_factor = 0.0f;
    return add_material(rest, std::move(material));
  }
  if (auto mtl = std::exchange(unused_[static_cast<size_t>(index)], std::nullopt)) {
    if (mtl->tiled) document_.tiled_textures.push_back(*mtl->tiled);
    asset_.materials[static_cast<size_t>(index)] = with_textures(*std::move(mtl));
  }
  return index;
}

int ObjMaterials::nameless() {
  if (nameless_ >= 0) return nameless_;
  nameless_ = static_cast<int>(asset_.materials.size());
  asset_.materials.push_back(default_material());
  asset_.materials.back().metallic_factor = 0.0f;
  document_.material_names.emplace_back();
  unused_.emplace_back();
  return nameless_;
}

int ObjMaterials::image_index(const std::filesystem::path& path) {
  const std::string key = path.lexically_normal().string();
  const auto known = images_.find(key);
  if (known != images_.end()) return known->second;
  const auto bytes = read_file(path);
  const std::string where = document_.name + ": texture " + path.filename().string();
  const ImageHeader header = inspect_image(bytes, where);
  image_bytes_ += uint64_t{4} * static_cast<uint64_t>(header.width) * static_cast<uint64_t>(header.height) *
                  static_cast<uint64_t>(header.channels);
  encoded_bytes_ += bytes.size();
  if (image_bytes_ > memory_budget(document_.file.size() + encoded_bytes_).image_bytes)
    throw Error(ErrorCode::kLimit, where,
                "the images up to this one decode to more memory than files of this size may");
  return images_[key] = add_image(decode_image(bytes, where), path, path.stem().string());
}

int ObjMaterials::add_image(Image image, const std::filesystem::path& path, const std::string& name) {
  asset_.images.push_back(std::move(image));
  asset_.image_names.push_back(short_name(as_utf8(name)));
  document_.image_files.push_back(path.lexically_relative(document_.folder()).string());
  return static_cast<int>(asset_.images.size()) - 1;
}

TextureRef ObjMaterials::texture_ref(const MtlTexture& texture) {
  TextureRef ref;
  ref.image = image_index(texture.path);
  // MTL scales and shifts v upwards; patina's v points down.
  const vec2 scale = texture.statement.scale, offset = texture.statement.offset;
  ref.uv_transform =
      mat3(vec3(scale.x, 0, 0), vec3(0, scale.y, 0), vec3(offset.x, 1.0f - scale.y - offset.y, 1));
  if (texture.statement.clamp) ref.wrap_s = ref.wrap_t = Wrap::kClampToEdge;
  return ref;
}

Material ObjMaterials::with_textures(MtlMaterial mtl) {
  Material m = std::move(mtl.material);
  if (mtl.base_color) {
    // Where a colour map is given, most programs show it alone; a black Kd beside it is common and means
    // nothing.
    m.base_color = texture_ref(*mtl.base_color);
    m.base_color_factor = vec4(vec3(1.0f), m.base_color_factor.a);
  }
  if (mtl.emissive) {
    m.emissive = texture_ref(*mtl.emissive);
    if (m.emissive_factor == vec3(0.0f)) m.emissive_factor = vec3(1.0f);
  }
  if (mtl.normal) {
    const TextureRef ref = texture_ref(*mtl.normal);
    if (mtl.normal_may_be_height && is_height(asset_.images[static_cast<size_t>(ref.image)])) {
      warn_once(fmt::format(
          "material '{}': its bump map is a height field, which is not read; use a normal map ('norm')",
          printable(m.name, 60)));
    } else {
      m.normal = ref;
      m.normal_scale = mtl.normal->statement.bump_scale;
    }
  }
  if (mtl.roughness || mtl.metallic) pack_roughness_metallic(mtl, m);
  return m;
}

// glTF wants roughness in green and metallic in blue of one image; MTL has an image each, or a channel of
// one.
void ObjMaterials::pack_roughness_metallic(const MtlMaterial& mtl, Material& m) {
  const MtlTexture& placed = mtl.roughness ? *mtl.roughness : *mtl.metallic;
  const auto image_of = [&](const std::optional<MtlTexture>& texture) {
    return texture ? &asset_.images[static_cast<size_t>(image_index(texture->path))] : nullptr;
  };
  image_of(mtl.roughness),
      image_of(mtl.metallic);  // read both before taking addresses: reading may move the images
  const Image* roughness = image_of(mtl.roughness);
  const Image* metallic = image_of(mtl.metallic);
  const int width = std::max(roughness ? roughness->width : 1, metallic ? metallic->width : 1);
  const int height = std::max(roughness ? roughness->height : 1, metallic ? metallic->height : 1);
  Image packed(width, height, 3, 1.0f);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const auto nearest = [&](const Image& image, const MtlTexture& texture) {
        const float* texel = image.at(x * image.width / width, y * image.height / height);
        return channel_of(texel, image.channels, texture.statement.channel);
      };
      if (roughness) packed.at(x, y)[1] = nearest(*roughness, *mtl.roughness);
      if (metallic) packed.at(x, y)[2] = nearest(*metallic, *mtl.metallic);
    }
  m.metallic_roughness = texture_ref(placed);
  m.metallic_roughness.image = add_image(std::move(packed), placed.path, "roughness_metallic");
  if (roughness) m.roughness_factor = 1.0f;
  if (metallic) m.metallic_factor = 1.0f;
}

}  // namespace patina::asset
