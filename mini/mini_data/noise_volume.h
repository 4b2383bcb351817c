// Periodic noise in a cube, made once and looked up at any size: clouds, spots, cracks, fine clouds.
#pragma once

#include <vector>

namespace patina::mini_data {

/// Cells of the largest features along a side of the cube, and texels along it.
inline constexpr int kNoiseCells = 8, kNoiseSide = 96;
/// [0] clouds in [0,1], mean ½; [1] spots: highest at the middle of cells, of unequal strength; [2] cracks: 1
/// on the borders of cells, 0 away from them; [3] finer clouds.
enum NoiseChannel { kClouds, kSpots, kCracks, kFineClouds, kNumNoiseChannels };

/// [kNumNoiseChannels, kNoiseSide³], x fastest; the opposite faces fit.
std::vector<float> noise_volume();

}  // namespace patina::mini_data
