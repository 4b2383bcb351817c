#include "convolutions.h"

#include <cmath>

#include <ATen/ATen.h>

#include "best_seconds.h"
#include "patina/nn/winograd.h"

namespace patina::bench {
namespace {

using nn::Bf16;

struct Size {
  int64_t in, out, side;
};
// U-Net at 512², finest to coarsest, then the VAE's decoder.
constexpr Size kSizes[] = {{320, 320, 64},   {960, 320, 64},   {640, 640, 32},  {1920, 640, 32},
                           {1280, 1280, 16}, {2560, 1280, 16}, {1280, 1280, 8}, {2560, 1280, 8},
                           {512, 512, 64},   {512, 512, 128},  {256, 256, 256}, {128, 128, 512}};

double relative_error(const at::Tensor& y, const at::Tensor& truth) {
  return ((y.to(at::kFloat) - truth).square().mean().sqrt() / truth.std()).item<double>();
}

}  // namespace

nlohmann::json measure_convolutions(int repeat) {
  nlohmann::json rows = nlohmann::json::array();
  if (!nn::winograd_pays()) return rows;
  for (const Size& size : kSizes) {
    const auto last = at::MemoryFormat::ChannelsLast;
    const auto numbers = [&](at::IntArrayRef shape, double scale) {
      return (scale * at::randn(shape)).to(at::kBFloat16);
    };
    const at::Tensor x = numbers({1, size.in, size.side, size.side}, 1).contiguous(last);
    const double spread = 1 / std::sqrt(9.0 * static_cast<double>(size.in));
    const at::Tensor weight = numbers({size.out, size.in, 3, 3}, spread).contiguous(last),
                     bias = numbers({size.out}, 1);
    at::Tensor plain;
    const double plain_seconds =
        best_seconds(repeat, [&] { plain = at::conv2d(x, weight, bias, /*stride=*/1, /*padding=*/1); });

    const at::Tensor stored = weight.contiguous();
    const nn::Winograd layer(static_cast<const Bf16*>(stored.data_ptr()),
                             static_cast<const Bf16*>(bias.data_ptr()), size.in, size.out);
    const at::Tensor y = at::empty_like(plain);
    const double winograd_seconds = best_seconds(repeat, [&] {
      layer(static_cast<const Bf16*>(x.data_ptr()), static_cast<Bf16*>(y.data_ptr()), 1, size.side,
            size.side);
    });

    const at::Tensor truth = at::conv2d(x.to(at::kFloat), weight.to(at::kFloat), bias.to(at::kFloat), 1, 1);
    const double gflop =
        18e-9 * static_cast<double>(size.in) * static_cast<double>(size.out * size.side * size.side);
    rows.push_back({{"in", size.in},
                    {"out", size.out},
                    {"side", size.side},
                    {"gflop", gflop},
                    {"plain_seconds", plain_seconds},
                    {"winograd_seconds", winograd_seconds},
                    {"plain_over_winograd", plain_seconds / winograd_seconds},
                    {"plain_error", relative_error(plain, truth)},
                    {"winograd_error", relative_error(y, truth)}});
  }
  return rows;
}

}  // namespace patina::bench
