#include "patina/pipeline/own_options.h"

#include <cmath>

#include <fmt/format.h>

#include "patina/asset/map_slots.h"
#include "patina/pipeline/option_kinds.h"

namespace patina::pipeline {
namespace {

using namespace option_kinds;
using nlohmann::json;
namespace fs = std::filesystem;

/// FILE or FILE:WEIGHT; a file's name may hold colons itself.
diffusion::LoraChoice parse_lora(const Option& option, const std::string& text) {
  const size_t colon = text.rfind(':');
  if (colon == std::string::npos || fs::exists(text)) return {text, 1.0f};
  const std::string number = text.substr(colon + 1);
  if (colon == 0 || number.empty()) refuse(option, "FILE or FILE:WEIGHT", text);
  return {text.substr(0, colon), parse_number(option, number, -10.0f, 10.0f)};
}

}  // namespace

Option elevations_option() {
  Option option{
      .name = "elevation",
      .aliases = {},
      .group = "Views",
      .placeholder = "DEGREES",
      .help = "Height of the cameras over the horizon, degrees; several are used in turn around the orbit.",
      .default_text = "20",
      .stages = kRenderStage,
      .is_list = true};
  const Option named = option;
  option.set = [named](Config& c, Values v) {
    c.orbit.elevations.clear();
    for (const std::string& text : v)
      c.orbit.elevations.push_back(glm::radians(parse_number(named, text, -89.0f, 89.0f)));
  };
  option.get = [](const Config& c) {
    json list = json::array();
    for (const float e : c.orbit.elevations)
      list.push_back(shortest(std::round(glm::degrees(e) * 1e4f) / 1e4f));
    return list;
  };
  return option;
}

Option views_option() {
  Option option{.name = "views",
                .aliases = {},
                .group = "Views",
                .placeholder = "4|9|16",
                .help = "Number of views around the asset; they are edited together as a square grid.",
                .default_text = "9",
                .stages = kRenderStage};
  const Option named = option;
  option.set = [named](Config& c, Values v) {
    const int n = parse_number(named, v.front(), 1, 16);
    if (n != 1 && n != 4 && n != 9 && n != 16)
      refuse(named, "4, 9 or 16 (or 1 for a single view)", v.front());
    c.orbit.num_views = n;
  };
  option.get = [](const Config& c) { return json(c.orbit.num_views); };
  return option;
}

Option resolution_option() {
  Option option{
      .name = "resolution",
      .aliases = {},
      .group = "Views",
      .placeholder = "auto|PIXELS",
      .help =
          "Width and height of one view, pixels; a multiple of 64 (with --bias 0: of 8). auto takes "
          "what the model was trained at: 256 for patina-mini, 512 for Stable Diffusion 1.5.",
      .default_text = "auto",
      .stages = kRenderStage};
  const Option named = option;
  option.set = [named](Config& c, Values v) {
    c.orbit.resolution = v.front() == "auto" ? 0 : parse_number(named, v.front(), 64, 4096);
  };
  option.get = [](const Config& c) {
    return c.orbit.resolution == 0 ? json("auto") : json(c.orbit.resolution);
  };
  return option;
}

/// Sets several options at once. Those that are given themselves win: they come later in the list.
Option preset_option() {
  const Names<Preset> presets = {
      {"usual", Preset::kUsual}, {"fast", Preset::kFast}, {"quality", Preset::kQuality}};
  Option option = choice_option<Preset>(
      {.name = "preset",
       .aliases = {},
       .group = "Edit",
       .placeholder = "",
       .help = "fast: 4 views, 12 steps, 80 iterations of the fit, to try prompts. quality: 16 views, 30 "
               "steps, 400 "
               "iterations, smoother renders. Options given beside it win."},
      presets, [](Config & c) -> auto& { return c.preset; });
  option.set = [choose = option.set](Config& c, Values v) {
    choose(c, v);
    if (c.preset == Preset::kUsual) return;
    const bool fast = c.preset == Preset::kFast;
    c.orbit.num_views = fast ? 4 : 16;
    c.detail.num_steps = fast ? 12 : 30;
    c.samples_per_pixel = fast ? 32 : 128;
    c.fit.iterations = fast ? 80 : 400;
    c.turntable_frames = fast ? 0 : 36;
  };
  return option;
}

Option exposure_option() {
  Option option{.name = "exposure",
                .aliases = {},
                .group = "Views",
                .placeholder = "auto|EV",
                .help =
                    "Exposure of all views, in stops; auto meters the light that falls on the asset, so that "
                    "white comes out white.",
                .default_text = "auto",
                .stages = kRenderStage};
  const Option named = option;
  option.set = [named](Config& c, Values v) {
    if (v.front() == "auto")
      c.exposure_ev.reset();
    else
      c.exposure_ev = parse_number(named, v.front(), -20.0f, 20.0f);
  };
  option.get = [](const Config& c) { return c.exposure_ev ? shortest(*c.exposure_ev) : json("auto"); };
  return option;
}

Option materials_option() {
  Option option{.name = "material",
                .aliases = {},
                .group = "Input and output",
                .placeholder = "NAME",
                .help = "Only these materials may change, by the names that `patina info` shows.",
                .default_text = "all with usable UVs",
                .stages = kFitStage | kReportStage,
                .is_list = true};
  option.set = [](Config& c, Values v) { c.materials.assign(v.begin(), v.end()); };
  option.get = [](const Config& c) { return json(c.materials); };
  return option;
}

Option negative_prompt_option(const std::string& group) {
  Option option{.name = "negative-prompt",
                .aliases = {"-n"},
                .group = group,
                .placeholder = "auto|TEXT",
                .help =
                    "What it shall not look like. auto is what the model names for itself (patina-mini \"a "
                    "clean new object\", so that a prompt acts by what it says beyond that), else nothing.",
                .default_text = "auto",
                .stages = kDetailStage};
  option.set = [](Config& c, Values v) {
    c.detail.negative_prompt = v.front() == "auto" ? std::nullopt : std::optional(v.front());
  };
  option.get = [](const Config& c) { return json(c.detail.negative_prompt.value_or("auto")); };
  return option;
}

Option guidance_scale_option(const std::string& group) {
  Option option{
      .name = "guidance-scale",
      .aliases = {"--cfg-scale"},
      .group = group,
      .placeholder = "auto|G",
      .help =
          "How strongly the prompt acts (classifier-free guidance), 1 to 50; 1 switches guidance off and "
          "halves the time. auto is what the model names for itself (patina-mini 2), else 7.5.",
      .default_text = "auto",
      .stages = kDetailStage};
  const Option named = option;
  option.set = [named](Config& c, Values v) {
    c.detail.guidance_scale =
        v.front() == "auto" ? diffusion::kAutoGuidanceScale : parse_number(named, v.front(), 1.0f, 50.0f);
  };
  option.get = [](const Config& c) {
    return c.detail.guidance_scale == diffusion::kAutoGuidanceScale ? json("auto")
                                                                    : shortest(c.detail.guidance_scale);
  };
  return option;
}

Option texture_size_option() {
  Option option{.name = "texture-size",
                .aliases = {},
                .group = "Inverse rendering",
                .placeholder = "TEXELS|auto",
                .help =
                    "Width and height of the new textures, texels; 0 keeps the asset's own sizes, auto makes "
                    "them larger where the views show more than they can hold.",
                .default_text = "0",
                .stages = kFitStage};
  const Option named = option;
  option.set = [named](Config& c, Values v) {
    c.fit.texture_size =
        v.front() == "auto" ? inverse::kAutoTextureSize : parse_number(named, v.front(), 0, 8192);
  };
  option.get = [](const Config& c) {
    return c.fit.texture_size == inverse::kAutoTextureSize ? json("auto") : json(c.fit.texture_size);
  };
  return option;
}

Option fit_option() {
  Option option{
      .name = "fit",
      .aliases = {},
      .group = "Inverse rendering",
      .placeholder = "MAP",
      .help =
          "Which maps may change: base_color, roughness, normal, metallic (separated by spaces or commas).",
      .default_text = "base_color roughness normal",
      .stages = kFitStage,
      .is_list = true};
  const Option named = option;
  option.set = [named](Config& c, Values v) {
    c.fit.maps.reset();
    for (const std::string& list : v)
      for (size_t begin = 0, end; begin <= list.size(); begin = end + 1) {
        end = std::min(list.find(',', begin), list.size());
        const std::string name = list.substr(begin, end - begin);
        const auto slot = asset::find_map_slot(name);
        if (!slot) refuse(named, "base_color, roughness, normal or metallic", name);
        c.fit.maps.set(index_of(slot->slot));
      }
  };
  option.get = [](const Config& c) {
    json list = json::array();
    for (const asset::MapSlotRow& row : asset::kMapSlots)
      if (has(c.fit.maps, row.slot)) list.push_back(row.name);
    return list;
  };
  return option;
}

Option loras_option(const std::string& group) {
  Option option{.name = "lora",
                .aliases = {},
                .group = group,
                .placeholder = "FILE:WEIGHT",
                .help = "LoRA to merge into the model, and how much of it; may be given several times.",
                .default_text = "none",
                .stages = kDetailStage,
                .is_list = true};
  const Option named = option;
  option.set = [named](Config& c, Values v) {
    c.model.loras.clear();
    for (const std::string& text : v) c.model.loras.push_back(parse_lora(named, text));
  };
  option.get = [](const Config& c) {
    json list = json::array();
    for (const diffusion::LoraChoice& lora : c.model.loras)
      list.push_back(fmt::format("{}:{}", lora.file.string(), lora.weight));
    return list;
  };
  return option;
}

}  // namespace patina::pipeline
