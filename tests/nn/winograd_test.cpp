// Winograd's convolution against the plain one in float64 on the same bf16 numbers.
#include "patina/nn/winograd.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <ATen/ATen.h>
#include <ATen/CPUGeneratorImpl.h>
#include <c10/core/InferenceMode.h>

#include <gtest/gtest.h>

#include "patina/attention/attention.h"
#include "patina/base/parallel.h"
#include "patina/nn/layers.h"

namespace patina::nn {
namespace {

// It runs on more processors than it pays on.
bool runs_here() {
  const auto isas = attention::supported_isas(attention::Element::kBf16);
  return std::find(isas.begin(), isas.end(), attention::CpuIsa::kAvx512Bf16) != isas.end();
}

struct Problem {
  int64_t batch, in, out, height, width;
  at::Tensor x, weight, bias;  // bf16, channels-last

  Problem(int64_t b, int64_t i, int64_t o, int64_t h, int64_t w)
      : batch(b), in(i), out(o), height(h), width(w) {
    at::Generator generator = at::detail::createCPUGenerator(7);
    const auto numbers = [&](at::IntArrayRef shape, double scale) {
      return (scale * at::randn(shape, generator, at::kFloat)).to(at::kBFloat16);
    };
    const auto last = at::MemoryFormat::ChannelsLast;
    x = numbers({b, i, h, w}, 1).contiguous(last);
    weight = numbers({o, i, 3, 3}, 1 / std::sqrt(9.0 * static_cast<double>(i)));
    bias = numbers({o}, 1);
  }
  at::Tensor plain() const {
    return at::conv2d(x.to(at::kDouble), weight.to(at::kDouble), bias.to(at::kDouble), 1, 1);
  }
  at::Tensor ours() const {
    const Winograd layer(static_cast<const Bf16*>(weight.data_ptr()),
                         static_cast<const Bf16*>(bias.data_ptr()), in, out);
    const at::Tensor y =
        at::empty({batch, out, height, width}, x.options().memory_format(at::MemoryFormat::ChannelsLast));
    y.fill_(NAN);
    layer(static_cast<const Bf16*>(x.data_ptr()), static_cast<Bf16*>(y.data_ptr()), batch, height, width);
    return y;
  }
};

class WinogradSizes : public testing::TestWithParam<Problem> {};

// Rounding the result alone costs 2⁻⁹ of it at most, 0.0023 in the mean of squares of numbers of size one.
TEST_P(WinogradSizes, costs_three_times_the_rounding_of_the_result) {
  if (!runs_here()) GTEST_SKIP() << "this processor has no AVX-512 BF16";
  const at::Tensor error = GetParam().ours().to(at::kDouble) - GetParam().plain();
  EXPECT_LT(error.square().mean().sqrt().item<double>(), 0.007);
  EXPECT_LT(error.abs().max().item<double>(), 0.05);
}

INSTANTIATE_TEST_SUITE_P(, WinogradSizes,
                         testing::Values(Problem(1, 32, 16, 1, 1),     // one pixel of a tile
                                         Problem(1, 32, 48, 5, 8),     // odd height, three registers
                                         Problem(2, 64, 96, 13, 7),    // odd both, a panel and a half
                                         Problem(1, 96, 80, 30, 31),   // several blocks
                                         Problem(3, 320, 320, 8, 8),   // panels shared out
                                         Problem(1, 1280, 64, 4, 4)),  // many channels
                         [](const auto& the) {
                           const Problem& p = the.param;
                           return std::to_string(p.batch) + "x" + std::to_string(p.in) + "to" +
                                  std::to_string(p.out) + "on" + std::to_string(p.height) + "x" +
                                  std::to_string(p.width);
                         });

TEST(Winograd, gives_the_same_bits_with_any_number_of_threads) {
  if (!runs_here()) GTEST_SKIP() << "this processor has no AVX-512 BF16";
  for (const Problem& problem : {Problem(2, 64, 192, 40, 40), Problem(1, 64, 192, 6, 6)}) {
    set_num_threads(1);
    const at::Tensor one = problem.ours();
    set_num_threads(3);
    const at::Tensor three = problem.ours();
    set_num_threads(0);
    EXPECT_TRUE(at::equal(one, three));
  }
}

TEST(Winograd, leaves_pictures_of_infinities_finite_elsewhere) {
  if (!runs_here()) GTEST_SKIP() << "this processor has no AVX-512 BF16";
  Problem problem(1, 32, 16, 8, 8);
  problem.x[0][3][7][7] = std::numeric_limits<float>::infinity();
  const at::Tensor y = problem.ours();
  EXPECT_TRUE(at::isfinite(y.slice(2, 0, 5).slice(3, 0, 5)).all().item<bool>());
  EXPECT_FALSE(at::isfinite(y[0][0][7][7]).item<bool>());
}

/// A 3×3 layer's weights, all of them 1/16.
class Sixteenths final : public WeightSource {
 public:
  std::string where() const override { return "sixteenths"; }
  bool has(const std::string&) const override { return true; }
  at::Tensor find(const std::string&, at::IntArrayRef expected, at::ScalarType type) override {
    return at::full(expected, 1.0 / 16, type);
  }
  std::vector<std::string> names() const override { return {}; }
};

TEST(Conv2d, takes_winograd_where_it_pays_and_memory_is_not_low) {
  const c10::InferenceMode inference;
  const auto loaded = [](at::ScalarType type, bool low_memory, int64_t stride) {
    Sixteenths source;
    WeightReader weights(source, Placement(type, c10::kCPU, low_memory));
    const Conv2d layer = load_conv2d(weights, "conv", 32, 16, 3, stride);
    EXPECT_EQ(weights.count().parameters, 32 * 16 * 9 + 16);
    const int64_t plain = weights.count().parameters * static_cast<int64_t>(c10::elementSize(type));
    // One panel of 64 channels and 16 frequencies for 16 channels and 9 weights.
    EXPECT_EQ(weights.count().bytes, layer.winograd ? plain + 32 * 2 * (64 * 16 - 16 * 9) : plain);
    return layer;
  };
  EXPECT_EQ(loaded(at::kBFloat16, false, 1).winograd != nullptr, winograd_pays());
  EXPECT_EQ(loaded(at::kBFloat16, true, 1).winograd, nullptr);
  EXPECT_EQ(loaded(at::kBFloat16, false, 2).winograd, nullptr);
  EXPECT_EQ(loaded(at::kFloat, false, 1).winograd, nullptr);

  const at::Tensor x = at::ones({1, 32, 6, 6}, at::kBFloat16);  // sums of 4, 6 or 9 · 32 / 16, and 1/16
  EXPECT_TRUE(at::allclose(loaded(at::kBFloat16, false, 1)(x, {}), loaded(at::kBFloat16, true, 1)(x, {})));
}

}  // namespace
}  // namespace patina::nn
