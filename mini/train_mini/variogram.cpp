#include "variogram.h"

#include <vector>

#include <ATen/ATen.h>

namespace patina::train_mini {

at::Tensor variogram(const at::Tensor& pictures, int64_t window) {
  const std::vector<at::Tensor> rgb = pictures.chunk(3, 1);
  const at::Tensor yellow = 0.5 * (rgb[0] + rgb[1]);
  const at::Tensor x = at::cat({pictures.mean(1, /*keepdim=*/true), rgb[0] - rgb[1], rgb[2] - yellow}, 1);
  constexpr int64_t kFarthest = 4;
  const int64_t height = x.size(2) - kFarthest, width = x.size(3) - 2 * kFarthest;
  // What lies so far from every pixel that has all its neighbours.
  const auto moved = [&](int64_t down, int64_t right) {
    return x.slice(2, down, down + height).slice(3, kFarthest + right, kFarthest + right + width);
  };
  const at::Tensor here = moved(0, 0);
  std::vector<at::Tensor> squares;
  for (int64_t distance = 1; distance <= kFarthest; distance *= 2) {
    const at::Tensor right = moved(0, distance), down = moved(distance, 0),
                     across = moved(distance, distance);
    for (const at::Tensor& difference : {right - here, down - here, across - here,
                                         moved(distance, -distance) - here, across - right - down + here})
      squares.push_back(difference.square());
  }
  return at::avg_pool2d(at::cat(squares, 1), window, window / 2);
}

at::Tensor variogram_error(const at::Tensor& drawn, const at::Tensor& wanted, int64_t window) {
  constexpr double kFlat = 4.0 / (255 * 255), kQuadraticBelow = 0.7;
  return at::smooth_l1_loss(at::log(variogram(drawn, window) + kFlat),
                            at::log(variogram(wanted, window) + kFlat), at::Reduction::Mean, kQuadraticBelow);
}

}  // namespace patina::train_mini
