#include "colour_path.h"

#include <ATen/ATen.h>

namespace patina::train_mini {
namespace {

constexpr int64_t kColours = 3;
// SiLU is nearly straight about here, with about this slope: the colours pass it as they are.
constexpr double kSiluOffset = 2, kSiluSlope = 1.09;
constexpr double kLogVariance = -4;  // of the posterior at first

bool contains(const std::string& text, const char* part) {
  return text.find(part) != std::string::npos;
}

/// Kernel [h,w] by which a layer passes a colour channel on.
at::Tensor passing_kernel(const std::string& name, int64_t side) {
  at::Tensor kernel = at::zeros({side, side});
  if (contains(name, "downsamplers")) {  // padded on the right and below: the mean of 2 × 2
    kernel.slice(0, 0, 2).slice(1, 0, 2).fill_(0.25);
  } else if (contains(name, "upsamplers")) {  // after repeating each pixel: about linear interpolation
    const at::Tensor line = at::tensor({0.25f, 0.5f, 0.25f});
    kernel = line.view({3, 1}) * line;
  } else {
    kernel[side / 2][side / 2] = contains(name, "conv_out") ? 1 / kSiluSlope : 1;
  }
  return kernel;
}

}  // namespace

void lay_colour_path(Parameters& parameters) {
  for (const std::string& name : parameters.names()) {
    at::Tensor value = parameters.start_of(name).clone();
    const bool weight = contains(name, ".weight");
    if (contains(name, "resnets") && contains(name, "conv2")) {  // residuals leave the colours alone
      value.slice(0, 0, kColours).zero_();
    } else if (contains(name, "conv_norm_out")) {
      if (!weight) value.slice(0, 0, kColours).fill_(kSiluOffset);
    } else if (value.dim() == 4 && !contains(name, ".conv1.")) {
      const at::Tensor kernel = passing_kernel(name, value.size(2));
      const int64_t passed = contains(name, "quant_conv") ? value.size(0) : kColours;
      value.slice(0, 0, passed).zero_();
      for (int64_t i = 0; i < passed; ++i) value[i][i] = kernel;
      if (name == "encoder.conv_out.weight") value.slice(0, value.size(0) / 2).zero_();
    } else if (name == "encoder.conv_out.bias") {
      value.slice(0, value.size(0) / 2).fill_(kLogVariance);
    }
    parameters.start_with(name, value);
  }
}

}  // namespace patina::train_mini
