// What the tests of the diffusion model share: the small model of random weights and runs that take a
// moment.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "../support.h"
#include "patina/base/random.h"
#include "patina/diffusion/edit.h"

namespace patina::test {

using diffusion::EditInputs, diffusion::EditOptions, diffusion::Dtype, diffusion::Model, diffusion::Scheduler;
using diffusion::find_model_parts;

inline const Model& tiny_model() {
  static const Model model(find_model_parts({data_dir() / "tiny-sd", {}, {}, {}}), {Dtype::kF32});
  return model;
}

/// Of two pictures of one size, dB.
inline double psnr(const Image& a, const Image& b) {
  double squares = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) squares += std::pow(a.pixels[i] - b.pixels[i], 2);
  return -10 * std::log10(squares / static_cast<double>(a.pixels.size()));
}

/// Smooth views of `size`² pixels that differ from one another, and noise for them.
inline EditInputs made_inputs(int grid, int size) {
  EditInputs inputs;
  inputs.grid = grid;
  for (int v = 0; v < grid * grid; ++v) {
    Image tile(size, size, 3), normal(size, size, 3);
    for (int y = 0; y < size; ++y) {
      for (int x = 0; x < size; ++x) {
        const auto u = static_cast<float>(x) / static_cast<float>(size),
                   w = static_cast<float>(y) / static_cast<float>(size);
        tile.set_rgb(x, y, vec3(0.5f + 0.4f * std::sin(9 * u + static_cast<float>(v)), w, 0.3f));
        normal.set_rgb(x, y, vec3(u, w, 0.9f));
      }
    }
    inputs.tile_views.push_back(tile);
    inputs.normal_views.push_back(normal);
  }
  const size_t side = static_cast<size_t>(grid) * static_cast<size_t>(size) / 8;
  inputs.noise.resize(4 * side * side);
  for (size_t i = 0; i < inputs.noise.size(); i += 4) {
    const auto four = gaussian4(3, RandomPurpose::kTest, i);
    std::copy(four.begin(), four.end(), inputs.noise.begin() + static_cast<std::ptrdiff_t>(i));
  }
  return inputs;
}

/// Every pixel favours the pixels at its own place in the other views, at `num_levels` resolutions from
/// `view` latent pixels a side on.
inline std::vector<attention::KeyBuckets> same_place_bias(int grid, int view, int num_levels) {
  std::vector<attention::KeyBuckets> levels;
  for (int level = 0; level < num_levels; ++level) {
    const int radius = level == 0 ? 1 : 0;
    attention::KeyBuckets buckets;
    buckets.grid = grid, buckets.view_width = buckets.view_height = view, buckets.window_radius = radius;
    buckets.offsets.push_back(0);
    for (int y = 0; y < buckets.height(); ++y) {
      for (int x = 0; x < buckets.width(); ++x) {
        for (int vy = 0; vy < grid; ++vy) {
          for (int vx = 0; vx < grid; ++vx) {
            if (vx == x / view && vy == y / view) continue;
            buckets.keys.push_back((vy * view + y % view) * buckets.width() + vx * view + x % view);
          }
        }
        buckets.offsets.push_back(static_cast<int32_t>(buckets.keys.size()));
      }
    }
    levels.push_back(buckets);
    view /= 2;
  }
  return levels;
}

inline EditOptions short_options(Scheduler scheduler = Scheduler::kUniPc) {
  EditOptions options;
  options.prompt = "a rusty old kettle";
  options.num_steps = 5;
  options.strength = 0.8f;
  options.scheduler = scheduler;
  return options;
}

inline double max_difference(const Image& a, const Image& b) {
  EXPECT_EQ(a.pixels.size(), b.pixels.size());
  double difference = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) {
    difference =
        std::max(difference, std::abs(static_cast<double>(a.pixels[i]) - static_cast<double>(b.pixels[i])));
  }
  return difference;
}

}  // namespace patina::test
