#include "patina/asset/asset.h"

#include <algorithm>
#include <limits>

#include <fmt/format.h>

#include "patina/asset/gltf_container.h"
#include "patina/asset/gltf_materials.h"
#include "patina/asset/gltf_scene.h"
#include "patina/asset/obj_reader.h"
#include "patina/asset/unwrap.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/base/text.h"

namespace patina::asset {
namespace {

Asset read_gltf(const std::filesystem::path& path, std::vector<uint8_t> file) {
  OpenedGltf opened = open_gltf(path, std::move(file));
  Asset asset;
  asset.path = path;
  asset.source = opened.document;
  asset.warnings = std::move(opened.warnings);
  if (const auto used = opened.document->root().find("extensionsUsed"))
    for (size_t i = 0; i < used->size(); ++i) asset.extensions_used.push_back((*used)[i].string());
  read_materials(*opened.document, asset);
  read_scene(*opened.document, asset);
  if (asset.materials.empty()) asset.materials.push_back(default_material());
  return asset;
}

}  // namespace

std::vector<std::filesystem::path> files_of(const Asset& asset) {
  std::vector<std::filesystem::path> files{asset.path};
  if (!asset.source) return files;
  for (const std::string& reference : asset.source->references)
    files.push_back(asset.source->folder() / reference);
  return files;
}

Asset read_asset(const std::filesystem::path& path) {
  return read_asset(path, read_file(path));
}

Asset read_asset(const std::filesystem::path& path, std::vector<uint8_t> file) {
  if (is_glb(file)) return read_gltf(path, std::move(file));
  // A glTF file is a JSON object; OBJ has no line that begins with a brace or bracket.
  const auto is_space = [](uint8_t c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; };
  size_t first = file.size() >= 3 && file[0] == 0xEF && file[1] == 0xBB && file[2] == 0xBF ? 3 : 0;
  while (first < file.size() && is_space(file[first])) ++first;
  const std::string extension = lowered(path.extension().string());
  const uint8_t c = first < file.size() ? file[first] : 0;
  if (c == '{' || c == '[' || extension == ".gltf") return read_gltf(path, std::move(file));
  if (extension == ".obj") return read_obj(path, std::move(file));
  if (extension == ".glb")
    throw Error(ErrorCode::kFormat, path.string(), "the file does not begin with 'glTF', so it is no GLB");
  throw Error(ErrorCode::kFormat, path.string(), "is neither glTF, GLB nor OBJ");
}

void set_origin(Asset& asset, const glm::dvec3& origin) {
  const glm::dvec3 shift = asset.origin - origin;
  asset.origin = origin;
  if (shift == glm::dvec3(0.0)) return;
  for (Primitive& primitive : asset.primitives)
    for (vec3& p : primitive.p_world) p = vec3(glm::dvec3(p) + shift);
  for (Light& light : asset.lights) light.p_world = vec3(glm::dvec3(light.p_world) + shift);
}

Bounds bounds(const Asset& asset) {
  vec3 low(std::numeric_limits<float>::infinity()), high(-low);
  for (const Primitive& primitive : asset.primitives)
    for (const uvec3& t : primitive.triangles)
      for (int k = 0; k < 3; ++k) {
        low = glm::min(low, primitive.p_world[t[k]]);
        high = glm::max(high, primitive.p_world[t[k]]);
      }
  if (!(low.x <= high.x))
    throw Error(ErrorCode::kFormat, asset.path.string(),
                "the scene holds no triangles, so there is no surface to work on");
  const vec3 size = high - low;
  if (!is_finite(size) || !std::isfinite(glm::length(size)))
    throw Error(ErrorCode::kFormat, asset.path.string(),
                "the scene is too large for single-precision numbers; scale it down");
  if (max_component(size) <= std::numeric_limits<float>::min())
    throw Error(ErrorCode::kFormat, asset.path.string(),
                "all triangles lie in one point, so the scene has no size");
  Bounds box{low, high};
  for (const Primitive& primitive : asset.primitives)
    for (const uvec3& t : primitive.triangles)
      for (int k = 0; k < 3; ++k)
        box.sphere_radius = std::max(box.sphere_radius, glm::distance(box.center(), primitive.p_world[t[k]]));
  return box;
}

namespace {

// Whether no point of the material can be seen: its alpha is zero everywhere, or below the cut-off.
bool is_invisible(const Asset& asset, const Material& m) {
  if (m.alpha_mode == AlphaMode::kOpaque) return false;
  float largest = m.base_color_factor.a;
  if (m.base_color) {
    const Image& image = asset.images[static_cast<size_t>(m.base_color.image)];
    const auto channels = static_cast<size_t>(image.channels);
    if (channels == 2 || channels == 4) {
      float alpha = 0;
      for (size_t i = channels - 1; i < image.pixels.size(); i += channels)
        alpha = std::max(alpha, image.pixels[i]);
      largest *= alpha;
    }
  }
  return m.alpha_mode == AlphaMode::kMask ? largest < m.alpha_cutoff : largest <= 0.0f;
}

void require_visible(const Asset& asset) {
  std::vector<bool> invisible;
  for (const Material& m : asset.materials) invisible.push_back(is_invisible(asset, m));
  std::string name;
  for (const Primitive& primitive : asset.primitives) {
    if (primitive.triangles.empty()) continue;
    const auto material = static_cast<size_t>(primitive.material);
    if (!invisible[material]) return;
    name = asset.materials[material].name;
  }
  throw Error(ErrorCode::kFormat, asset.path.string(),
              fmt::format("all of its materials are invisible (alpha is zero, for instance that of '{}'), so "
                          "there is nothing to see or to change",
                          printable(name, 60)));
}

}  // namespace

void require_enhanceable(const Asset& asset) {
  bounds(asset);
  bool has_area = false;
  for (const Primitive& primitive : asset.primitives)
    for (size_t i = 0; i < primitive.triangles.size() && !has_area; ++i) {
      const uvec3& t = primitive.triangles[i];
      const glm::dvec3 a(primitive.p_world[t.x]), b(primitive.p_world[t.y]), c(primitive.p_world[t.z]);
      has_area = glm::length(glm::cross(b - a, c - a)) > 0;
    }
  if (!has_area)
    throw Error(ErrorCode::kFormat, asset.path.string(),
                "every triangle is degenerate, so there is no surface to work on");
  require_visible(asset);
  std::string without_uv;
  bool any_uv = false;
  for (const Primitive& primitive : asset.primitives) {
    if (primitive.triangles.empty()) continue;
    any_uv = any_uv || !primitive.uv.empty();
    if (primitive.uv.empty() && without_uv.empty()) without_uv = primitive.name;
  }
  if (!any_uv)
    throw Error(
        ErrorCode::kFormat, asset.path.string(),
        fmt::format(
            "the meshes have no texture coordinates (mesh '{}'), so no texture can be put on them; {}",
            printable(without_uv, 60), kHowToUnwrap));
}

}  // namespace patina::asset
