#include "patina/render/environment.h"

#include <algorithm>

#include "patina/base/error.h"
#include "patina/base/parallel.h"
#include "patina/image/image_io.h"

namespace patina::render {
namespace {

/// Map coordinates in [0,1]² of a direction: u to the right from the map's left edge, v down from +Y.
vec2 map_from_direction(const vec3& d) {
  // The horizontal length keeps the polar angle accurate near the poles, where acos(y) loses half its digits.
  const float horizontal = std::sqrt(d.x * d.x + d.z * d.z);
  return {0.5f + std::atan2(d.z, d.x) * (0.5f * kInvPi), std::atan2(horizontal, d.y) * kInvPi};
}

int wrapped(int x, int width) {
  const int m = x % width;
  return m < 0 ? m + width : m;
}

/// Index of the interval of a cumulative table of `count` intervals that `u` falls into; intervals of zero
/// width are never chosen. The second value is u's place inside the interval, in [0,1).
struct Chosen {
  int index;
  float inside;
};
Chosen choose(const float* cdf, int count, float u) {
  const float* upper = std::upper_bound(cdf, cdf + count + 1, u);
  int i = static_cast<int>(upper - cdf) - 1;
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
}

vec3 Environment::radiance(const vec3& direction) const {
  const vec2 uv = map_from_direction(direction);
  const float x = uv.x * static_cast<float>(radiance_.width) - 0.5f;
  const float y = uv.y * static_cast<float>(radiance_.height) - 0.5f;
  const float x_floor = std::floor(x), y_floor = std::floor(y);
  const float fx = x - x_floor, fy = y - y_floor;
  const int x0 = wrapped(static_cast<int>(x_floor), radiance_.width);
  const int x1 = x0 + 1 == radiance_.width ? 0 : x0 + 1;
  const int y0 = std::clamp(static_cast<int>(y_floor), 0, radiance_.height - 1);
  const int y1 = std::clamp(static_cast<int>(y_floor) + 1, 0, radiance_.height - 1);
  return (1.0f - fy) * ((1.0f - fx) * radiance_.rgb(x0, y0) + fx * radiance_.rgb(x1, y0)) +
         fy * ((1.0f - fx) * radiance_.rgb(x0, y1) + fx * radiance_.rgb(x1, y1));
}

Environment::Sample Environment::sample(const vec2& u) const {
  const int width = radiance_.width, height = radiance_.height;
  const Chosen row = choose(marginal_cdf_.data(), height, u.y);
  const auto y = static_cast<size_t>(row.index);
  const Chosen column = choose(conditional_cdf_.data() + y * (static_cast<size_t>(width) + 1), width, u.x);

  const double cosine = glm::mix(row_cosine_[y], row_cosine_[y + 1], static_cast<double>(row.inside));
  const auto sine = static_cast<float>(std::sqrt(std::max(0.0, (1.0 - cosine) * (1.0 + cosine))));
  const float azimuth =
      2.0f * kPi * ((static_cast<float>(column.index) + column.inside) / static_cast<float>(width) - 0.5f);
  const vec3 direction(sine * std::cos(azimuth), static_cast<float>(cosine), sine * std::sin(azimuth));
  // The density of the texel that was chosen, not of the one that a rounded direction falls into: beside a
  // bright texel that one may be next to zero.
  return {direction, radiance(direction), texel_pdf(column.index, row.index)};
}

float Environment::pdf(const vec3& direction) const {
  const vec2 uv = map_from_direction(direction);
  const float x = uv.x * static_cast<float>(radiance_.width), y = uv.y * static_cast<float>(radiance_.height);
  return texel_pdf(std::clamp(static_cast<int>(x), 0, radiance_.width - 1),
                   std::clamp(static_cast<int>(y), 0, radiance_.height - 1));
}

float Environment::texel_pdf(int x, int y) const {
  const auto row = static_cast<size_t>(y);
  const float* cdf = conditional_cdf_.data() + row * (static_cast<size_t>(radiance_.width) + 1);
  const float probability = (marginal_cdf_[row + 1] - marginal_cdf_[row]) * (cdf[x + 1] - cdf[x]);
  return probability * static_cast<float>(radiance_.width / (2.0 * std::numbers::pi *
                                                             (row_cosine_[row] - row_cosine_[row + 1])));
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
