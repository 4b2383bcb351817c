// Options of the masks: where the asset may change, and how much there.
#include <charconv>

#include "patina/pipeline/option_groups.h"
#include "patina/pipeline/option_kinds.h"

namespace patina::pipeline {

using namespace option_kinds;

namespace {

using masks::PlaceAmount;
using Where = masks::Place;

const std::vector<std::pair<std::string, Where>> kPlaces{
    {"edges", Where::kEdges}, {"crevices", Where::kCrevices}, {"cavities", Where::kCavities},
    {"up", Where::kUp},       {"down", Where::kDown},         {"drips", Where::kDrips}};

// "edges" or "edges:0.5".
Kind<PlaceAmount> place_amount() {
  const Kind<Where> place = choice(kPlaces);
  return {.kind = ValueKind::kText,
          .expected = place.expected + ", with an amount above 0 up to 1 behind a colon, as edges:0.5",
          .decode = [place](const json& value) -> std::optional<PlaceAmount> {
            if (!value.is_string()) return std::nullopt;
            const auto text = value.get<std::string>();
            const size_t colon = text.find(':');
            const auto named = place.decode(text.substr(0, colon));
            if (!named) return std::nullopt;
            if (colon == std::string::npos) return PlaceAmount{*named, 1.0f};
            float amount = 0;
            const char* const end = text.data() + text.size();
            const auto [rest, failure] = std::from_chars(text.data() + colon + 1, end, amount);
            if (failure != std::errc() || rest != end || !(amount > 0 && amount <= 1)) return std::nullopt;
            return PlaceAmount{*named, amount};
          },
          .encode =
              [place](const PlaceAmount& p) {
                const auto name = place.encode(p.place).get<std::string>();
                return p.amount == 1 ? json(name) : json(fmt::format("{}:{}", name, p.amount));
              }};
}

// The list may be written with commas.
Option where(const option_kinds::Place<MaskSettings>& at) {
  Option made = list_option(
      at,
      {.name = "where",
       .placeholder = "PLACE[:AMOUNT]",
       .help =
           "Edit where the asset's shape, its normal map included, has edges, crevices or cavities, faces "
           "up or down, or where drips would run. The amount, above 0 up to 1, is the strength there. Of "
           "several the strongest counts. The masks lie in masks/ of the run folder, to be repainted.",
       .default_text = "everywhere"},
      place_amount(), [](auto& s) -> auto& { return s.where; });
  made.splits_at_commas = true;
  return made;
}

}  // namespace

std::vector<Option> mask_options() {
  const option_kinds::Place<MaskSettings> at{"Where", &Config::masks, kMasks};
  return {
      list_option(
          at,
          {.name = "mask",
           .placeholder = "[MATERIAL=]FILE",
           .help = "Grey pictures on the UVs of the base colour, for all materials that may change or for "
                   "one, up to 8192 texels a side: white is edited with the full --strength, grey with less "
                   "of it, black keeps every byte. Several of one material are multiplied.",
           .default_text = "none"},
          text(), [](auto& s) -> auto& { return s.files; }),
      option(
          at,
          {.name = "mask-vertex-color",
           .help = "Take the mesh's vertex colours (COLOR_0, mean of red, green and blue) as a mask."},
          truth(), [](auto& s) -> auto& { return s.vertex_color; }),
      list_option(
          at,
          {.name = "strength-for",
           .placeholder = "MATERIAL=S",
           .help = "Edit this material with a share of the --strength, 0 to 1.",
           .default_text = "1 for each"},
          text(), [](auto& s) -> auto& { return s.strength_for; }),
      list_option(
          at,
          {.name = "protect",
           .placeholder = "MATERIAL",
           .help = "These materials keep every byte, and every pixel in the views.",
           .default_text = "none"},
          text(), [](auto& s) -> auto& { return s.protect; }),
      where(at),
  };
}

}  // namespace patina::pipeline
