// Parts of a picture with words of their own: which pixels they are at each resolution, and that each pixel
// attends to the words of what it shows.
#include "patina/diffusion/networks/part_pixels.h"

#include <gtest/gtest.h>

#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>

#include "patina/base/error.h"
#include "patina/diffusion/networks/blocks.h"

namespace patina::diffusion {
namespace {

// Shares [3,5,6] that add up to one: the first part has most of the left, the second the right; some pixels
// show two parts, none of the left one shows the third.
at::Tensor made_shares() {
  const at::Tensor third = at::zeros({5, 6});
  third.slice(1, 4).fill_(0.25);
  const at::Tensor first = at::zeros({5, 6});
  first.slice(1, 0, 3).fill_(1);
  first.select(1, 3).fill_(0.4);
  return at::stack({first, 1 - first - third, third});
}

TEST(PartPixels, every_resolution_has_the_mean_shares_of_its_pixels) {
  const PartLevels levels(made_shares(), 2);
  const std::vector<PartPixels>& finest = levels.at(5, 6);
  ASSERT_EQ(finest.size(), 3u);
  for (size_t part = 0; part < 3; ++part) {
    const at::Tensor dense = at::zeros({30}), expected = made_shares()[static_cast<int64_t>(part)].flatten();
    dense.index_put_({finest[part].index}, finest[part].share.squeeze(1));
    EXPECT_TRUE(at::equal(dense, expected));
    EXPECT_TRUE((finest[part].share > 0).all().item<bool>());
  }
  at::Tensor sum = at::zeros({9});
  for (const PartPixels& part : levels.at(3, 3)) sum.index_add_(0, part.index, part.share.squeeze(1));
  EXPECT_LT((sum - 1).abs().max().item<float>(), 1e-6f);
  EXPECT_THROW(levels.at(4, 4), Error);
}

Attention made_attention(int64_t channels, int64_t text_width, int64_t num_heads) {
  const auto linear = [](int64_t in, int64_t out) { return nn::Linear{"", at::randn({out, in}) * 0.2, {}}; };
  return {"",
          linear(channels, channels),
          linear(text_width, channels),
          linear(text_width, channels),
          linear(channels, channels),
          num_heads};
}

TEST(PartPixels, a_pixel_attends_to_the_words_of_the_parts_that_it_shows) {
  const c10::InferenceMode inference;
  at::manual_seed(7);
  const Attention attention = made_attention(16, 12, 2);
  const at::Tensor x = at::randn({2, 30, 16});
  // Texts may differ in length.
  const std::vector<at::Tensor> texts{at::randn({2, 7, 12}), at::randn({2, 14, 12}), at::randn({2, 7, 12})};
  const PartLevels levels(made_shares(), 1);
  const at::Tensor out = attention.in_parts(x, texts, levels.at(5, 6), {});

  // Without a bias in the last layer, the mean of what each text gives all pixels.
  at::Tensor expected = at::zeros_like(x);
  for (size_t part = 0; part < texts.size(); ++part)
    expected +=
        attention(x, texts[part], {}) * made_shares()[static_cast<int64_t>(part)].flatten().view({1, 30, 1});
  EXPECT_LT((out - expected).abs().max().item<float>(), 1e-5f);

  // A part's words do not reach pixels that do not show it.
  std::vector<at::Tensor> changed = texts;
  changed[2] = at::randn({2, 7, 12});
  const at::Tensor other = attention.in_parts(x, changed, levels.at(5, 6), {});
  const at::Tensor moved = (out - other).abs().amax({0, 2}).view({5, 6});
  EXPECT_EQ(moved.slice(1, 0, 4).max().item<float>(), 0.0f);
  EXPECT_GT(moved.slice(1, 4).min().item<float>(), 0.0f);
}

}  // namespace
}  // namespace patina::diffusion
