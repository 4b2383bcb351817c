#include "patina/pipeline/part_prompts.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "patina/base/error.h"

namespace patina::pipeline {
namespace {

using Color = std::array<uint8_t, 3>;
// Told apart also by most of the colour-blind [Okabe2008].
constexpr std::array<Color, 7> kColors{{{230, 159, 0},
                                        {86, 180, 233},
                                        {0, 158, 115},
                                        {240, 228, 66},
                                        {0, 114, 178},
                                        {213, 94, 0},
                                        {204, 121, 167}}};
constexpr float kColorShare = 0.55f;

const Color& color_of(size_t part) {
  return kColors[part % kColors.size()];
}

// Each material's text of one option; empty: none.
std::vector<std::string> texts_of_materials(const Workbench& bench, const Strength& strength,
                                            const std::vector<std::string>& values, const char* option) {
  std::vector<std::string> texts(bench.asset.materials.size());
  for (const std::string& value : values) {
    const ForMaterial part = for_material(bench.asset, strength.enhanced, value, option, "MATERIAL=TEXT");
    if (part.value.find_first_not_of(" \t") == std::string::npos) continue;  // not filled in
    for (size_t m = 0; m < texts.size(); ++m) {
      if (!part.materials[m]) continue;
      if (!texts[m].empty())
        throw Error(
            ErrorCode::kUsage, option,
            fmt::format("material '{}' is named twice; give it one text", printable(bench.maps[m].name, 60)));
      texts[m] = part.value;
    }
  }
  return texts;
}

}  // namespace

PartPrompts part_prompts(const Workbench& bench, const Strength& strength, const EditSettings& settings) {
  const std::vector<std::string> prompts =
                                     texts_of_materials(bench, strength, settings.prompt_for, "prompt-for"),
                                 negatives = texts_of_materials(bench, strength, settings.negative_prompt_for,
                                                                "negative-prompt-for");
  PartPrompts parts;
  for (size_t m = 0; m < prompts.size(); ++m) {
    parts.part_of.push_back(-1);
    if (prompts[m].empty() && negatives[m].empty()) continue;
    diffusion::PartPrompt part{prompts[m].empty() ? settings.options.prompt : prompts[m]};
    if (!negatives[m].empty()) part.negative_prompt = negatives[m];
    const auto same = std::find(parts.prompts.begin(), parts.prompts.end(), part);
    parts.part_of.back() = static_cast<int>(same - parts.prompts.begin());
    if (same == parts.prompts.end()) parts.prompts.push_back(std::move(part));
  }
  return parts;
}

std::vector<Image> part_views(const PartPrompts& parts, const views::ViewSet& views) {
  std::vector<Image> pictures;
  if (parts.prompts.empty()) return pictures;
  for (const views::View& view : views.views) {
    const views::GBuffer& g = view.gbuffer;
    Image picture(g.width, g.height, static_cast<int>(parts.prompts.size()));
    for (size_t i = 0; i < g.material.size(); ++i) {
      const auto material = static_cast<size_t>(g.material[i]);
      // Materials of the context lie behind the asset's.
      if (g.material[i] < 0 || material >= parts.part_of.size() || parts.part_of[material] < 0) continue;
      picture.pixels[i * parts.prompts.size() + static_cast<size_t>(parts.part_of[material])] = 1.0f;
    }
    pictures.push_back(std::move(picture));
  }
  return pictures;
}

std::vector<Image> part_pictures(std::span<const Image> part_views, std::span<const Image> tile_views) {
  std::vector<Image> pictures;
  for (size_t v = 0; v < part_views.size(); ++v) {
    const Image &shares = part_views[v], &tile = tile_views[v];
    Image picture(tile.width, tile.height, 3);
    const auto num_parts = static_cast<size_t>(shares.channels);
    for (size_t i = 0; i < tile.num_pixels(); ++i) {
      const float* rgb = tile.pixels.data() + 3 * i;
      const float grey = (rgb[0] + rgb[1] + rgb[2]) / 3;
      for (size_t c = 0; c < 3; ++c) {
        float value = grey;
        for (size_t part = 0; part < num_parts; ++part)
          value += kColorShare * shares.pixels[i * num_parts + part] *
                   (static_cast<float>(color_of(part)[c]) / 255.0f - grey);
        picture.pixels[3 * i + c] = value;
      }
    }
    pictures.push_back(std::move(picture));
  }
  return pictures;
}

nlohmann::json parts_as_json(const PartPrompts& parts, const Workbench& bench) {
  nlohmann::json list = nlohmann::json::array();
  for (size_t part = 0; part < parts.prompts.size(); ++part) {
    nlohmann::json names = nlohmann::json::array();
    for (size_t m = 0; m < parts.part_of.size(); ++m)
      if (parts.part_of[m] == static_cast<int>(part)) names.push_back(printable(bench.maps[m].name));
    const auto& [prompt, negative_prompt] = parts.prompts[part];
    const Color& color = color_of(part);
    list.push_back(
        {{"materials", names},
         {"prompt", prompt},
         {"negative_prompt", negative_prompt ? nlohmann::json(*negative_prompt) : nlohmann::json()},
         {"color", fmt::format("#{:02x}{:02x}{:02x}", color[0], color[1], color[2])}});
  }
  return list;
}

}  // namespace patina::pipeline
