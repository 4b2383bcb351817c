#include "patina/pipeline/stage_key.h"

#include <bitset>
#include <filesystem>
#include <type_traits>
#include <vector>

#include <fmt/format.h>

#include "patina/base/files.h"
#include "patina/pipeline/stages.h"

namespace patina::pipeline {
namespace {

// Writes values one after another. Texts carry their length, so that no two lists of values look alike.
class FieldWriter {
 public:
  template <class... Fields>
  void operator()(const Fields&... fields) {
    (add(fields), ...);
  }
  const std::string& text() const { return text_; }

 private:
  void add(const std::string& value) { text_ += fmt::format("{}:{};", value.size(), value); }
  void add(const std::filesystem::path& value) { add(value.native()); }
  template <size_t kBits>
  void add(const std::bitset<kBits>& value) {
    add(value.to_string());
  }
  template <class T>
  void add(const std::optional<T>& value) {
    text_ += value ? "is;" : "none;";
    if (value) add(*value);
  }
  template <class T>
  void add(const std::vector<T>& values) {
    text_ += fmt::format("{};", values.size());
    for (size_t i = 0; i < values.size(); ++i) add(static_cast<T>(values[i]));  // T: a vector of bool too
  }
  template <class T>
  void add(const T& value) {
    if constexpr (std::is_enum_v<T>)
      text_ += fmt::format("{};", static_cast<int>(value));
    else if constexpr (std::is_arithmetic_v<T>)
      text_ += fmt::format("{};", value);
    else
      visit(value, *this);
  }

  std::string text_;
};

// One list of fields a struct. A structured binding names all members or does not compile: whoever adds a
// field adds it here, and it is in the key.
template <class Visitor>
void visit(const diffusion::LoraChoice& s, Visitor& visitor) {
  const auto& [file, weight] = s;
  visitor(file, weight);
}
template <class Visitor>
void visit(const diffusion::ModelPaths& s, Visitor& visitor) {
  const auto& [model, vae, controlnet_tile, controlnet_normal, text_encoder, tokenizer, loras, embeddings,
               model_dirs, prediction] = s;
  visitor(model, vae, controlnet_tile, controlnet_normal, text_encoder, tokenizer, loras, embeddings,
          model_dirs, prediction);
}
template <class Visitor>
void visit(const diffusion::PartPrompt& s, Visitor& visitor) {
  const auto& [prompt, negative_prompt] = s;
  visitor(prompt, negative_prompt);
}
template <class Visitor>
void visit(const diffusion::EditOptions& s, Visitor& visitor) {
  const auto& [prompt, negative_prompt, part_prompts, clip_skip, num_steps, guidance_scale, strength,
               tile_scale, normal_scale, fine_detail, scheduler, bias_weight, bias_scaling, bias_controlnet,
               seed] = s;
  visitor(prompt, negative_prompt, part_prompts, clip_skip, num_steps, guidance_scale, strength, tile_scale,
          normal_scale, fine_detail, scheduler, bias_weight, bias_scaling, bias_controlnet, seed);
}
template <class Visitor>
void visit(const inverse::FitOptions& s, Visitor& visitor) {
  const auto& [iterations, texture_size, maps, light_samples, max_depth, boundary_pixels, fill_unseen,
               keep_in_place, seed] = s;
  visitor(iterations, texture_size, maps, light_samples, max_depth, boundary_pixels, fill_unseen,
          keep_in_place, seed);
}
template <class Visitor>
void visit(const RenderSettings& s, Visitor& visitor) {
  const auto& [samples_per_pixel, max_depth, exposure_ev, seed] = s;
  visitor(samples_per_pixel, max_depth, exposure_ev, seed);
}
template <class Visitor>
void visit(const masks::PlaceAmount& s, Visitor& visitor) {
  const auto& [place, amount] = s;
  visitor(place, amount);
}
template <class Visitor>
void visit(const MaskSettings& s, Visitor& visitor) {
  const auto& [files, vertex_color, strength_for, protect, where] = s;
  visitor(files, vertex_color, strength_for, protect, where);
}
template <class Visitor>
void visit(const EditSettings& s, Visitor& visitor) {
  const auto& [model, dtype, device, low_memory, noise, exemplars, prompt_for, negative_prompt_for, options] =
      s;
  visitor(model, dtype, device, low_memory, noise, exemplars, prompt_for, negative_prompt_for, options);
}
template <class Visitor>
void visit(const FitSettings& s, Visitor& visitor) {
  const auto& [options] = s;
  visitor(options);
}
template <class Visitor>
void visit(const ReportSettings& s, Visitor& visitor) {
  const auto& [turntable_frames, samples_per_pixel, max_depth, boundary_pixels, seed] = s;
  visitor(turntable_frames, samples_per_pixel, max_depth, boundary_pixels, seed);
}

template <class Settings>
std::string fields_of(const Settings& settings) {
  FieldWriter writer;
  visit(settings, writer);
  return writer.text();
}

}  // namespace

std::string text_of(const RenderSettings& settings) {
  return fields_of(settings);
}
std::string text_of(const MaskSettings& settings) {
  return fields_of(settings);
}
std::string text_of(const EditSettings& settings) {
  return fields_of(settings);
}
std::string text_of(const FitSettings& settings) {
  return fields_of(settings);
}
std::string text_of(const ReportSettings& settings) {
  return fields_of(settings);
}

StageKey::StageKey(const Workbench& bench) {
  add(PATINA_VERSION);
  add(bench.hash);
}

StageKey& StageKey::add(std::string_view text) {
  text_ += hash_text(text);
  return *this;
}

StageKey& StageKey::add(float number) {
  return add(fmt::format("{}", number));
}

StageKey& StageKey::add(const Image& image) {
  add(fmt::format("{} {} {}", image.width, image.height, image.channels));
  text_ += hash_bytes(
      {reinterpret_cast<const uint8_t*>(image.pixels.data()), image.pixels.size() * sizeof(float)});
  return *this;
}

StageKey& StageKey::add(std::span<const Image> images) {
  for (const Image& image : images) add(image);
  return *this;
}

StageKey& StageKey::add_materials(const std::vector<bool>& enhanced) {
  std::string text;
  for (const bool may_change : enhanced) text += may_change ? '1' : '0';
  return add(text);
}

StageKey& StageKey::add_strength(const Strength& strength) {
  for (const asset::Map& map : strength.maps) add(map.texels);
  return *this;
}

std::string StageKey::hash() const {
  return hash_text(text_);
}

}  // namespace patina::pipeline
