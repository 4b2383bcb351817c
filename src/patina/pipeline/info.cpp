#include "patina/pipeline/info.h"

#include <algorithm>
#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "patina/asset/asset.h"
#include "patina/asset/material_maps.h"
#include "patina/asset/unwrap.h"
#include "patina/asset/uv_tiles.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/base/text.h"
#include "patina/image/image_io.h"
#include "patina/nn/safetensors.h"

namespace patina::pipeline {
namespace {

namespace fs = std::filesystem;

std::string describe_texture(const asset::Asset& asset, const char* slot, const asset::TextureRef& ref) {
  if (!ref) return "";
  const auto i = static_cast<size_t>(ref.image);
  const vec2 scale(glm::length(vec2(ref.uv_transform[0])), glm::length(vec2(ref.uv_transform[1])));
  std::string text = fmt::format("    {:<19}{} x {}, {} channel(s), UV set {}", slot, asset.images[i].width,
                                 asset.images[i].height, asset.images[i].channels, ref.uv_set);
  if (ref.uv_transform != mat3(1.0f))
    text += fmt::format(", transformed (scale {:.3g} x {:.3g})", scale.x, scale.y);
  if (!asset.image_names[i].empty()) text += "  " + printable(asset.image_names[i], 60);
  return text + "\n";
}

// Where there is one by tiles; the names of materials are mostly different.
std::string describe_tiles(const std::vector<asset::TiledTexture>& tiled, const asset::Material& material) {
  for (const asset::TiledTexture& texture : tiled)
    if (texture.material == material.name)
      return fmt::format(
          "    a picture for each UDIM tile, {} (found: {}): give each tile a material of its own before you "
          "enhance it\n",
          printable(texture.file, 100), texture.tiles.empty() ? "none" : asset::tile_list(texture.tiles));
  return "";
}

std::string describe_uv(const asset::UvState& uv, const std::vector<int>& tiles) {
  if (uv.missing) return std::string("missing; ") + asset::kHowToUnwrap;
  if (uv.zero_area > 0.99f) return std::string("have no area; ") + asset::kHowToUnwrap;
  std::string text = uv.uv_set > 0 ? fmt::format("of set {} ", uv.uv_set) : "";
  text += fmt::format("cover {:.0f} % of the tile, from ({:.3g}, {:.3g}) to ({:.3g}, {:.3g})",
                      100 * uv.covered, uv.min.x, uv.min.y, uv.max.x, uv.max.y);
  if (uv.parts_without > 0) text += fmt::format("; {} mesh part(s) have none", uv.parts_without);
  if (uv.zero_area > 0.005f)
    text += fmt::format("; {:.0f} % of the triangles have no UV area", 100 * uv.zero_area);
  if (uv.overlapping > 0.01f)
    text += fmt::format("; {:.0f} % of the covered texels are shared: detail will repeat there",
                        100 * uv.overlapping);
  if (uv.mirrored > 0.01f) text += fmt::format("; {:.0f} % of the triangles are mirrored", 100 * uv.mirrored);
  if (uv.min.x < 0 || uv.min.y < 0 || uv.max.x > 1 || uv.max.y > 1) {
    text += "; out of [0,1]: they wrap around";
    if (!tiles.empty())
      text += fmt::format(" (UDIM tile{} {})", tiles.size() > 1 ? "s" : "", asset::tile_list(tiles));
  }
  return text;
}

std::string describe_asset(const fs::path& path) {
  const asset::Asset asset = asset::read_asset(path);
  asset::require_enhanceable(asset);
  const asset::Bounds box = asset::bounds(asset);
  const std::vector<asset::UvState> uv = asset::uv_states(asset);
  const std::vector<asset::TiledTexture> tiled = asset::tiled_textures(asset);

  size_t num_triangles = 0;
  std::map<int, size_t> triangles_of;
  for (const asset::Primitive& p : asset.primitives) {
    num_triangles += p.triangles.size();
    triangles_of[p.material] += p.triangles.size();
  }
  const vec3 size = box.max - box.min;
  std::string text =
      fmt::format("{}\n  {} triangles in {} mesh part(s), {:.4g} x {:.4g} x {:.4g} m\n",
                  printable(path.string()), num_triangles, asset.primitives.size(), size.x, size.y, size.z);
  for (size_t i = 0; i < std::min<size_t>(asset.primitives.size(), 20); ++i) {
    const asset::Primitive& p = asset.primitives[i];
    text +=
        fmt::format("    mesh '{}': {} triangles, material {}, {} UV set(s){}\n", printable(p.name, 60),
                    p.triangles.size(), p.material, p.uv.size(), p.color.empty() ? "" : ", vertex colours");
  }
  if (asset.primitives.size() > 20)
    text += fmt::format("    ... and {} more\n", asset.primitives.size() - 20);

  constexpr const char* kAlphaNames[] = {"opaque", "mask", "blend"};
  for (size_t m = 0; m < asset.materials.size(); ++m) {
    const asset::Material& material = asset.materials[m];
    text +=
        fmt::format("  material {} '{}': {} triangles, {}{}\n", m, printable(material.name, 60),
                    triangles_of[static_cast<int>(m)], kAlphaNames[static_cast<size_t>(material.alpha_mode)],
                    material.double_sided ? ", double-sided" : "");
    text += describe_texture(asset, "base colour", material.base_color);
    text += describe_texture(asset, "metallic-roughness", material.metallic_roughness);
    text += describe_texture(asset, "normal", material.normal);
    text += describe_texture(asset, "occlusion", material.occlusion);
    text += describe_texture(asset, "emissive", material.emissive);
    const std::string tiles = describe_tiles(tiled, material);
    text += tiles;
    if (tiles.empty() && !material.base_color && !material.metallic_roughness && !material.normal)
      text += "    no textures: new ones are made from its factors\n";
    if (triangles_of[static_cast<int>(m)] > 0)
      text +=
          "    UVs " + describe_uv(uv[m], asset::uv_tiles(asset, static_cast<int>(m), uv[m].uv_set)) + "\n";
  }
  if (!asset.lights.empty()) text += fmt::format("  {} punctual light(s)\n", asset.lights.size());
  if (!asset.extensions_used.empty()) {
    text += "  extensions:";
    for (const std::string& name : asset.extensions_used) text += " " + printable(name, 60);
    text += "\n";
  }
  for (const std::string& warning : asset.warnings) text += "  note: " + printable(warning, 400) + "\n";
  return text;
}

std::string describe_image(const fs::path& path) {
  const Image image = read_image(path);
  return fmt::format("{}\n  image, {} x {} pixels, {} channel(s)\n", printable(path.string()), image.width,
                     image.height, image.channels);
}

std::string describe_environment(const fs::path& path) {
  const HdrImage hdr = read_hdr_with_notes(path);
  const Image& image = hdr.image;
  vec3 mean(0.0f);
  float largest = 0;
  for (size_t i = 0; i < image.num_pixels(); ++i) {
    const vec3 value(image.pixels[3 * i], image.pixels[3 * i + 1], image.pixels[3 * i + 2]);
    mean += value / static_cast<float>(image.num_pixels());
    largest = std::max(largest, max_component(value));
  }
  std::string text = fmt::format(
      "{}\n  environment map, {} x {} pixels, mean radiance ({:.3g}, {:.3g}, {:.3g}), largest {:.4g}\n",
      printable(path.string()), image.width, image.height, mean.x, mean.y, mean.z, largest);
  for (const std::string& note : hdr.notes) text += "  note: " + printable(note, 400) + "\n";
  return text;
}

std::string describe_weights(const fs::path& path) {
  const nn::SafeTensors file(path);
  int64_t num_parameters = 0;
  std::map<std::string_view, size_t> types;
  for (const nn::TensorEntry& tensor : file.tensors()) {
    num_parameters += tensor.num_elements();
    ++types[nn::name_of(tensor.type)];
  }
  std::string text = fmt::format("{}\n  weights, {} tensor(s), {} parameter(s)\n", printable(path.string()),
                                 file.tensors().size(), num_parameters);
  for (const auto& [type, count] : types) text += fmt::format("    {} of type {}\n", count, type);
  for (size_t i = 0; i < std::min<size_t>(file.tensors().size(), 5); ++i)
    text += fmt::format("    {} {}\n", printable(file.tensors()[i].name, 100),
                        nn::shape_text(file.tensors()[i].shape));
  if (file.tensors().size() > 5) text += fmt::format("    ... and {} more\n", file.tensors().size() - 5);
  return text;
}

}  // namespace

std::string prompts_to_fill_in(const fs::path& path) {
  const asset::Asset asset = asset::read_asset(path);
  asset::require_enhanceable(asset);
  std::string text = fmt::format(
      "# What {} should look like. Fill in and give it to `patina enhance` as its configuration.\n"
      "prompt = \"\"  # for all materials without words of their own\n"
      "prompt-for = [  # materials without words follow the prompt\n",
      printable(path.filename().string()));
  std::vector<bool> used(asset.materials.size(), false);
  for (const asset::Primitive& primitive : asset.primitives)
    used[static_cast<size_t>(primitive.material)] = true;
  for (size_t m = 0; m < used.size(); ++m)
    if (used[m]) text += "  " + nlohmann::json(printable(asset.materials[m].name) + "=").dump() + ",\n";
  return text + "]\n";
}

std::string describe_file(const fs::path& path) {
  const std::string extension = lowered(path.extension().string());
  if (extension == ".gltf" || extension == ".glb" || extension == ".obj") return describe_asset(path);
  if (extension == ".png" || extension == ".jpg" || extension == ".jpeg") return describe_image(path);
  if (extension == ".hdr" || extension == ".exr") return describe_environment(path);
  if (extension == ".safetensors") return describe_weights(path);
  if (!fs::exists(path)) throw Error(ErrorCode::kNotFound, path.string(), "no such file or folder");
  throw Error(ErrorCode::kUnsupported, path.string(),
              "expected an asset (.glb, .gltf, .obj), an image (.png, .jpg), an environment (.hdr, .exr) or "
              "weights (.safetensors)");
}

}  // namespace patina::pipeline
