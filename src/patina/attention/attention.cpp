#include "patina/attention/attention.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "patina/base/check.h"
#include "patina/base/error.h"

namespace patina::attention {
namespace {

[[noreturn]] void refuse(const char* what, const std::string& message) {
  throw Error(ErrorCode::kUsage, what, message);
}

void require(bool condition, const char* what, const std::string& message) {
  if (!condition) refuse(what, message);
}

/// Whether two different (batch, token, head) of an output would lie on one element, for the nested layouts
/// that strides can make.
bool outputs_overlap(const Shape& shape, const Strides& strides) {
  struct Axis {
    int64_t stride, count;
  };
  Axis axes[] = {
      {strides.batch, shape.batch}, {strides.token, shape.num_queries}, {strides.head, shape.num_heads}};
  std::sort(std::begin(axes), std::end(axes),
            [](const Axis& a, const Axis& b) { return a.stride < b.stride; });
  int64_t extent = shape.head_dim;  // elements that the axes so far span
  for (const Axis& axis : axes) {
    if (axis.count == 1) continue;
    if (axis.stride < extent) return true;
    extent += (axis.count - 1) * axis.stride;
  }
  return false;
}

}  // namespace

std::vector<int32_t> biased_keys(const KeyBuckets& buckets, int64_t query) {
  PATINA_CHECK_LE(int64_t{0}, query);
  PATINA_CHECK_LT(query, buckets.num_pixels());
  const int x = static_cast<int>(query % buckets.width()), y = static_cast<int>(query / buckets.width());
  const int view_x0 = x / buckets.view_width * buckets.view_width;
  const int view_y0 = y / buckets.view_height * buckets.view_height;
  std::vector<int32_t> keys;
  for (int cell_y = std::max(y - buckets.window_radius, view_y0);
       cell_y <= std::min(y + buckets.window_radius, view_y0 + buckets.view_height - 1); ++cell_y)
    for (int cell_x = std::max(x - buckets.window_radius, view_x0);
         cell_x <= std::min(x + buckets.window_radius, view_x0 + buckets.view_width - 1); ++cell_x) {
      const size_t cell =
          static_cast<size_t>(cell_y) * static_cast<size_t>(buckets.width()) + static_cast<size_t>(cell_x);
      keys.insert(keys.end(), buckets.keys.begin() + buckets.offsets[cell],
                  buckets.keys.begin() + buckets.offsets[cell + 1]);
    }
  std::sort(keys.begin(), keys.end());
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
  return keys;
}

void validate(const KeyBuckets& buckets) {
  constexpr int64_t kMost = std::numeric_limits<int32_t>::max();
  require(buckets.grid >= 1 && buckets.view_width >= 1 && buckets.view_height >= 1, "key buckets",
          "grid " + std::to_string(buckets.grid) + " of views " + std::to_string(buckets.view_width) + " x " +
              std::to_string(buckets.view_height) + ", expected at least 1 each");
  require(buckets.window_radius >= 0 && buckets.window_radius <= (1 << 20), "key buckets",
          "window_radius is " + std::to_string(buckets.window_radius) + ", expected 0 or more");
  const int64_t grid = buckets.grid, width = grid * buckets.view_width, height = grid * buckets.view_height;
  require(width <= kMost && height <= kMost && width <= kMost / height, "key buckets",
          "more than 2^31 - 1 pixels");
  const size_t num_pixels = static_cast<size_t>(width * height);
  require(buckets.offsets.size() == num_pixels + 1, "key buckets",
          std::to_string(buckets.offsets.size()) + " offsets, expected one more than the " +
              std::to_string(num_pixels) + " pixels");
  require(buckets.offsets.front() == 0 && static_cast<size_t>(buckets.offsets.back()) == buckets.keys.size(),
          "key buckets",
          "offsets go from " + std::to_string(buckets.offsets.front()) + " to " +
              std::to_string(buckets.offsets.back()) + ", expected 0 to the number of keys, " +
              std::to_string(buckets.keys.size()));
  for (size_t cell = 0; cell < num_pixels; ++cell)
    if (buckets.offsets[cell] > buckets.offsets[cell + 1])
      refuse("key buckets", "offsets fall after cell " + std::to_string(cell));
  for (size_t cell = 0; cell < num_pixels; ++cell)
    for (int32_t at = buckets.offsets[cell]; at < buckets.offsets[cell + 1]; ++at) {
      const int32_t key = buckets.keys[static_cast<size_t>(at)];
      if (key < 0 || static_cast<size_t>(key) >= num_pixels)
        refuse("key buckets", "cell " + std::to_string(cell) + " holds key " + std::to_string(key) +
                                  ", expected 0 to " + std::to_string(num_pixels - 1));
      if (at > buckets.offsets[cell] && key <= buckets.keys[static_cast<size_t>(at) - 1])
        refuse("key buckets", "keys of cell " + std::to_string(cell) + " do not ascend");
    }
}

void validate(const Arguments& arguments) {
  const Shape& shape = arguments.shape;
  require(arguments.q && arguments.k && arguments.v && arguments.out, "attention", "q, k, v or out is null");
  require(shape.batch >= 1 && shape.num_queries >= 1 && shape.num_keys >= 1 && shape.num_heads >= 1 &&
              shape.head_dim >= 1,
          "attention",
          "sizes [batch " + std::to_string(shape.batch) + ", queries " + std::to_string(shape.num_queries) +
              ", keys " + std::to_string(shape.num_keys) + ", heads " + std::to_string(shape.num_heads) +
              ", head_dim " + std::to_string(shape.head_dim) + "], expected at least 1 each");
  require(shape.num_keys <= std::numeric_limits<int32_t>::max(), "attention", "more than 2^31 - 1 keys");
  require(shape.head_dim <= 4096, "attention",
          "head_dim is " + std::to_string(shape.head_dim) + ", expected at most 4096");
  require(arguments.scale >= 1e-20f && arguments.scale <= 1e20f, "attention",
          "scale is " + std::to_string(arguments.scale) +
              ", expected a positive number such as 1/sqrt(head_dim)");
  require(!outputs_overlap(shape, arguments.out_strides), "attention",
          "out_strides make outputs share elements");
  if (!arguments.buckets) return;
  require(std::abs(arguments.beta) <= kMaxBeta, "attention",
          "beta is " + std::to_string(arguments.beta) + ", expected a number from -1e4 to 1e4");
  validate(*arguments.buckets);
  const int64_t num_pixels = arguments.buckets->num_pixels();
  require(shape.num_queries == num_pixels && shape.num_keys == num_pixels, "attention",
          "buckets of " + std::to_string(num_pixels) + " pixels for " + std::to_string(shape.num_queries) +
              " queries and " + std::to_string(shape.num_keys) + " keys, expected equal numbers");
}

}  // namespace patina::attention
