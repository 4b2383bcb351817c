#include "augment.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <ATen/ATen.h>

#include "mini_data/fields.h"

namespace patina::train_material {
namespace {

using at::Tensor;
using mini_data::linear_from_srgb;
using mini_data::srgb_from_linear;

constexpr int64_t kBlock = 8;  // of JPEG

// Planes of colours, whose channels may be exchanged, and of normals, whose x turns in the mirror.
constexpr std::array<int64_t, 4> kColours{kEdited, kRender, kCleanBase, kTrueBase};
constexpr std::array<int64_t, 2> kNormals{kCleanNormal, kTrueNormal};

// The matrix of the 8-point cosine transform, orthonormal.
Tensor cosine_transform() {
  Tensor out = at::empty({kBlock, kBlock});
  for (int64_t k = 0; k < kBlock; ++k)
    for (int64_t i = 0; i < kBlock; ++i)
      out[k][i] = std::sqrt((k == 0 ? 1.0 : 2.0) / kBlock) *
                  std::cos(M_PI * (static_cast<double>(i) + 0.5) * static_cast<double>(k) / kBlock);
  return out;
}

Tensor drawn(const Tensor& like, double low, double high) {
  return low + (high - low) * at::rand({like.size(0), 1, 1, 1}, like.options());
}
// 1 for about this share of the samples.
Tensor share(const Tensor& like, double probability) {
  return (at::rand({like.size(0), 1, 1, 1}, like.options()) < probability).to(at::kFloat);
}

// Noise of each pixel, and of patches of eight pixels.
Tensor noisy(const Tensor& picture, const Tensor& fine, const Tensor& coarse) {
  const int64_t h = picture.size(2), w = picture.size(3);
  const Tensor patches = at::upsample_bilinear2d(
      at::randn({picture.size(0), 3, h / kBlock, w / kBlock}, picture.options()), {h, w}, false);
  return picture + fine * at::randn_like(picture) + coarse * patches;
}

Tensor drifted(const Tensor& picture, const Tensor& amount) {
  const Tensor gain = (amount * 0.1 * at::randn({picture.size(0), 3, 1, 1}, picture.options())).exp();
  const Tensor contrast = (amount * 0.12 * at::randn({picture.size(0), 1, 1, 1}, picture.options())).exp();
  const Tensor offset = amount * 0.02 * at::randn({picture.size(0), 3, 1, 1}, picture.options());
  return picture.clamp_min(1e-4).pow(contrast) * gain + offset;
}

// By at most a pixel each way; borders repeat.
Tensor shifted(const Tensor& picture, const Tensor& amount) {
  const Tensor step = (at::rand({picture.size(0), 2}, picture.options()) * 3).floor() - 1;
  const Tensor scaled =
      step * amount.view({-1, 1}) *
      at::tensor({2.0 / static_cast<double>(picture.size(3)), 2.0 / static_cast<double>(picture.size(2))})
          .to(at::kFloat);
  Tensor theta = at::zeros({picture.size(0), 2, 3}, picture.options());
  theta.select(1, 0).select(1, 0).fill_(1), theta.select(1, 1).select(1, 1).fill_(1);
  theta.select(2, 2).copy_(scaled);
  return at::grid_sampler(picture, at::affine_grid_generator(theta, picture.sizes(), false), 0, 1, false);
}

}  // namespace

Tensor random_cuts(const Records& records, int64_t count, int64_t side, std::mt19937_64& random) {
  const auto below = [&](int64_t end) { return static_cast<int64_t>(random() % static_cast<uint64_t>(end)); };
  std::vector<Tensor> cuts;
  for (int64_t i = 0; i < count; ++i) {
    Tensor cut = records.record(below(records.size()));
    const int64_t whole = cut.size(2), free = whole - side + 1;
    if (below(2)) {
      cut = at::avg_pool2d(cut.unsqueeze(0), whole / side)[0];
    } else {
      // Cuts of the backdrop alone teach nothing: of three, the one that the object fills most.
      int64_t best_y = 0, best_x = 0;
      double most = -1;
      for (int attempt = 0; attempt < 3; ++attempt) {
        const int64_t y = below(free), x = below(free);
        const double filled =
            cut[kCoverage].slice(0, y, y + side).slice(1, x, x + side).mean().item<double>();
        if (filled > most) most = filled, best_y = y, best_x = x;
      }
      cut = cut.slice(1, best_y, best_y + side).slice(2, best_x, best_x + side);
    }
    std::vector<int64_t> order;
    for (int64_t c = 0; c < kNumPlanes; ++c) order.push_back(c);
    if (below(3) == 0) {
      std::array<int64_t, 3> channels{0, 1, 2};
      std::shuffle(channels.begin(), channels.end(), random);
      for (const int64_t first : kColours)
        for (int64_t c = 0; c < 3; ++c)
          order[static_cast<size_t>(first + c)] = first + channels[static_cast<size_t>(c)];
    }
    cut = cut.index_select(0, at::tensor(order, at::kLong));
    if (below(2)) {
      cut = cut.flip({2});
      for (const int64_t x : kNormals) cut[x].mul_(-1).add_(1);
    }
    cuts.push_back(cut);
  }
  return at::stack(cuts);
}

Tensor blurred(const Tensor& picture, const Tensor& sigma) {
  constexpr int64_t kRadius = 3, kStride = 1, kPadding = 0, kDilation = 1;
  const int64_t b = picture.size(0);
  const Tensor at_offset = at::arange(-kRadius, kRadius + 1, picture.options()).view({1, -1});
  const Tensor s = sigma.view({b, 1}).clamp_min(0.05);
  Tensor kernel = (-0.5 * (at_offset / s).square()).exp();
  kernel = (kernel / kernel.sum({1}, true)).repeat_interleave(3, 0);
  const Tensor flat = picture.reshape({1, 3 * b, picture.size(2), picture.size(3)});
  const Tensor rows =
      at::conv2d(at::replication_pad2d(flat, {kRadius, kRadius, 0, 0}),
                 kernel.view({3 * b, 1, 1, 2 * kRadius + 1}), {}, kStride, kPadding, kDilation, 3 * b);
  return at::conv2d(at::replication_pad2d(rows, {0, 0, kRadius, kRadius}),
                    kernel.view({3 * b, 1, 2 * kRadius + 1, 1}), {}, kStride, kPadding, kDilation, 3 * b)
      .view_as(picture);
}

// Blocks of luma and two colour differences, their cosine coefficients rounded to steps that grow with
// frequency as those of JPEG's tables do (about 16 to 100 of 255 for luma, 17 to 99 for colour).
Tensor compressed(const Tensor& picture, const Tensor& strength) {
  static const Tensor transform = cosine_transform();
  const int64_t b = picture.size(0), rows = picture.size(2) / kBlock, columns = picture.size(3) / kBlock;
  const Tensor r = picture.slice(1, 0, 1), g = picture.slice(1, 1, 2), blue = picture.slice(1, 2, 3);
  const Tensor luma = 0.299 * r + 0.587 * g + 0.114 * blue;
  const Tensor coded = at::cat({luma, 0.564 * (blue - luma), 0.713 * (r - luma)}, 1);
  const Tensor blocks = coded.reshape({b, 3, rows, kBlock, columns, kBlock}).permute({0, 1, 2, 4, 3, 5});
  const Tensor coefficients = at::matmul(at::matmul(transform, blocks), transform.t());
  const Tensor frequency = at::arange(kBlock, picture.options());
  const Tensor sum = frequency.view({-1, 1}) + frequency.view({1, -1});
  const Tensor table = at::stack({12 + 6 * sum, 17 + 12 * sum, 17 + 12 * sum}).clamp_max(100) / 255;
  const Tensor step =
      (strength.view({b, 1, 1, 1, 1, 1}) * table.view({1, 3, 1, 1, kBlock, kBlock})).clamp_min(1e-4);
  const Tensor rounded = (coefficients / step).round() * step;
  const Tensor back = at::matmul(at::matmul(transform.t(), rounded), transform)
                          .permute({0, 1, 2, 4, 3, 5})
                          .reshape(coded.sizes());
  const Tensor y = back.slice(1, 0, 1), cb = back.slice(1, 1, 2) / 0.564, cr = back.slice(1, 2, 3) / 0.713;
  const Tensor red = y + cr, b2 = y + cb;
  return at::cat({red, (y - 0.299 * red - 0.114 * b2) / 0.587, b2}, 1);
}

Tensor reexposed(const Tensor& picture, const Tensor& coverage, const Tensor& ev) {
  const Tensor mapped = linear_from_srgb(picture.clamp(0, 1)).clamp_max(0.99);
  const Tensor light = mapped / (1 - mapped) * at::pow(2.0, ev);
  return coverage * srgb_from_linear(light / (1 + light)) + (1 - coverage) * picture;
}

Tensor disturbed(const Tensor& planes) {
  const Tensor coverage = planes.slice(1, kCoverage, kCoverage + 1);
  const Tensor ev = drawn(planes, -0.7, 0.7) * share(planes, 0.7);
  Tensor out = planes.clone();
  const auto picture = [&](int64_t first) { return out.slice(1, first, first + 3); };
  picture(kRender).copy_(reexposed(picture(kRender), coverage, ev));
  Tensor edited = reexposed(picture(kEdited), coverage, ev);
  const Tensor any = share(planes, 5.0 / 6);
  edited = drifted(edited, any * share(planes, 0.6) * drawn(planes, 0, 1.5));
  edited = shifted(edited, any * share(planes, 0.3));
  edited = blurred(edited, any * share(planes, 0.5) * drawn(planes, 0.2, 1.3));
  edited = noisy(edited, any * share(planes, 0.5) * drawn(planes, 0, 0.03),
                 any * share(planes, 0.5) * drawn(planes, 0, 0.03));
  const Tensor packed = any * share(planes, 0.4);
  edited = at::where(packed > 0, compressed(edited.clamp(0, 1), packed * drawn(planes, 0.1, 1.0)), edited);
  picture(kEdited).copy_(edited.clamp(0, 1));
  return out;
}

}  // namespace patina::train_material
