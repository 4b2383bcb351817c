#include "patina/asset/mtl_reader.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "patina/asset/gltf_materials.h"
#include "patina/asset/obj_text.h"
#include "patina/asset/uri.h"
#include "patina/base/files.h"
#include "patina/base/text.h"

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
            const std::filesystem::path& path, std::vector<std::string>& warnings)
      : folder_(folder),
        library_(path),
        name_(fmt::format("{}: material library {}", asset_name, path.filename().string())),
        text_(read_text_file(path, uint64_t{1} << 26)),
        warnings_(warnings) {}

  std::map<std::string, MtlMaterial> read() {
    for (const TextLine& line : text_lines(text_)) {
      line_ = &line;
      const std::string keyword = lowered(line.keyword);
      if (keyword == "newmtl") {
        current_ = &materials_[line.rest];
        *current_ = MtlMaterial{};
        current_->material.name = short_name(line.rest);
        current_->material.metallic_factor = 0.0f;
        current_->material.roughness_factor = roughness_of_exponent(0.0f);
        has_roughness_ = false;
        continue;
      }
      if (!current_) fail(fmt::format("'{}' stands before the first newmtl", printable(line.keyword, 40)));
      statement(keyword);
    }
    return std::move(materials_);
  }

 private:
  std::string where() const { return fmt::format("{}, line {}", name_, line_->number); }
  [[noreturn]] void fail(const std::string& message) const {
    throw Error(ErrorCode::kFormat, where(), message);
  }

  void statement(const std::string& keyword) {
    Material& m = current_->material;
    if (keyword == "kd")
      m.base_color_factor = vec4(color(), m.base_color_factor.a);
    else if (keyword == "ke")
      m.emissive_factor = color();
    else if (keyword == "d")
      set_alpha(value());
    else if (keyword == "tr")
      set_alpha(1.0f - value());
    else if (keyword == "pr")
      set_roughness(value());
    else if (keyword == "pm")
      m.metallic_factor = std::clamp(value(), 0.0f, 1.0f);
    else if (keyword == "ns" && !has_roughness_)
      m.roughness_factor = roughness_of_exponent(value());
    else if (keyword == "map_kd")
      current_->base_color = texture();
    else if (keyword == "map_ke")
      current_->emissive = texture();
    else if (keyword == "map_pr")
      current_->roughness = texture();
    else if (keyword == "map_pm")
      current_->metallic = texture();
    else if (keyword == "norm" || keyword == "map_kn")
      set_normal(false);
    else if ((keyword == "map_bump" || keyword == "bump") && !current_->normal)
      set_normal(true);
    else if (keyword == "map_d")
      warnings_.push_back(where() + ": map_d is not read; the material is opaque where d says so");
  }

  void set_normal(bool may_be_height) {
    current_->normal = texture();
    current_->normal_may_be_height = may_be_height;
  }

  void set_alpha(float alpha) {
    Material& m = current_->material;
    m.base_color_factor.a = std::clamp(alpha, 0.0f, 1.0f);
    m.alpha_mode = m.base_color_factor.a < 1.0f ? AlphaMode::kBlend : AlphaMode::kOpaque;
  }

  void set_roughness(float roughness) {
    current_->material.roughness_factor = std::clamp(roughness, 0.0f, 1.0f);
    has_roughness_ = true;
  }

  float value_of(std::string_view word) const {
    const auto found = number(word);
    if (!found) fail(fmt::format("expected a number, found '{}'", printable(word, 40)));
    return *found;
  }

  float value() const {
    const auto parts = words(line_->rest);
    if (parts.empty()) fail("a number is missing");
    return value_of(parts[0]);
  }

  // MTL colours are those a modelling program shows: linear, as exporters write them; one number stands for
  // three.
  vec3 color() const {
    const auto parts = words(line_->rest);
    if (parts.empty()) fail("a colour is missing");
    if (parts[0] == "xyz" || parts[0] == "spectral")
      fail("colours as spectra or XYZ are not read; write three numbers");
    const float first = value_of(parts[0]);
    const vec3 rgb = parts.size() >= 3 ? vec3(first, value_of(parts[1]), value_of(parts[2])) : vec3(first);
    return glm::clamp(rgb, 0.0f, line_->keyword == "Ke" || line_->keyword == "ke" ? 1e6f : 1.0f);
  }

  // Options come first, the file name is the rest of the line and may hold blanks.
  MtlTexture texture() const {
    MtlTexture out;
    std::string_view rest = line_->rest;
    const auto next = [&] {
      const auto parts = words(rest);
      if (parts.empty()) return std::string_view();
      const std::string_view word = parts[0];
      rest = rest.substr(static_cast<size_t>(word.data() + word.size() - rest.data()));
      return word;
    };
    const auto up_to_three = [&](vec2& values) {
      for (int i = 0; i < 3; ++i) {
        const auto parts = words(rest);
        const auto found =
            parts.size() > 1 ? number(parts[0]) : std::nullopt;  // the last word is the file's name
        if (!found) return;
        if (i < 2) values[i] = *found;
        next();
      }
    };
    while (words(rest).size() > 1 && words(rest)[0].starts_with('-')) {
      const std::string_view option = next();
      if (option == "-s")
        up_to_three(out.scale);
      else if (option == "-o")
        up_to_three(out.offset);
      else if (option == "-t") {
        vec2 turbulence;
        up_to_three(turbulence);
      } else if (option == "-bm")
        out.bump_scale = value_of(next());
      else if (option == "-clamp")
        out.clamp = next() == "on";
      else if (option == "-mm") {
        next();
        next();
      } else if (option == "-blendu" || option == "-blendv" || option == "-cc" || option == "-imfchan" ||
                 option == "-texres" || option == "-boost" || option == "-type" || option == "-colorspace")
        next();
      else
        fail(fmt::format("the texture option '{}' is unknown", printable(option, 40)));
    }
    while (!rest.empty() && (rest.front() == ' ' || rest.front() == '\t')) rest.remove_prefix(1);
    std::string reference(rest);
    std::replace(reference.begin(), reference.end(), '\\', '/');  // written on Windows
    // Names are relative to the library's own folder, which may lie below the asset's.
    const std::filesystem::path library_folder = library_.parent_path().lexically_relative(folder_);
    out.path = resolve_inside(
        folder_, library_folder.empty() ? reference : (library_folder / reference).string(), where());
    std::error_code ignored;
    if (!std::filesystem::exists(out.path, ignored))
      throw Error(ErrorCode::kNotFound, where(),
                  fmt::format("the texture file '{}' does not exist", printable(reference)));
    return out;
  }

  std::filesystem::path folder_, library_;
  std::string name_, text_;
  std::vector<std::string>& warnings_;
  std::map<std::string, MtlMaterial> materials_;
  MtlMaterial* current_ = nullptr;
  bool has_roughness_ = false;
  const TextLine* line_ = nullptr;
};

}  // namespace

std::map<std::string, MtlMaterial> read_mtl(const std::string& asset_name,
                                            const std::filesystem::path& folder,
                                            const std::filesystem::path& path,
                                            std::vector<std::string>& warnings) {
  return MtlReader(asset_name, folder, path, warnings).read();
}

}  // namespace patina::asset
