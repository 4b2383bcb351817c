#include "patina/render/environment.h"

#include <algorithm>

#include "patina/base/error.h"
#include "patina/base/parallel.h"
#include "patina/image/image_io.h"

namespace patina::render {
namespace {

/// atan2 to 2e-7 rad, an eighth of the library's time: a polynomial on [0,1] [Abramowitz1964, 4.4.49] and the
/// symmetries of the octants.
float fast_atan2(float y, float x) {
  const float ax = std::abs(x), ay = std::abs(y);
  const float larger = std::max(ax, ay), smaller = std::min(ax, ay);
  const float t = larger > 0.0f ? smaller / larger : 0.0f;
  const float t2 = t * t;
  float p = 0.0028662257f;
  p = p * t2 - 0.0161657367f;
  p = p * t2 + 0.0429096138f;
  p = p * t2 - 0.0752896400f;
  p = p * t2 + 0.1065626393f;
  p = p * t2 - 0.1420889944f;
  p = p * t2 + 0.1999355085f;
  p = p * t2 - 0.3333314528f;
  float angle = t + t * t2 * p;
  if (ay > ax) angle = 0.5f * kPi - angle;
  if (x < 0.0f) angle = kPi - angle;
  return std::copysign(angle, y);
}

/// Map coordinates in [0,1]² of a direction: u to the right from the map's left edge, v down from +Y.
vec2 map_from_direction(const vec3& d) {
  // The horizontal length keeps the polar angle accurate near the poles, where acos(y) loses half its digits.
  const float horizontal = std::sqrt(d.x * d.x + d.z * d.z);
  return {0.5f + fast_atan2(d.z, d.x) * (0.5f * kInvPi), fast_atan2(horizontal, d.y) * kInvPi};
}

int wrapped(int x, int width) {
  const int m = x % width;
  return m < 0 ? m + width : m;
}

/// For every u = k / count the interval of the cumulative table that it falls into: a search that begins
/// there takes two steps on average, whatever the table holds [Chen1974].
void fill_guide(const float* cdf, int count, int32_t* guide) {
  int i = 0;
  for (int k = 0; k < count; ++k) {
    const float u = static_cast<float>(k) / static_cast<float>(count);
    while (i + 1 < count && cdf[i + 1] <= u) ++i;
    guide[k] = i;
  }
}

/// Index of the interval of a cumulative table of `count` intervals that `u` falls into; intervals of zero
/// width are never chosen. The second value is u's place inside the interval, in [0,1).
struct Chosen {
  int index;
  float inside;
};
Chosen choose(const float* cdf, const int32_t* guide, int count, float u) {
  int i = guide[std::min(static_cast<int>(u * static_cast<float>(count)), count - 1)];
  while (i > 0 && cdf[i] > u) --i;  // u · count was rounded up
  while (i < count && cdf[i + 1] <= u) ++i;
  if (i >= count) {  // u rounded up to the table's end: take the last interval that has a width
    i = count - 1;
    while (i > 0 && !(cdf[i + 1] > cdf[i])) --i;
  }
  const float width = cdf[i + 1] - cdf[i];
  return {i, width > 0.0f ? std::min((u - cdf[i]) / width, 0x1.fffffep-1f) : 0.5f};
}

/// Cumulative sums of `weights`, divided by their total, so that the last entry is exactly one; uniform if
/// all are zero.
void cumulate(const float* weights, int count, float* cdf) {
  double total = 0;
  for (int i = 0; i < count; ++i) total += weights[i];
  double sum = 0;
  cdf[0] = 0.0f;
  for (int i = 0; i < count; ++i) {
    sum += total > 0 ? weights[i] / total : 1.0 / count;
    cdf[i + 1] = static_cast<float>(sum);
  }
  cdf[count] = 1.0f;
}

void validate(const Image& map) {
  if (map.channels != 3 || map.width < 1 || map.height < 1)
    throw Error(ErrorCode::kFormat, "environment map",
                "expected an image with 3 channels and at least one pixel");
  for (const float value : map.pixels)
    if (!std::isfinite(value) || value < 0.0f)
      throw Error(ErrorCode::kFormat, "environment map",
                  "expected finite radiance of zero or more, found " + std::to_string(value));
}

}  // namespace

Environment::Environment(Image radiance) : radiance_(std::move(radiance)) {
  validate(radiance_);
  const int width = radiance_.width, height = radiance_.height;

  // In double: next to the poles of a large map the cosines of two rows differ by less than a float resolves.
  row_cosine_.resize(static_cast<size_t>(height) + 1);
  for (int y = 0; y <= height; ++y)
    row_cosine_[static_cast<size_t>(y)] = std::cos(std::numbers::pi * y / height);

  // The mean over a texel of the bilinear look-up is its 3 × 3 neighbourhood weighted by (1/8, 6/8, 1/8) each
  // way: it is zero only where the look-up is zero all over the texel.
  const auto mean_of_channels = [&](int x, int y) {
    const float* p = radiance_.at(wrapped(x, width), std::clamp(y, 0, height - 1));
    return (p[0] + p[1] + p[2]) * (1.0f / 3.0f);
  };
  constexpr float kKernel[3] = {0.125f, 0.75f, 0.125f};
  conditional_cdf_.resize(static_cast<size_t>(height) * (static_cast<size_t>(width) + 1));
  std::vector<float> row_weight(static_cast<size_t>(height));
  parallel_for(0, height, 16, [&](int64_t begin, int64_t end) {
    std::vector<float> column(static_cast<size_t>(width)), weights(static_cast<size_t>(width));
    for (int y = static_cast<int>(begin); y < end; ++y) {
      for (int x = 0; x < width; ++x)
        column[static_cast<size_t>(x)] = kKernel[0] * mean_of_channels(x, y - 1) +
                                         kKernel[1] * mean_of_channels(x, y) +
                                         kKernel[2] * mean_of_channels(x, y + 1);
      double sum = 0;
      for (int x = 0; x < width; ++x) {
        const auto at = [&](int i) { return column[static_cast<size_t>(wrapped(i, width))]; };
        weights[static_cast<size_t>(x)] =
            kKernel[0] * at(x - 1) + kKernel[1] * at(x) + kKernel[2] * at(x + 1);
        sum += weights[static_cast<size_t>(x)];
      }
      const auto row = static_cast<size_t>(y);
      row_weight[row] = static_cast<float>(sum / width * (row_cosine_[row] - row_cosine_[row + 1]));
      cumulate(weights.data(), width, conditional_cdf_.data() + row * (static_cast<size_t>(width) + 1));
    }
  });

  double total = 0;
  for (const float weight : row_weight) total += weight;
  mean_radiance_ = static_cast<float>(0.5 * total);
  if (!(total > 0))  // a black map: directions uniform over the sphere
    for (size_t y = 0; y < row_weight.size(); ++y)
      row_weight[y] = static_cast<float>(row_cosine_[y] - row_cosine_[y + 1]);
  marginal_cdf_.resize(static_cast<size_t>(height) + 1);
  cumulate(row_weight.data(), height, marginal_cdf_.data());

  marginal_guide_.resize(static_cast<size_t>(height));
  fill_guide(marginal_cdf_.data(), height, marginal_guide_.data());
  const auto columns = static_cast<size_t>(width);
  conditional_guide_.resize(static_cast<size_t>(height) * columns);
  texels_.resize(static_cast<size_t>(height) * columns);
  parallel_for(0, height, 16, [&](int64_t begin, int64_t end) {
    for (auto y = static_cast<size_t>(begin); y < static_cast<size_t>(end); ++y) {
      const float* cdf = conditional_cdf_.data() + y * (columns + 1);
      fill_guide(cdf, width, conditional_guide_.data() + y * columns);
      const double texel_angle = 2.0 * std::numbers::pi / width * (row_cosine_[y] - row_cosine_[y + 1]);
      for (size_t x = 0; x < columns; ++x) {
        const float probability = (marginal_cdf_[y + 1] - marginal_cdf_[y]) * (cdf[x + 1] - cdf[x]);
        const float* radiance_here = radiance_.pixels.data() + 3 * (y * columns + x);
        texels_[y * columns + x] = vec4(radiance_here[0], radiance_here[1], radiance_here[2],
                                        static_cast<float>(probability / texel_angle));
      }
    }
  });
}

Environment::Arrival Environment::arrival(const vec3& direction) const {
  const vec2 uv = map_from_direction(direction);
  const int width = radiance_.width, height = radiance_.height;
  const float x = uv.x * static_cast<float>(width), y = uv.y * static_cast<float>(height);
  // The texel that holds the direction is one of the four that the bilinear look-up reads.
  const int column = std::clamp(static_cast<int>(x), 0, width - 1);
  const int row = std::clamp(static_cast<int>(y), 0, height - 1);
  const float from_centre_x = x - static_cast<float>(column) - 0.5f;
  const float from_centre_y = y - static_cast<float>(row) - 0.5f;
  int beside = from_centre_x < 0.0f ? column - 1 : column + 1;
  beside = beside < 0 ? width - 1 : beside >= width ? 0 : beside;
  const int below = std::clamp(from_centre_y < 0.0f ? row - 1 : row + 1, 0, height - 1);
  const vec4* near = texels_.data() + static_cast<size_t>(row) * static_cast<size_t>(width);
  const vec4* far = texels_.data() + static_cast<size_t>(below) * static_cast<size_t>(width);
  const float fx = std::abs(from_centre_x), fy = std::abs(from_centre_y);
  const vec4 here = near[column];
  const vec4 sum = (1.0f - fy) * ((1.0f - fx) * here + fx * near[beside]) +
                   fy * ((1.0f - fx) * far[column] + fx * far[beside]);
  return {vec3(sum), here.w};
}

Environment::Sample Environment::sample(const vec2& u) const {
  const int width = radiance_.width, height = radiance_.height;
  const Chosen row = choose(marginal_cdf_.data(), marginal_guide_.data(), height, u.y);
  const auto y = static_cast<size_t>(row.index), columns = static_cast<size_t>(width);
  const Chosen column = choose(conditional_cdf_.data() + y * (columns + 1),
                               conditional_guide_.data() + y * columns, width, u.x);

  const double cosine = glm::mix(row_cosine_[y], row_cosine_[y + 1], static_cast<double>(row.inside));
  const auto sine = static_cast<float>(std::sqrt(std::max(0.0, (1.0 - cosine) * (1.0 + cosine))));
  const float azimuth =
      2.0f * kPi * ((static_cast<float>(column.index) + column.inside) / static_cast<float>(width) - 0.5f);
  const vec3 direction(sine * std::cos(azimuth), static_cast<float>(cosine), sine * std::sin(azimuth));
  // The density of the texel that was chosen, not of the one that a rounded direction falls into: beside a
  // bright texel that one may be next to zero.
  return {direction, radiance(direction), texels_[y * columns + static_cast<size_t>(column.index)].w};
}

Environment environment_of(const std::function<vec3(const vec3&)>& light) {
  constexpr int kWidth = 512, kHeight = 256;
  Image map(kWidth, kHeight, 3);
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) {
      const float polar = kPi * (static_cast<float>(y) + 0.5f) / kHeight;
      const float azimuth = 2.0f * kPi * ((static_cast<float>(x) + 0.5f) / kWidth - 0.5f);
      map.set_rgb(x, y,
                  light(vec3(std::sin(polar) * std::cos(azimuth), std::cos(polar),
                             std::sin(polar) * std::sin(azimuth))));
    }
  return Environment(std::move(map));
}

Environment constant_environment(const vec3& radiance) {
  Image map(1, 1, 3);
  map.set_rgb(0, 0, radiance);
  return Environment(std::move(map));
}

Environment read_environment(const std::filesystem::path& path) {
  return Environment(read_hdr(path));
}

}  // namespace patina::render
