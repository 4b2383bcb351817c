#include "patina/report/color_difference.h"

#include <limits>

#include "patina/base/check.h"
#include "patina/image/color.h"
#include "patina/image/lab.h"

namespace patina::report {
namespace {

glm::dvec3 lab_at(const Image& srgb, size_t pixel) {
  const float* p = srgb.pixels.data() + 3 * pixel;
  return glm::dvec3(
      lab_from_linear({linear_from_srgb(p[0]), linear_from_srgb(p[1]), linear_from_srgb(p[2])}));
}

}  // namespace

std::vector<double> material_color_differences(std::span<const PicturePair> views, size_t num_materials) {
  struct Sum {
    double pixels = 0;
    glm::dvec3 a{0.0}, b{0.0};
  };
  std::vector<double> difference(num_materials, 0), pixels(num_materials, 0);
  for (const PicturePair& view : views) {
    PATINA_CHECK_EQ(view.a->num_pixels(), view.b->num_pixels());
    PATINA_CHECK_EQ(view.a->num_pixels(), view.material.size());
    std::vector<Sum> sums(num_materials);
    for (size_t i = 0; i < view.material.size(); ++i) {
      if (view.material[i] < 0 || static_cast<size_t>(view.material[i]) >= num_materials) continue;
      if (view.weight->pixels[i] < 0.5f) continue;
      Sum& sum = sums[static_cast<size_t>(view.material[i])];
      sum.pixels += 1, sum.a += lab_at(*view.a, i), sum.b += lab_at(*view.b, i);
    }
    for (size_t m = 0; m < num_materials; ++m)
      if (sums[m].pixels > 0) {
        difference[m] += glm::length(sums[m].a - sums[m].b);  // pixels · ΔE
        pixels[m] += sums[m].pixels;
      }
  }
  for (size_t m = 0; m < num_materials; ++m)
    difference[m] = pixels[m] > 0 ? difference[m] / pixels[m] : std::numeric_limits<double>::quiet_NaN();
  return difference;
}

}  // namespace patina::report
