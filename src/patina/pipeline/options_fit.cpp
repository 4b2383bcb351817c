// Options of the fit, which carries the edit into the textures.
#include "patina/asset/map_slots.h"
#include "patina/pipeline/option_groups.h"
#include "patina/pipeline/option_kinds.h"

namespace patina::pipeline {

using namespace option_kinds;

namespace {

const std::string kGroup = "Inverse rendering";
const Place<FitSettings> kFitPlace{kGroup, &Config::fit, kFit};

// The maps that may change, as a list of names.
Option fitted_maps() {
  Option made = described(About{.name = "fit",
                                .placeholder = "MAP",
                                .help = "Which maps may change: base_color, roughness, metallic, normal.",
                                .default_text = "base_color roughness metallic normal"},
                          kGroup, kFit, text());
  made.is_list = made.splits_at_commas = true;
  made.expected.clear();
  for (const asset::MapSlotRow& row : asset::kMapSlots)
    made.expected += (made.expected.empty() ? "one of " : ", ") + std::string(row.name);
  made.set = [named = made](Config& c, const json& values) {
    asset::MapSet maps;
    for (const json& value : values.is_array() ? values : json::array({values})) {
      const auto slot = value.is_string() ? asset::find_map_slot(value.get<std::string>()) : std::nullopt;
      if (!slot) refuse(named, value);
      maps.set(index_of(slot->slot));
    }
    c.fit.options.maps = maps;
  };
  made.get = [](const Config& c) {
    json list = json::array();
    for (const asset::MapSlotRow& row : asset::kMapSlots)
      if (has(c.fit.options.maps, row.slot)) list.push_back(row.name);
    return list;
  };
  return made;
}

Option boundary() {
  const Place<ReportSettings> report{kGroup, &Config::report, kReport};
  const About about{
      .name = "boundary",
      .placeholder = "PIXELS",
      .help = "Pixels beside silhouettes and depth edges that are neither fitted nor measured."};
  const Kind<int> kind = integer(0, 64);
  return joined({option(
                     kFitPlace, about, kind, [](auto& s) -> auto& { return s.options.boundary_pixels; }),
                 option(
                     report, about, kind, [](auto& s) -> auto& { return s.boundary_pixels; })});
}

}  // namespace

std::vector<Option> fit_options() {
  const auto& at = kFitPlace;
  return {
      option(
          at,
          {.name = "fit-iterations",
           .placeholder = "N",
           .help = "Steps of the optimiser that carries the edit into the textures."},
          integer(1, 100000), [](auto& s) -> auto& { return s.options.iterations; }),
      option(
          at,
          {.name = "texture-size",
           .placeholder = "TEXELS|auto",
           .help = "Width and height of the new textures, texels. 0 keeps the asset's own sizes, auto makes "
                   "them larger where the views show more than they can hold."},
          or_word("auto", inverse::kAutoTextureSize, integer(0, 8192)),
          [](auto& s) -> auto& { return s.options.texture_size; }),
      fitted_maps(),
      option(
          at,
          {.name = "light-samples",
           .placeholder = "N",
           .help =
               "Directions of incident light that are traced from each of four to eight points of a pixel."},
          integer(4, 1024), [](auto& s) -> auto& { return s.options.light_samples; }),
      boundary(),
      option(
          at,
          {.name = "unseen",
           .help = "What happens to unseen texels: keep them, or fill them smoothly with the change of base "
                   "colour, roughness and metallic around them."},
          choice<bool>({{"keep", false}, {"fill", true}}),
          [](auto& s) -> auto& { return s.options.fill_unseen; }),
      option(
          at,
          {.name = "keep-in-place",
           .help = "Take the edited views as they are. Otherwise a view that disagrees with the others is "
                   "moved smoothly by up to 8 pixels, so that detail stays sharp."},
          truth(), [](auto& s) -> auto& { return s.options.keep_in_place; }),
  };
}

}  // namespace patina::pipeline
