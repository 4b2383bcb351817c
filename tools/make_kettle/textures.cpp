#include "textures.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

namespace patina::kettle {
namespace {

// Value noise in [-1,1] on a unit lattice, smooth, the same on every machine.
double lattice_value(int64_t x, int64_t y, int64_t z) {
  uint64_t h = static_cast<uint64_t>(x) * 0x9E3779B97F4A7C15u ^
               static_cast<uint64_t>(y) * 0xC2B2AE3D27D4EB4Fu ^
               static_cast<uint64_t>(z) * 0x165667B19E3779F9u;
  h = (h ^ (h >> 31)) * 0xBF58476D1CE4E5B9u;
  h = (h ^ (h >> 29)) * 0x94D049BB133111EBu;
  return static_cast<double>(h >> 40) / static_cast<double>(1 << 23) - 1.0;
}

double noise(const dvec3& p) {
  const dvec3 floor = glm::floor(p), f = p - floor, w = f * f * (3.0 - 2.0 * f);
  const auto x = static_cast<int64_t>(floor.x), y = static_cast<int64_t>(floor.y),
             z = static_cast<int64_t>(floor.z);
  double sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const int i = corner & 1, j = corner >> 1 & 1, k = corner >> 2;
    sum +=
        (i ? w.x : 1 - w.x) * (j ? w.y : 1 - w.y) * (k ? w.z : 1 - w.z) * lattice_value(x + i, y + j, z + k);
  }
  return sum;
}

double fractal_noise(dvec3 p, int octaves) {
  double sum = 0, amplitude = 0.5;
  for (int i = 0; i < octaves; ++i, amplitude *= 0.5, p = p * 2.03 + 17.1) sum += amplitude * noise(p);
  return sum;
}

double smooth(double low, double high, double x) {
  const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

struct Look {
  dvec3 color;  // sRGB
  double roughness, metallic;
  double height;  // metres above the surface, for the normal map
};

// Petrol enamel: a glossy coat of even colour, slightly wavy as fired glass is, with a thin cream line around
// the shoulder.
Look enamel(const Patch& patch, const dvec3& p) {
  const double cloud = fractal_noise(p * 28.0, 3);
  Look look;
  look.color = dvec3(0.098, 0.365, 0.392) * (1 + 0.05 * cloud);
  look.roughness = 0.20 + 0.03 * cloud;
  look.metallic = 0;
  look.height = 2.5e-5 * fractal_noise(p * 130.0 + 5.0, 2);
  if (patch.painted_line) {
    const double radius = std::hypot(p.x, p.z), edge = 0.0004;
    for (const auto& [middle, half_width] : {std::pair{0.0805, 0.0016}, std::pair{0.0855, 0.0005}}) {
      const double inside = 1 - smooth(half_width - edge, half_width + edge, std::abs(radius - middle));
      look.color = glm::mix(look.color, dvec3(0.910, 0.868, 0.770), inside);
      look.height += 4e-5 * inside;
    }
  }
  return look;
}

// Steel brushed along the circumference: streaks vary fast down the island (t) and slowly around (s,
// periodic).
Look steel(const Patch& patch, const dvec3& p, double s, double t) {
  const double angle = 2 * std::numbers::pi * s, down = t * patch.height;
  const auto streaks = [&](double lines_per_metre) {
    return noise({1.7 * std::cos(angle) + 31.0, 1.7 * std::sin(angle), down * lines_per_metre});
  };
  const double fine = streaks(4200), coarse = streaks(900), cloud = fractal_noise(p * 35.0 + 9.0, 2);
  return {dvec3(0.800, 0.790, 0.770) * (1 + 0.018 * fine + 0.012 * coarse + 0.02 * cloud),
          0.27 + 0.035 * fine + 0.02 * coarse + 0.03 * cloud, 1, 2.2e-6 * fine + 5e-6 * coarse};
}

// Walnut: rings around a pith beside the piece, drawn out along X, with fine pores.
Look wood(const dvec3& p) {
  const dvec3 bent = p + 0.0035 * dvec3(0, noise(p * dvec3(24, 60, 60)), noise(p * dvec3(24, 60, 60) + 40.0));
  const double ring = std::hypot(bent.y - 0.292, bent.z + 0.021) * 460.0;
  const double phase = ring - std::floor(ring),
               late = smooth(0.15, 0.85, phase) * (1 - smooth(0.88, 1.0, phase));
  const double pores = smooth(0.35, 0.75, noise(p * dvec3(160, 2300, 2300)));
  const double cloud = fractal_noise(p * dvec3(18, 70, 70), 3);
  return {glm::mix(dvec3(0.430, 0.270, 0.165), dvec3(0.285, 0.165, 0.100), 0.75 * late) *
              (1 + 0.14 * cloud - 0.16 * pores),
          0.46 + 0.05 * late + 0.08 * pores + 0.03 * cloud, 0, -2.2e-5 * pores - 6e-6 * late};
}

Look look_at(const Patch& patch, double s, double t) {
  const dvec3 p = patch.position(s, t);
  switch (patch.material) {
    case MaterialId::kEnamel:
      return enamel(patch, p);
    case MaterialId::kSteel:
      return steel(patch, p, s, t);
    case MaterialId::kWood:
      return wood(p);
  }
  return {};
}

// The island on or nearest to which `uv` lies, by the distance to its rectangle.
const Patch* nearest_patch(const std::vector<Patch>& patches, MaterialId material, const dvec2& uv) {
  const Patch* nearest = nullptr;
  double nearest_distance = std::numeric_limits<double>::infinity();
  for (const Patch& patch : patches) {
    if (patch.material != material) continue;
    const dvec2 end = patch.uv_corner + patch.uv_scale * dvec2(patch.width, patch.height);
    const double distance = glm::length(uv - glm::clamp(uv, patch.uv_corner, end));
    if (distance < nearest_distance) nearest_distance = distance, nearest = &patch;
  }
  return nearest;
}

}  // namespace

Textures make_textures(const std::vector<Patch>& patches, MaterialId material, int size) {
  Textures out{Image(size, size, 3), Image(size, size, 3), Image(size, size, 3)};
  for (int y = 0; y < size; ++y)
    for (int x = 0; x < size; ++x) {
      // Height beside the texel in the image's own directions: right is +X of the tangent frame, up is +Y.
      const dvec2 center((x + 0.5) / size, (y + 0.5) / size);
      const Patch& patch = *nearest_patch(patches, material, center);
      const auto look = [&](double dx, double dy) {
        const Parameter at = parameter_at(patch, center + dvec2(dx, dy) / static_cast<double>(size));
        return look_at(patch, at.s, at.t);
      };
      const Look here = look(0, 0);
      const double metres = 1.0 / (patch.uv_scale * size);  // across one texel
      const double rise_right = (look(0.5, 0).height - look(-0.5, 0).height) / metres;
      const double rise_up = (look(0, -0.5).height - look(0, 0.5).height) / metres;
      const dvec3 normal = glm::normalize(dvec3(-rise_right, -rise_up, 1));
      out.base_color.set_rgb(x, y, vec3(here.color));
      out.metallic_roughness.set_rgb(x, y, vec3(1, here.roughness, here.metallic));
      out.normal.set_rgb(x, y, vec3(0.5 + 0.5 * normal));
    }
  return out;
}

}  // namespace patina::kettle
