// The key of a stage: a hash of all that the stage reads. Every settings struct goes in whole, by one list of
// its fields that does not compile while a field is missing.
#pragma once

#include <initializer_list>
#include <span>
#include <string>
#include <string_view>

#include "patina/image/image.h"
#include "patina/pipeline/settings.h"
#include "patina/pipeline/workbench.h"

namespace patina::pipeline {

struct Strength;

/// A text of every field's value. Equal for equal settings, different for different ones.
std::string text_of(const RenderSettings& settings);
std::string text_of(const MaskSettings& settings);
std::string text_of(const EditSettings& settings);
std::string text_of(const FitSettings& settings);
std::string text_of(const ReportSettings& settings);

/// Collects what a stage reads. Scene, cameras and patina's version are in every key.
class StageKey {
 public:
  explicit StageKey(const Workbench& bench);
  template <class Settings>
  StageKey(const Workbench& bench, const Settings& settings) : StageKey(bench) {
    add(text_of(settings));
  }

  StageKey& add(std::string_view text);
  StageKey& add(float number);
  StageKey& add(const Image& image);
  StageKey& add(std::span<const Image> images);
  /// How strongly each texel may change: nothing where there are no masks.
  StageKey& add_strength(const Strength& strength);
  /// Which materials may change: read by the stages that look at the enhanced surface alone.
  StageKey& add_materials(const std::vector<bool>& enhanced);

  std::string hash() const;

 private:
  std::string text_;
};

}  // namespace patina::pipeline
