#include "mini_data/noise_volume.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "patina/base/math.h"
#include "patina/base/random.h"

namespace patina::mini_data {
namespace {

constexpr auto kPurpose = RandomPurpose{205};

uint64_t cell_index(ivec3 cell, int cells, uint64_t salt) {
  const auto wrap = [cells](int i) { return static_cast<uint64_t>((i % cells + cells) % cells); };
  return ((salt * 64 + wrap(cell.z)) * 64 + wrap(cell.y)) * 64 + wrap(cell.x);
}

// Random gradients at the corners of a lattice, smoothly joined [Perlin2002].
class GradientLattice {
 public:
  GradientLattice(int cells, uint64_t salt) : cells_(cells) {
    for (int z = 0; z < cells; ++z)
      for (int y = 0; y < cells; ++y)
        for (int x = 0; x < cells; ++x) {
          const auto g = gaussian4(1, kPurpose, cell_index({x, y, z}, cells, salt));
          gradients_.push_back(glm::normalize(vec3(g[0], g[1], g[2])));
        }
  }
  // p in periods.
  float operator()(vec3 p) const {
    p *= static_cast<float>(cells_);
    const ivec3 base(glm::floor(p));
    const vec3 f = p - vec3(base), s = f * f * f * (f * (f * 6.0f - 15.0f) + 10.0f);
    float sum = 0;
    for (int corner = 0; corner < 8; ++corner) {
      const ivec3 step(corner & 1, corner >> 1 & 1, corner >> 2);
      const vec3 w = glm::mix(1.0f - s, s, vec3(step));
      sum += w.x * w.y * w.z * glm::dot(at(base + step), f - vec3(step));
    }
    return sum;
  }

 private:
  const vec3& at(ivec3 cell) const {
    const ivec3 c = ((cell % cells_) + cells_) % cells_;
    return gradients_[static_cast<size_t>((c.z * cells_ + c.y) * cells_ + c.x)];
  }
  int cells_;
  std::vector<vec3> gradients_;
};

}  // namespace

std::vector<float> noise_volume() {
  constexpr size_t n = kNoiseSide, kCount = n * n * n;
  std::vector<float> out(kNumNoiseChannels * kCount);
  const std::array lattices{GradientLattice(kNoiseCells, 1), GradientLattice(2 * kNoiseCells, 2),
                            GradientLattice(4 * kNoiseCells, 3)};

  // One feature point a cell [Worley1996].
  struct Feature {
    vec3 at;
    float strength;
  };
  std::vector<Feature> features;
  for (int z = 0; z < kNoiseCells; ++z)
    for (int y = 0; y < kNoiseCells; ++y)
      for (int x = 0; x < kNoiseCells; ++x) {
        RandomStream random(1, kPurpose, cell_index({x, y, z}, kNoiseCells, 4));
        const vec3 jitter(random.uniform(), random.uniform(), random.uniform());
        features.push_back({vec3(x, y, z) + 0.1f + 0.8f * jitter, random.uniform()});
      }

  for (size_t i = 0; i < kCount; ++i) {
    const vec3 p = (vec3(i % n, i / n % n, i / (n * n)) + 0.5f) / static_cast<float>(n);
    const float large = lattices[0](p), middle = lattices[1](p), small = lattices[2](p);
    out[kClouds * kCount + i] =
        glm::clamp(0.5f + 0.75f * (large + 0.5f * middle + 0.25f * small), 0.0f, 1.0f);
    out[kFineClouds * kCount + i] = glm::clamp(0.5f + 0.8f * (0.6f * middle + 0.7f * small), 0.0f, 1.0f);

    const vec3 q = p * static_cast<float>(kNoiseCells);
    const ivec3 base(glm::floor(q));
    float nearest = 9, second = 9, strength = 0;
    for (int dz = -1; dz <= 1; ++dz)
      for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx) {
          const ivec3 cell = base + ivec3(dx, dy, dz), wrapped = (cell + kNoiseCells) % kNoiseCells;
          const Feature& f =
              features[static_cast<size_t>((wrapped.z * kNoiseCells + wrapped.y) * kNoiseCells + wrapped.x)];
          const float distance = glm::length(f.at + vec3(cell - wrapped) - q);
          if (distance < nearest) {
            second = nearest, nearest = distance, strength = f.strength;
          } else {
            second = std::min(second, distance);
          }
        }
    out[kSpots * kCount + i] = strength * std::max(1.0f - nearest / 0.75f, 0.0f);
    out[kCracks * kCount + i] = std::exp(-square((second - nearest) / 0.09f));
  }
  return out;
}

}  // namespace patina::mini_data
