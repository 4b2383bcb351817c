// Kinds of material that an edit shows: rust here, paint there. Texels of one kind look alike before and
// after the edit, so what a single pixel hardly tells (how rough, whether a metal) is asked of all of them
// together. This is what shared specular parameters of clusters are to measured objects [Lensch2003].
#pragma once

#include <span>
#include <vector>

#include "patina/inverse/light_cache.h"
#include "patina/inverse/sample_taps.h"
#include "patina/inverse/texture_field.h"

namespace patina::inverse {

/// Sorts what a material's samples show into kinds: by the colour that they have, by the colour that the edit
/// gives them, light divided out, and by how rough and metallic they are.
class MaterialKinds {
 public:
  /// `clean_radiance`: of the cache's samples under the starting maps. `samples`: those that show the
  /// material.
  MaterialKinds(const LightCache& cache, std::span<const vec3> clean_radiance, float gain,
                std::span<const uint32_t> samples);

  size_t size() const { return centres_.size(); }

  /// The kind that each sample belongs to most.
  std::vector<uint16_t> kinds_of(std::span<const uint32_t> samples) const;

  /// Of each texel of a map that is seen through `taps`.
  KindShares shares(const SampleTaps& taps) const;

 private:
  static constexpr size_t kNumFeatures = 8;
  using Feature = std::array<float, kNumFeatures>;

  static Feature feature_of(const CachePixel& pixel, const CacheSample& sample, const vec3& clean_radiance,
                            float gain);
  void find_centres(std::span<const uint32_t> samples);

  std::vector<Feature> features_;  // of all samples of the cache
  std::vector<float> weights_;
  std::vector<Feature> centres_;
  float width_ = 0;  // of a kind: what differs by less is as good as the same
};

}  // namespace patina::inverse
