#include "patina/nn/winograd.h"

#include <algorithm>
#include <bit>

#include "patina/attention/attention.h"
#include "patina/base/check.h"
#include "patina/base/parallel.h"
#include "patina/nn/winograd_kernel.h"

namespace patina::nn {
namespace {

using namespace winograd;

float float_of(Bf16 x) {
  return std::bit_cast<float>(static_cast<uint32_t>(x.bits) << 16);
}
// To the nearest, ties to even; weights are finite.
uint32_t bits_of(float value) {
  const auto bits = std::bit_cast<uint32_t>(value);
  return (bits + 0x7FFFu + ((bits >> 16) & 1u)) >> 16;
}

// One axis of G g Gᵀ: three numbers `step` apart -> four.
void transform3(const float* g, int step, float* out, int out_step) {
  const float ends = 0.5f * (g[0] + g[2 * step]), middle = 0.5f * g[step];
  out[0] = g[0];
  out[out_step] = ends + middle;
  out[2 * out_step] = ends - middle;
  out[3 * out_step] = g[2 * step];
}

int64_t panels_of(int64_t out) {
  return (out + kPanel - 1) / kPanel;
}

// The sums of a panel stay in the second cache, and tiles enough share what is read of the weights.
constexpr int64_t kMostTiles = 96;

}  // namespace

bool winograd_pays() {
#ifdef PATINA_WINOGRAD
  static const bool pays =
      attention::supported_isas(attention::Element::kBf16).back() == attention::CpuIsa::kAvx512Bf16;
  return pays;
#else
  return false;
#endif
}

Winograd::Winograd(const Bf16* weight, const Bf16* bias, int64_t in, int64_t out) : in_(in), out_(out) {
  PATINA_CHECK(takes(in, out));
  const int64_t pairs = in / 2, panels = panels_of(out);
  pairs_ = std::make_unique<uint32_t[]>(static_cast<size_t>(num_bytes()) / sizeof(uint32_t));
  bias_ = std::make_unique<float[]>(static_cast<size_t>(out));
  for (int64_t o = 0; o < out; ++o) bias_[static_cast<size_t>(o)] = float_of(bias[o]);

  parallel_for(0, panels, 1, [&](int64_t begin, int64_t end) {
    for (int64_t o = begin * kPanel; o < std::min(end * kPanel, out); ++o) {
      uint32_t* const panel = pairs_.get() + o / kPanel * kFrequencies * pairs * kPanel + o % kPanel;
      for (int64_t i = 0; i < in; ++i) {
        float g[9], half[12], u[16];
        for (int64_t k = 0; k < 9; ++k) g[k] = float_of(weight[(o * 9 + k) * in + i]);
        for (int column = 0; column < 3; ++column) transform3(g + column, 3, half + column, 3);
        for (int row = 0; row < 4; ++row) transform3(half + 3 * row, 1, u + 4 * row, 1);
        for (int64_t f = 0; f < kFrequencies; ++f)
          panel[(f * pairs + i / 2) * kPanel] |= bits_of(u[f]) << (16 * (i % 2));
      }
    }
  });
}

int64_t Winograd::num_bytes() const {
  return panels_of(out_) * kFrequencies * in_ / 2 * kPanel * static_cast<int64_t>(sizeof(uint32_t));
}

void Winograd::operator()(const Bf16* x, Bf16* y, int64_t batch, int64_t height, int64_t width) const {
#ifdef PATINA_WINOGRAD
  const int64_t pairs = in_ / 2, panels = panels_of(out_);
  const int64_t image_tiles = ((height + 1) / 2) * ((width + 1) / 2);
  // Blocks of tiles of like size for every thread; where there are too few, the panels are shared out too.
  const int64_t threads = num_threads();
  const int64_t rounds = (image_tiles + kMostTiles * threads - 1) / (kMostTiles * threads);
  const bool few = image_tiles < kMostTiles;
  const int64_t blocks = few ? 1 : rounds * threads, shares = few ? std::min(threads, panels) : 1;
  const int64_t block_tiles = (image_tiles + blocks - 1) / blocks;

  parallel_for(0, batch * blocks * shares, 1, [&](int64_t begin, int64_t end) {
    const auto v =
        std::make_unique_for_overwrite<Bf16[]>(static_cast<size_t>(kFrequencies * block_tiles * in_));
    const auto m =
        std::make_unique_for_overwrite<float[]>(static_cast<size_t>(kFrequencies * block_tiles * kPanel));
    for (int64_t task = begin; task < end; ++task) {
      const int64_t share = task % shares, block = task / shares % blocks, image = task / shares / blocks;
      const int64_t first = block * block_tiles;
      const Tiles tiles{first, std::min(block_tiles, image_tiles - first), height, width};
      if (tiles.count <= 0) continue;
      transform_input(x + image * height * width * in_, tiles, in_, v.get());
      for (int64_t panel = share * panels / shares; panel < (share + 1) * panels / shares; ++panel) {
        const int64_t channel = panel * kPanel, out = std::min<int64_t>(kPanel, out_ - channel);
        multiply(reinterpret_cast<const uint32_t*>(v.get()),
                 pairs_.get() + panel * kFrequencies * pairs * kPanel, tiles.count, pairs, out, m.get());
        transform_output(m.get(), tiles, bias_.get() + channel, out, channel, out_,
                         y + image * height * width * out_);
      }
    }
  });
#else
  (void)x, (void)y, (void)batch, (void)height, (void)width;
  PATINA_CHECK(winograd_pays());
#endif
}

}  // namespace patina::nn
