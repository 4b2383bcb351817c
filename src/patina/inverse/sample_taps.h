// Which texels of a map each sample of the light cache shows, and how much of each: a sparse matrix from
// texels to samples, and its transpose. A fitted map reaches samples, and their derivatives reach the map,
// through it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "patina/inverse/seen_points.h"

namespace patina::inverse {

struct SampleTaps {
  struct Tap {
    uint32_t index = 0;  // texel of the map, or row of the matrix
    float weight = 0;
  };
  std::vector<uint32_t> samples;      // [rows] that show the material, ascending
  std::vector<uint32_t> row_begin;    // [rows + 1] into texel_taps
  std::vector<Tap> texel_taps;        // weights of a row add up to one
  std::vector<uint32_t> texel_begin;  // [texels + 1] into row_taps
  std::vector<Tap> row_taps;          // the transpose
};

/// Of a map laid out as `layout`: each sample's mean over its seen points, where it shows `material`.
SampleTaps make_sample_taps(const asset::Map& layout, asset::MapSlot slot, int material,
                            std::span<const SeenPoint> points);

/// `values`[sample · stride + c] += Σ weight · texels, for each channel of `texels`.
void add_to_samples(const SampleTaps& taps, const Image& texels, size_t stride, float* values);

/// The adjoint: `texels` = Σ weight · values[sample · stride + c].
void gather_from_samples(const SampleTaps& taps, const float* values, size_t stride, Image& texels);

}  // namespace patina::inverse
