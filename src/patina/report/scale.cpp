#include "patina/report/scale.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "patina/base/check.h"
#include "patina/base/parallel.h"
#include "patina/image/color.h"

namespace patina::report {
namespace {

// Weights with which the source pixels first .. first + weight.size() - 1 enter one target pixel; they sum to
// one.
struct Footprint {
  int first = 0;
  std::vector<float> weight;
};

std::vector<Footprint> footprints(int source, int target) {
  std::vector<Footprint> out(static_cast<size_t>(target));
  const double step = static_cast<double>(source) / target;
  for (int i = 0; i < target; ++i) {
    Footprint& footprint = out[static_cast<size_t>(i)];
    if (source >= target) {  // shrink: overlap of [begin, end) with each source pixel
      const double begin = i * step, end = std::min((i + 1) * step, static_cast<double>(source));
      footprint.first = std::min(static_cast<int>(begin), source - 1);
      for (int s = footprint.first; s < source && s < end; ++s)
        footprint.weight.push_back(static_cast<float>(
            (std::min(end, s + 1.0) - std::max(begin, static_cast<double>(s))) / (end - begin)));
    } else {  // enlarge: between the two nearest centres, clamped at the border
      const double x = std::clamp((i + 0.5) * step - 0.5, 0.0, source - 1.0);
      footprint.first = std::min(static_cast<int>(x), std::max(source - 2, 0));
      const auto t = static_cast<float>(x - footprint.first);
      footprint.weight = source > 1 ? std::vector<float>{1.0f - t, t} : std::vector<float>{1.0f};
    }
  }
  return out;
}

}  // namespace

Image scaled(const Image& image, int width, int height) {
  PATINA_CHECK(!image.empty() && width > 0 && height > 0);
  if (image.width == width && image.height == height) return image;
  const auto columns = footprints(image.width, width), rows = footprints(image.height, height);
  const auto channels = static_cast<size_t>(image.channels);

  // Rows are independent: gather the source rows first, then the columns of that one line.
  Image out(width, height, image.channels);
  parallel_for(0, height, 8, [&](int64_t begin, int64_t end) {
    std::vector<float> line(static_cast<size_t>(image.width) * channels);
    for (int64_t y = begin; y < end; ++y) {
      const Footprint& row = rows[static_cast<size_t>(y)];
      std::fill(line.begin(), line.end(), 0.0f);
      for (size_t k = 0; k < row.weight.size(); ++k) {
        const float* source = image.at(0, row.first + static_cast<int>(k));
        for (size_t i = 0; i < line.size(); ++i) line[i] += row.weight[k] * source[i];
      }
      float* target = out.at(0, static_cast<int>(y));
      for (const Footprint& column : columns) {
        for (size_t c = 0; c < channels; ++c) {
          float sum = 0;
          for (size_t k = 0; k < column.weight.size(); ++k)
            sum += column.weight[k] * line[(static_cast<size_t>(column.first) + k) * channels + c];
          *target++ = sum;
        }
      }
    }
  });
  return out;
}

Image scaled_srgb(const Image& srgb, int width, int height) {
  if (srgb.width == width && srgb.height == height) return srgb;
  return srgb_from_linear(scaled(linear_from_srgb(srgb), width, height));
}

Image as_rgb(const Image& image) {
  if (image.channels == 3) return image;
  PATINA_CHECK(image.channels >= 1 && image.channels <= 4);
  Image out(image.width, image.height, 3);
  const bool grey = image.channels < 3;
  for (size_t i = 0; i < image.num_pixels(); ++i)
    for (size_t c = 0; c < 3; ++c)
      out.pixels[3 * i + c] = image.pixels[i * static_cast<size_t>(image.channels) + (grey ? 0 : c)];
  return out;
}

}  // namespace patina::report
