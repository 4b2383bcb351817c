#include "patina/nn/winograd.h"

#include <algorithm>
#include <bit>

#include "patina/attention/attention.h"
#include "patina/base/bf16.h"
#include "patina/base/check.h"
#include "patina/base/parallel.h"
#include "patina/nn/winograd_kernel.h"

namespace patina::nn {
namespace {

using namespace winograd;

// As bf16_of_float of what is finite: without its branch, so that compilers make vectors of it.
uint32_t bits_of(float value) {
  const auto bits = std::bit_cast<uint32_t>(value);
  return (bits + 0x7FFFu + ((bits >> 16) & 1u)) >> 16;
}

using Lanes = float[kPanel];  // one number of each output channel of a panel

// One axis of G g Gᵀ: three numbers `step` apart -> four.
void transform3(const Lanes* g, int step, Lanes* u, int u_step) {
  for (int o = 0; o < kPanel; ++o) {
    const float ends = 0.5f * (g[0][o] + g[2 * step][o]), middle = 0.5f * g[step][o];
    u[0][o] = g[0][o];
    u[u_step][o] = ends + middle;
    u[2 * u_step][o] = ends - middle;
    u[3 * u_step][o] = g[2 * step][o];
  }
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
  pairs_ = std::make_unique_for_overwrite<uint32_t[]>(static_cast<size_t>(num_bytes()) / sizeof(uint32_t));
  bias_ = std::make_unique<float[]>(static_cast<size_t>(out));
  for (int64_t o = 0; o < out; ++o) bias_[static_cast<size_t>(o)] = float_of_bf16(bias[o].bits);

  // Two input channels of a panel's output channels at a time: what is written lies together.
  parallel_for(0, panels * pairs, 16, [&](int64_t begin, int64_t end) {
    for (int64_t task = begin; task < end; ++task) {
      const int64_t panel = task / pairs, pair = task % pairs, first = panel * kPanel;
      Lanes g[9] = {}, half[12], u[2][kFrequencies];
      for (int64_t i = 0; i < 2; ++i) {
        for (int64_t o = 0; o < std::min<int64_t>(kPanel, out - first); ++o)
          for (int64_t k = 0; k < 9; ++k)
            g[k][o] = float_of_bf16(weight[((first + o) * in + 2 * pair + i) * 9 + k].bits);
        for (int column = 0; column < 3; ++column) transform3(g + column, 3, half + column, 3);
        for (int row = 0; row < 4; ++row) transform3(half + 3 * row, 1, u[i] + 4 * row, 1);
      }
      for (int64_t f = 0; f < kFrequencies; ++f) {
        uint32_t* const to = pairs_.get() + ((panel * kFrequencies + f) * pairs + pair) * kPanel;
        for (int o = 0; o < kPanel; ++o) to[o] = bits_of(u[0][f][o]) | bits_of(u[1][f][o]) << 16;
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
  // Every thread gets as many blocks of tiles of like size; where blocks are too few, panels are shared out
  // too.
  const int64_t threads = num_threads(), fewest = (image_tiles + kMostTiles - 1) / kMostTiles;
  const bool few = fewest < threads;
  const int64_t blocks = few ? fewest : (fewest + threads - 1) / threads * threads;
  const int64_t shares = few ? std::min(panels, (threads + fewest - 1) / fewest) : 1;
  const int64_t block_tiles = (image_tiles + blocks - 1) / blocks;

  parallel_for(0, batch * blocks * shares, 1, [&](int64_t begin, int64_t end) {
    const auto v =
        std::make_unique_for_overwrite<uint32_t[]>(static_cast<size_t>(kFrequencies * block_tiles * pairs));
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
        multiply(v.get(), pairs_.get() + panel * kFrequencies * pairs * kPanel, tiles.count, pairs, out,
                 m.get());
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
