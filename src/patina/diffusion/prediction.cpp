#include "patina/diffusion/prediction.h"

#include <ATen/ATen.h>

#include "patina/base/random.h"

namespace patina::diffusion {

Prediction ask_prediction(const UNet& unet, const SchedulerConfig& scheduler) {
  constexpr int64_t kSide = 16, kTokens = 77;
  constexpr double kBetween = 0.5;  // half way between the two answers
  const int64_t channels = unet.config().in_channels;
  std::vector<float> noise(static_cast<size_t>(channels * kSide * kSide));
  for (size_t i = 0; i < noise.size(); i += 4) {
    const std::array<float, 4> four = gaussian4(0, RandomPurpose::kSchedulerNoise, i / 4);
    std::copy(four.begin(), four.end(), noise.begin() + static_cast<std::ptrdiff_t>(i));
  }
  const at::Tensor sample = at::tensor(noise, at::kFloat).view({1, channels, kSide, kSide});
  const double last_timestep = scheduler.num_train_timesteps - 1;
  const at::Tensor text =
      at::zeros({1, kTokens, unet.config().levels.front().cross_attention_dim}, at::kFloat);
  const at::Tensor output =
      unet({sample, at::full({1}, last_timestep, at::kFloat), {text, {}}}).to(at::kCPU, at::kFloat);
  const at::Tensor a = sample - sample.mean(), b = output - output.mean();
  const double spread = (a.norm() * b.norm()).item<double>();
  const double correlation = spread > 0 ? (a * b).sum().item<double>() / spread : 0.0;
  return correlation > kBetween ? Prediction::kEpsilon : Prediction::kV;
}

}  // namespace patina::diffusion
