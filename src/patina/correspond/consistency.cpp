// Warps the edit of each view into every other and compares: correlation and PSNR over co-visible pixels.
#include "patina/correspond/consistency.h"

#include <algorithm>
#include <optional>
#include <string>

#include "patina/base/error.h"
#include "patina/base/parallel.h"
#include "patina/correspond/footprint.h"

namespace patina::correspond {
namespace {

constexpr float kMinCosine = 0.2f;
// Pixels between a counted one and the nearest that does not show enhanced surface: the diffusion model's
// outlines wander.
constexpr int kMargin = 3;
// Surface at the four taps of a bilinear look-up may differ in depth by this share; more is an edge between
// two surfaces. At kMinCosine a pixel of a 35° view of 256 pixels spans 1.2 % of its distance.
constexpr float kMaxDepthStep = 0.02f;

// Sums over the co-visible pixels of one ordered pair of views, each weighted by its area, for Pearson's
// coefficient over all channels about each channel's own mean.
struct PairSums {
  glm::dvec3 a{0}, b{0}, aa{0}, bb{0}, ab{0}, squared_difference{0};
  double area = 0;
  int64_t pixels = 0;

  void add(const vec3& edit_a, const vec3& edit_b, double weight) {
    const glm::dvec3 x(edit_a), y(edit_b);
    a += weight * x, b += weight * y;
    aa += weight * x * x, bb += weight * y * y, ab += weight * x * y;
    squared_difference += weight * (x - y) * (x - y);
    area += weight;
    ++pixels;
  }
  void add(const PairSums& other) {
    a += other.a, b += other.b, aa += other.aa, bb += other.bb, ab += other.ab;
    squared_difference += other.squared_difference, area += other.area, pixels += other.pixels;
  }
  // nullopt where one of the edits is constant: then there is nothing to correlate.
  std::optional<double> correlation() const {
    double var_a = 0, var_b = 0, covariance = 0;
    for (int channel = 0; channel < 3; ++channel) {
      var_a += aa[channel] / area - a[channel] / area * (a[channel] / area);
      var_b += bb[channel] / area - b[channel] / area * (b[channel] / area);
      covariance += ab[channel] / area - a[channel] / area * (b[channel] / area);
    }
    // Deviations below a hundredth of an 8-bit step are rounding.
    constexpr double kRounding = (0.01 / 255.0) * (0.01 / 255.0);
    if (!(var_a > kRounding) || !(var_b > kRounding)) return std::nullopt;
    return covariance / std::sqrt(var_a * var_b);
  }
};

// Surface in m² that a pixel shows: a pixel φ off the axis spans cos³φ / f² steradians at the distance
// depth / cos φ, and the surface leans by θ.
double surface_area(const views::View& view, size_t pixel) {
  const auto depth = static_cast<double>(view.gbuffer.depth[pixel]);
  const vec3 to_point = view.gbuffer.p_world[pixel] - view.camera.position();
  const double cos_axis = depth / static_cast<double>(glm::length(to_point));
  const auto focal = static_cast<double>(view.camera.focal_pixels());
  return depth * depth * cos_axis / (focal * focal * static_cast<double>(view.gbuffer.view_cosine[pixel]));
}

// Pixels that count: enhanced surface at no grazing angle, no pixel of another kind within kMargin.
std::vector<uint8_t> counted_pixels(const views::GBuffer& gbuffer, int num_asset_primitives) {
  const int width = gbuffer.width, height = gbuffer.height;
  const auto index = [&](int x, int y) {
    return static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x);
  };
  const auto enhanced = [&](int x, int y) {
    const int32_t primitive = gbuffer.primitive[index(x, y)];
    return primitive >= 0 && primitive < num_asset_primitives;
  };
  // Distance to the nearest foreign pixel of the row first, then of the column: a square margin in two
  // passes.
  std::vector<uint8_t> row_clear(index(0, height)), out(index(0, height));
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      bool clear = true;
      for (int u = std::max(x - kMargin, 0); u <= std::min(x + kMargin, width - 1); ++u)
        clear = clear && enhanced(u, y);
      row_clear[index(x, y)] = clear;
    }
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      bool clear = gbuffer.view_cosine[index(x, y)] >= kMinCosine;
      for (int v = std::max(y - kMargin, 0); v <= std::min(y + kMargin, height - 1); ++v)
        clear = clear && row_clear[index(x, v)];
      out[index(x, y)] = clear;
    }
  return out;
}

// The four pixels and weights around continuous coordinates, all inside the image; nullopt in the outermost
// half pixel.
struct Taps {
  std::array<size_t, 4> pixel;
  std::array<float, 4> weight;
};
std::optional<Taps> taps_at(const vec2& at, int width, int height) {
  const vec2 corner = at - vec2(0.5f);
  const int x = static_cast<int>(std::floor(corner.x)), y = static_cast<int>(std::floor(corner.y));
  if (x < 0 || y < 0 || x + 1 >= width || y + 1 >= height) return std::nullopt;
  const float u = corner.x - static_cast<float>(x), v = corner.y - static_cast<float>(y);
  const size_t first = static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x);
  const auto below = first + static_cast<size_t>(width);
  return Taps{{first, first + 1, below, below + 1}, {(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v}};
}

void check_images(const views::ViewSet& views, std::span<const Image> images, const char* what) {
  if (images.size() != views.views.size())
    throw Error(ErrorCode::kUsage, what,
                "expected one image a view, " + std::to_string(views.views.size()) + ", found " +
                    std::to_string(images.size()));
  for (size_t i = 0; i < images.size(); ++i) {
    const views::GBuffer& gbuffer = views.views[i].gbuffer;
    if (images[i].width != gbuffer.width || images[i].height != gbuffer.height || images[i].channels != 3)
      throw Error(ErrorCode::kUsage, std::string(what) + " " + std::to_string(i),
                  "expected " + std::to_string(gbuffer.width) + " x " + std::to_string(gbuffer.height) +
                      " pixels of 3 channels, found " + std::to_string(images[i].width) + " x " +
                      std::to_string(images[i].height) + " of " + std::to_string(images[i].channels));
  }
}

}  // namespace

Consistency edit_consistency(const render::Scene& scene, const views::ViewSet& views,
                             std::span<const Image> conditioning, std::span<const Image> edited) {
  check_images(views, conditioning, "conditioning image");
  check_images(views, edited, "edited image");
  const size_t num_views = views.views.size();
  std::vector<std::vector<uint8_t>> counted;
  for (const views::View& view : views.views)
    counted.push_back(counted_pixels(view.gbuffer, scene.num_asset_primitives()));
  const auto edit_at = [&](size_t view, size_t pixel) {
    const float* after = &edited[view].pixels[3 * pixel];
    const float* before = &conditioning[view].pixels[3 * pixel];
    return vec3(after[0] - before[0], after[1] - before[1], after[2] - before[2]);
  };

  // Row sums are kept apart and added in order, so that threads do not change the result.
  Consistency out;
  double weighted_correlation = 0, correlated_area = 0, squared_difference = 0;
  for (size_t a = 0; a < num_views; ++a) {
    const views::GBuffer& from = views.views[a].gbuffer;
    const vec3 eye = views.views[a].camera.position();
    std::vector<PairSums> rows(static_cast<size_t>(from.height) * num_views);
    parallel_for(0, from.height, 4, [&](int64_t begin, int64_t end) {
      for (int64_t y = begin; y < end; ++y) {
        for (int x = 0; x < from.width; ++x) {
          const size_t pixel =
              static_cast<size_t>(y) * static_cast<size_t>(from.width) + static_cast<size_t>(x);
          if (!counted[a][pixel]) continue;
          const vec3 p_world = from.p_world[pixel];
          vec3 n_world = from.n_geometric_world[pixel];
          if (glm::dot(n_world, eye - p_world) < 0.0f) n_world = -n_world;
          const auto primitive = static_cast<uint32_t>(from.primitive[pixel]);
          const vec3 edit = edit_at(a, pixel);
          const double area = surface_area(views.views[a], pixel);
          for (size_t b = 0; b < num_views; ++b) {
            if (b == a) continue;
            const views::View& target = views.views[b];
            const auto projection = target.camera.project(p_world);
            if (!projection) continue;
            const auto taps = taps_at(projection->pixel, target.gbuffer.width, target.gbuffer.height);
            if (!taps) continue;
            // The G-buffer tells most hidden points from seen ones without a ray.
            bool usable = true;
            for (const size_t tap : taps->pixel)
              usable = usable && counted[b][tap] &&
                       std::abs(target.gbuffer.depth[tap] - projection->depth) <=
                           kMaxDepthStep * projection->depth;
            if (!usable || !seen_from(scene, target.camera, primitive, p_world, n_world)) continue;
            vec3 warped(0.0f);
            for (size_t tap = 0; tap < 4; ++tap) warped += taps->weight[tap] * edit_at(b, taps->pixel[tap]);
            rows[static_cast<size_t>(y) * num_views + b].add(edit, warped, area);
          }
        }
      }
    });
    for (size_t b = 0; b < num_views; ++b) {
      PairSums pair;
      for (size_t y = 0; y < static_cast<size_t>(from.height); ++y) pair.add(rows[y * num_views + b]);
      if (pair.pixels == 0) continue;
      out.covisible_pixels += pair.pixels;
      out.covisible_area += pair.area;
      squared_difference +=
          (pair.squared_difference.x + pair.squared_difference.y + pair.squared_difference.z) / 3.0;
      if (const auto correlation = pair.correlation()) {
        weighted_correlation += *correlation * pair.area;
        correlated_area += pair.area;
      }
    }
  }
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  out.edit_correlation =
      correlated_area > 0 ? static_cast<float>(weighted_correlation / correlated_area) : kNone;
  if (out.covisible_pixels == 0)
    out.edit_psnr = kNone;
  else if (squared_difference > 0)
    out.edit_psnr = static_cast<float>(-10.0 * std::log10(squared_difference / out.covisible_area));
  else
    out.edit_psnr = std::numeric_limits<float>::infinity();
  return out;
}

}  // namespace patina::correspond
