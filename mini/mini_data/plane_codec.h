// Compresses stacks of float planes (light, geometry, textures) into few bytes: an 8 × 8 cosine transform,
// one step of quantisation a plane, adaptive range coding. Standard library only, so that a machine with a
// GPU and nothing else can read the data; each plane chooses its own precision, which picture formats do not
// offer.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace patina::mini_data {

/// planes[c][y · width + x], any range; width and height are multiples of eight.
struct PlaneStack {
  int width = 0, height = 0;
  std::vector<std::vector<float>> planes;
};

/// How finely a plane is kept. The root-mean-square error of a value is at most `step` / √12 where every
/// coefficient is alive, far less in smooth parts. The k-th diagonal of frequencies (0 to 14) is coarser by
/// 1 + k · slope.
struct PlanePrecision {
  float step = 1.0f / 255.0f;
  float slope = 0.0f;
};

/// The same planes give the same bytes. `precision` has one entry a plane.
std::vector<uint8_t> encode_planes(const PlaneStack& stack, std::span<const PlanePrecision> precision);

/// Throws Error{kFormat} with `name` as context for bytes that are no such stack, or that end early.
PlaneStack decode_planes(std::span<const uint8_t> bytes, const std::string& name);

}  // namespace patina::mini_data
