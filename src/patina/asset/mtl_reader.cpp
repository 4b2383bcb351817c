#include "patina/asset/mtl_reader.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "patina/asset/gltf_materials.h"
#include "patina/asset/obj_text.h"
#include "patina/base/files.h"
#include "patina/base/text.h"
#include "patina/base/utf8.h"

namespace patina::asset {
namespace {

// Perceptual roughness of a Blinn-Phong exponent: alpha² = 2 / (n + 2) [Walter2007, Sec. 5.2], alpha =
// roughness².
float roughness_of_exponent(float exponent) {
  return std::pow(2.0f / (std::max(exponent, 0.0f) + 2.0f), 0.25f);
}

class MtlReader {
 public:
  MtlReader(const std::string& asset_name, const std::filesystem::path& folder,
            const std::filesystem::path& relative)
      : folder_(folder),
        base_(relative.parent_path()),
        name_(fmt::format("{}: material library {}", asset_name, relative.filename().string())),
        text_(read_mtl_text(folder / relative)) {}

  MtlLibrary read() {
    for (const TextLine& line : text_lines(text_)) {
      line_ = &line;
      const std::string keyword = lowered(line.keyword);
      if (keyword == "newmtl")
        begin_material();
      else if (current_)
        statement(keyword);
      // What stands before the first newmtl belongs to no material.
    }
    return std::move(library_);
  }

 private:
  std::string where() const { return fmt::format("{}, line {}", name_, line_->number); }
  void note(const std::string& message) { library_.notes.push_back(where() + ": " + message); }

  void begin_material() {
    const bool is_new = !library_.materials.contains(line_->rest);
    current_ = &library_.materials[line_->rest];
    *current_ = MtlMaterial{};
    if (!is_new) note("a material of this name is defined above; this definition counts");
    current_->material.name = short_name(as_utf8(unquoted(line_->rest)));
    current_->material.metallic_factor = 0.0f;
    current_->material.roughness_factor = roughness_of_exponent(0.0f);
    has_roughness_ = has_opacity_ = false;
  }

  void statement(const std::string& keyword) {
    if (names_picture(keyword)) return picture(keyword);
    Material& m = current_->material;
    if (keyword == "kd") {
      if (const auto value = color(1.0f)) m.base_color_factor = vec4(*value, m.base_color_factor.a);
    } else if (keyword == "ke") {
      if (const auto value = color(1e6f)) m.emissive_factor = *value;
    } else if (keyword == "d") {
      if (const auto value = single_value()) set_opacity(*value);
      has_opacity_ = true;
    } else if (keyword == "tr") {
      transparency();
    } else if (keyword == "pr") {
      if (const auto value = single_value()) m.roughness_factor = std::clamp(*value, 0.0f, 1.0f);
      has_roughness_ = true;
    } else if (keyword == "pm") {
      if (const auto value = single_value()) m.metallic_factor = std::clamp(*value, 0.0f, 1.0f);
    } else if (keyword == "ns" && !has_roughness_) {
      if (const auto value = single_value()) m.roughness_factor = roughness_of_exponent(*value);
    }
  }

  void set_opacity(float opacity) {
    Material& m = current_->material;
    m.base_color_factor.a = std::clamp(opacity, 0.0f, 1.0f);
    m.alpha_mode = m.base_color_factor.a < 1.0f ? AlphaMode::kBlend : AlphaMode::kOpaque;
  }

  // Tr is 1 - d, and d decides where both stand. MeshLab and PhotoScan write 1 for an opaque material: one
  // that is wholly invisible is never meant.
  void transparency() {
    const auto value = single_value();
    if (!value || has_opacity_) return;
    if (*value >= 1.0f) note("'Tr 1' is taken as opaque, as MeshLab and PhotoScan mean it");
    set_opacity(*value >= 1.0f ? 1.0f : 1.0f - *value);
  }

  void picture(const std::string& keyword) {
    if (keyword == "map_d") note("map_d is not read; the material is opaque where d says so");
    const TextureStatement parsed = texture_statement(line_->rest);
    if (parsed.file.empty()) return;  // an empty entry, as exporters write for unused slots
    const auto found = find_named_file(folder_, base_, parsed.file);
    if (found) library_.references.push_back(found->relative.string());
    std::optional<MtlTexture>* slot = slot_of(keyword);
    if (!slot) return;
    const bool may_be_height = keyword == "map_bump" || keyword == "bump";
    if (may_be_height && *slot) return;  // beside a normal map, or named twice
    if (!found && names_tiles(parsed.file)) {
      const std::string file(unquoted(parsed.file));
      if (!current_->tiled)
        current_->tiled = TiledTexture{current_->material.name, file, tiles_on_disk(folder_, base_, file)};
      return;
    }
    if (!found) {
      note(fmt::format(
          "the texture file '{}' is not in the asset's folder, so the material goes without it; put "
          "it beside the library, or correct its name",
          printable(parsed.file, 100)));
      return;
    }
    if (!found->as_written)
      note(fmt::format("the texture '{}' is taken from '{}'", printable(parsed.file, 100),
                       printable(found->relative.string(), 100)));
    *slot = MtlTexture{folder_ / found->relative, parsed};
    if (slot == &current_->normal) current_->normal_may_be_height = may_be_height;
  }

  std::optional<MtlTexture>* slot_of(const std::string& keyword) {
    if (keyword == "map_kd") return &current_->base_color;
    if (keyword == "map_ke") return &current_->emissive;
    if (keyword == "map_pr") return &current_->roughness;
    if (keyword == "map_pm") return &current_->metallic;
    if (keyword == "norm" || keyword == "map_kn" || keyword == "map_bump" || keyword == "bump")
      return &current_->normal;
    return nullptr;
  }

  std::optional<float> value_of(std::string_view word) {
    const auto found = number(word);
    if (!found)
      note(fmt::format("'{}' is left out: expected a number, found '{}'", line_->keyword,
                       printable(word, 40)));
    return found;
  }

  std::optional<float> single_value() {
    const auto parts = words(line_->rest);
    return parts.empty() ? std::nullopt : value_of(parts[0]);
  }

  // MTL colours are those a modelling program shows: linear, as exporters write them; one number stands for
  // three.
  std::optional<vec3> color(float largest) {
    const auto parts = words(line_->rest);
    if (parts.empty()) return std::nullopt;
    if (parts[0] == "xyz" || parts[0] == "spectral") {
      note("colours as spectra or XYZ are not read; write three numbers");
      return std::nullopt;
    }
    vec3 rgb(0.0f);
    for (size_t i = 0; i < 3; ++i) {
      const auto value = value_of(parts[parts.size() >= 3 ? i : 0]);
      if (!value) return std::nullopt;
      rgb[static_cast<glm::length_t>(i)] = *value;
    }
    return glm::clamp(rgb, 0.0f, largest);
  }

  std::filesystem::path folder_, base_;
  std::string name_, text_;
  MtlLibrary library_;
  MtlMaterial* current_ = nullptr;
  bool has_roughness_ = false, has_opacity_ = false;
  const TextLine* line_ = nullptr;
};

}  // namespace

std::string read_mtl_text(const std::filesystem::path& path) {
  std::string text = read_text_file(path, uint64_t{1} << 26);
  auto converted = utf8_from_utf16({reinterpret_cast<const uint8_t*>(text.data()), text.size()});
  return converted ? *std::move(converted) : std::move(text);
}

MtlLibrary read_mtl(const std::string& asset_name, const std::filesystem::path& folder,
                    const std::filesystem::path& relative) {
  return MtlReader(asset_name, folder, relative).read();
}

}  // namespace patina::asset
