// The stage before all others: masks, from files and from the mesh, become one strength map a material.
#include <algorithm>
#include <charconv>

#include <fmt/format.h>

#include "patina/asset/strength_map.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/image/image_io.h"
#include "patina/masks/places.h"
#include "patina/masks/vertex_color.h"
#include "patina/pipeline/stage_key.h"
#include "patina/pipeline/stages.h"
#include "patina/views/strength_views.h"

namespace patina::pipeline {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

constexpr int kMaxSide = 8192;
// Bounds of the size of masks that are made from the mesh, where the texture's own is outside of them.
constexpr int kMinMadeSide = 256, kMaxMadeSide = 512;

// A file and whom it is for.
struct MaskFile {
  fs::path path;
  std::vector<bool> materials;
  bool for_all = false;
};

// "FILE" or "MATERIAL=FILE"; both names may hold '='. A file without a name is for all that may change.
MaskFile parsed(const std::string& text, const Workbench& bench, const std::vector<bool>& may_change) {
  std::error_code ignored;
  if (text.find('=') == std::string::npos || fs::exists(text, ignored)) return {text, may_change, true};
  constexpr const char* kForm = "FILE or MATERIAL=FILE";
  ForMaterial mask = for_material(bench.asset, may_change, text, "mask", kForm);
  if (mask.value.empty())
    throw Error(ErrorCode::kUsage, "mask", fmt::format("expected {}, found '{}'", kForm, printable(text)));
  return {std::move(mask.value), std::move(mask.materials), false};
}

std::vector<MaskFile> parsed(const std::vector<std::string>& texts, const Workbench& bench,
                             const std::vector<bool>& may_change) {
  std::vector<MaskFile> files;
  files.reserve(texts.size());
  for (const std::string& text : texts) files.push_back(parsed(text, bench, may_change));
  return files;
}

// The one channel of a picture that must be grey and opaque.
Image read_grey(const fs::path& path) {
  const Image stored = read_image(path, {.max_side = kMaxSide});
  Image grey(stored.width, stored.height, 1);
  const auto channels = static_cast<size_t>(stored.channels);
  for (size_t i = 0; i < grey.num_pixels(); ++i) {
    const float* pixel = stored.pixels.data() + i * channels;
    const auto refuse = [&](const char* what) {
      throw Error(
          ErrorCode::kFormat, path.string(),
          fmt::format("is no mask: expected a grey, opaque picture (white: edit fully, black: keep), "
                      "but the texel at ({}, {}) is {}; save it as greyscale",
                      i % static_cast<size_t>(stored.width), i / static_cast<size_t>(stored.width), what));
    };
    if (channels >= 3 && (pixel[0] != pixel[1] || pixel[0] != pixel[2])) refuse("coloured");
    if (channels % 2 == 0 && pixel[channels - 1] < 1.0f) refuse("transparent");
    grey.pixels[i] = pixel[0];
  }
  return grey;
}

// A mask has the proportions of the texture that it is painted over.
void check_size(const Image& mask, const MaskFile& file, const Workbench& bench) {
  for (size_t m = 0; m < file.materials.size(); ++m) {
    const Image& texture = bench.maps[m].base_color.texels;
    if (!file.materials[m] || texture.num_pixels() == 1) continue;
    if (int64_t{mask.width} * texture.height == int64_t{mask.height} * texture.width) continue;
    const double height = static_cast<double>(mask.width) * texture.height / texture.width;
    throw Error(ErrorCode::kFormat, file.path.string(),
                fmt::format("is {} x {}; expected the proportions of the base colour of material '{}', {} x "
                            "{}, at most {} a side; the nearest is {} x {}{}",
                            mask.width, mask.height, printable(bench.maps[m].name, 60), texture.width,
                            texture.height, kMaxSide, mask.width, std::max(1L, std::lround(height)),
                            file.for_all ? ", or give each material its own: MATERIAL=FILE" : ""));
  }
}

asset::Map constant(float value) {
  asset::Map map;
  map.texels = Image(1, 1, 1, value);
  return map;
}

// The layout of a material's masks: that of its base colour, over which they are painted.
asset::Map laid_out(const Workbench& bench, size_t material, Image texels) {
  const asset::Map& like = bench.maps[material].base_color;
  return {std::move(texels), like.uv_set, like.uv_transform, like.wrap_s, like.wrap_t};
}

// Both act: one grey halves what the other leaves.
void multiply(std::optional<asset::Map>& map, asset::Map by) {
  if (!map) {
    map = std::move(by);
    return;
  }
  const int width = std::max(map->texels.width, by.texels.width),
            height = std::max(map->texels.height, by.texels.height);
  *map = asset::resized_strength(*map, width, height);
  by = asset::resized_strength(by, width, height);
  for (size_t i = 0; i < by.texels.pixels.size(); ++i) map->texels.pixels[i] *= by.texels.pixels[i];
}

// Width and height of masks that are made from the mesh.
ivec2 made_size(const asset::Map& texture) {
  return glm::clamp(ivec2(texture.texels.width, texture.texels.height), kMinMadeSide, kMaxMadeSide);
}

// "MATERIAL=S": a grey that is the same all over the material.
void multiply_share(const Workbench& bench, const std::vector<bool>& may_change, const std::string& text,
                    std::vector<std::optional<asset::Map>>& maps) {
  const ForMaterial part = for_material(bench.asset, may_change, text, "strength-for", "MATERIAL=S");
  float share = -1;
  const char* const end = part.value.data() + part.value.size();
  const auto [rest, failure] = std::from_chars(part.value.data(), end, share);
  if (failure != std::errc() || rest != end || !(share >= 0 && share <= 1))
    throw Error(ErrorCode::kUsage, "strength-for",
                fmt::format("expected MATERIAL=S with S from 0 to 1, found '{}'", printable(text)));
  for (size_t m = 0; m < maps.size(); ++m)
    if (part.materials[m]) multiply(maps[m], laid_out(bench, m, Image(1, 1, 1, share)));
}

void multiply_vertex_colors(const Workbench& bench, const std::vector<bool>& may_change,
                            std::vector<std::optional<asset::Map>>& maps) {
  bool any = false;
  for (size_t m = 0; m < maps.size(); ++m) {
    if (!may_change[m]) continue;
    const asset::Map& like = bench.maps[m].base_color;
    const ivec2 size = made_size(like);
    auto colors = masks::vertex_color_strength(views::asset_primitives(*bench.scene), like, size.x, size.y,
                                               static_cast<int>(m));
    any |= colors.has_value();
    if (colors) multiply(maps[m], std::move(*colors));
  }
  if (!any)
    throw Error(ErrorCode::kUsage, "mask-vertex-color",
                fmt::format("no mesh part of '{}' that may change has vertex colours (COLOR_0)",
                            printable(bench.asset.path.string())));
}

// One map a material; nullopt where nothing masks it.
std::vector<std::optional<asset::Map>> combined(const Workbench& bench, const std::vector<bool>& may_change,
                                                const MaskSettings& settings, std::span<const MaskFile> files,
                                                const Progress& progress) {
  std::vector<std::optional<asset::Map>> maps(bench.maps.size());
  for (const MaskFile& file : files) {
    const Image mask = read_grey(file.path);
    check_size(mask, file, bench);
    for (size_t m = 0; m < maps.size(); ++m)
      if (file.materials[m]) multiply(maps[m], laid_out(bench, m, mask));
  }
  for (const std::string& share : settings.strength_for) multiply_share(bench, may_change, share, maps);
  if (settings.vertex_color) multiply_vertex_colors(bench, may_change, maps);
  for (size_t m = 0; m < maps.size() && !settings.where.empty(); ++m) {
    if (!may_change[m]) continue;
    const asset::Map& like = bench.maps[m].base_color;
    const ivec2 size = made_size(like);
    multiply(maps[m], masks::place_strength(*bench.scene, like, size.x, size.y, static_cast<int>(m),
                                            settings.where, progress));
  }
  return maps;
}

std::string mask_key(const Workbench& bench, const std::vector<bool>& may_change,
                     const MaskSettings& settings, std::span<const MaskFile> files) {
  StageKey key(bench, settings);
  key.add_materials(may_change);
  for (const MaskFile& file : files) key.add(hash_file(file.path));
  return key.hash();
}

bool has_strength(const asset::Map& map) {
  return std::any_of(map.texels.pixels.begin(), map.texels.pixels.end(), [](float v) { return v > 0.0f; });
}

Error nothing_would_change(const char* why) {
  return {ErrorCode::kFormat, "mask", fmt::format("nothing would change: {}", why)};
}
constexpr const char* kAllBlack =
    "the masks are black on all materials that may change; paint white where the asset shall change";

// The strengths of the run folder, where they may have been repainted.
Strength load_strength(const Workbench& bench, std::vector<bool> may_change, const StageRecord& record,
                       const RunFolder& run) {
  Strength strength{.enhanced = std::move(may_change), .maps = {}, .views = {}};
  for (const bool enhanced : strength.enhanced) strength.maps.push_back(constant(enhanced ? 1.0f : 0.0f));
  for (const json& entry : record.metrics.at("maps")) {
    const size_t m = entry.at("material");
    strength.maps.at(m) = laid_out(bench, m, read_grey(run.file(entry.at("file").get<std::string>())));
    strength.enhanced[m] = has_strength(strength.maps[m]);
  }
  if (std::find(strength.enhanced.begin(), strength.enhanced.end(), true) == strength.enhanced.end())
    throw nothing_would_change(kAllBlack);
  strength.views = views::strength_views(*bench.scene, bench.cameras, strength.maps);
  for (const Image& view : strength.views)
    if (std::any_of(view.pixels.begin(), view.pixels.end(), [](float v) { return v > 0.0f; }))
      return strength;
  throw nothing_would_change(
      "no camera sees a place where the masks are not black; check that the masks lie on the UVs of the base "
      "colour, or turn the cameras");
}

}  // namespace

Strength unmasked(const Workbench& bench) {
  return {.enhanced = bench.chosen, .maps = {}, .views = {}};
}

Strength mask_stage(const Workbench& bench, const MaskSettings& settings, RunFolder& run,
                    const RunProgress& progress) {
  if (!settings.any()) return unmasked(bench);
  std::vector<bool> may_change = bench.chosen;
  const std::vector<bool> keeps = named_materials(bench.asset, settings.protect, "protect");
  for (size_t m = 0; m < keeps.size(); ++m)
    if (keeps[m]) may_change[m] = false;
  const std::vector<MaskFile> files = parsed(settings.files, bench, may_change);
  const std::string key = mask_key(bench, may_change, settings, files);
  const StageRecord& record = run.run_stage("masks", key, progress, [&] {
    RunFolder::StageResult result;
    result.metrics["maps"] = json::array();
    const std::vector<std::optional<asset::Map>> maps =
        combined(bench, may_change, settings, files, progress);
    bool any = false;
    for (size_t m = 0; m < maps.size(); ++m) any |= may_change[m] && (!maps[m] || has_strength(*maps[m]));
    if (!any) throw nothing_would_change(kAllBlack);
    for (size_t m = 0; m < maps.size(); ++m) {
      if (!maps[m]) continue;
      result.outputs.push_back(material_file("masks", m, bench.maps[m].name, "strength"));
      write_image(run.output(result.outputs.back()), maps[m]->texels);
      result.metrics["maps"].push_back({{"material", m}, {"file", result.outputs.back()}});
    }
    return result;
  });
  return load_strength(bench, std::move(may_change), record, run);
}

}  // namespace patina::pipeline
