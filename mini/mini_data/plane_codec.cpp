#include "mini_data/plane_codec.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "patina/base/check.h"
#include "patina/base/error.h"

namespace patina::mini_data {
namespace {

constexpr uint32_t kMagic = 0x31534C50;  // "PLS1"
constexpr int kMaxSide = 4096, kMaxPlanes = 64;
constexpr int kMaxLevel = 1 << 27;  // of a quantised coefficient
constexpr int kBlock = 8, kBlockSize = 64;
using Block = std::array<float, kBlockSize>;

// --- Range coder: binary symbols with adaptive probabilities, carries propagated on output [Martin1979]. ---

constexpr int kProbabilityBits = 12, kAdaptation = 5;
struct Bit {
  uint16_t of_zero = 1 << (kProbabilityBits - 1);
  void learn(bool one) {
    const int whole = 1 << kProbabilityBits;
    of_zero = static_cast<uint16_t>(one ? of_zero - (of_zero >> kAdaptation)
                                        : of_zero + ((whole - of_zero) >> kAdaptation));
  }
};

class Writer {
 public:
  explicit Writer(std::vector<uint8_t>& out) : out_(out) {}

  void code(Bit& bit, bool& one) {
    const uint32_t bound = (range_ >> kProbabilityBits) * bit.of_zero;
    if (one) {
      low_ += bound;
      range_ -= bound;
    } else {
      range_ = bound;
    }
    bit.learn(one);
    settle();
  }
  void code_even(bool& one) {
    range_ >>= 1;
    if (one) low_ += range_;
    settle();
  }
  void finish() {
    for (int i = 0; i < 5; ++i) shift();
  }

 private:
  void settle() {
    while (range_ < (1u << 24)) {
      range_ <<= 8;
      shift();
    }
  }
  // The top byte leaves once no carry can reach it: while it is 0xFF it waits.
  void shift() {
    if (low_ < 0xFF000000u || low_ > 0xFFFFFFFFu) {
      const auto carry = static_cast<uint8_t>(low_ >> 32);
      if (has_pending_) out_.push_back(static_cast<uint8_t>(pending_ + carry));
      for (; waiting_ > 0; --waiting_) out_.push_back(static_cast<uint8_t>(0xFF + carry));
      pending_ = static_cast<uint8_t>(low_ >> 24);
      has_pending_ = true;
    } else {
      ++waiting_;
    }
    low_ = (low_ & 0x00FFFFFFu) << 8;
  }

  std::vector<uint8_t>& out_;
  uint64_t low_ = 0;
  uint32_t range_ = 0xFFFFFFFFu;
  uint8_t pending_ = 0;
  bool has_pending_ = false;
  uint64_t waiting_ = 0;
};

class Reader {
 public:
  Reader(std::span<const uint8_t> in, const std::string& name) : in_(in), name_(name) {
    for (int i = 0; i < 4; ++i) value_ = value_ << 8 | next();
  }

  void code(Bit& bit, bool& one) {
    const uint32_t bound = (range_ >> kProbabilityBits) * bit.of_zero;
    one = value_ >= bound;
    if (one) {
      value_ -= bound;
      range_ -= bound;
    } else {
      range_ = bound;
    }
    bit.learn(one);
    settle();
  }
  void code_even(bool& one) {
    range_ >>= 1;
    one = value_ >= range_;
    if (one) value_ -= range_;
    settle();
  }

 private:
  void settle() {
    while (range_ < (1u << 24)) {
      range_ <<= 8;
      value_ = value_ << 8 | next();
    }
  }
  uint32_t next() {
    if (at_ >= in_.size()) throw Error(ErrorCode::kFormat, name_, "the data ends early: make it anew");
    return in_[at_++];
  }

  std::span<const uint8_t> in_;
  const std::string& name_;
  size_t at_ = 0;
  uint32_t range_ = 0xFFFFFFFFu, value_ = 0;
};

// --- What is coded: per block the place of the last coefficient that is not zero, then zero flags, sizes and
// signs. Written once for both directions: Coder is Writer (values go out) or Reader (values come in). ---

struct Model {
  std::array<Bit, 128> last;                           // a tree of seven binary decisions
  std::array<std::array<Bit, 3>, kBlockSize> is_zero;  // by place and by what came before
  std::array<std::array<Bit, 16>, 8> size;
  std::array<std::array<Bit, 32>, 2> exponent;
};

template <class Coder>
void code_tree(Coder& coder, std::array<Bit, 128>& tree, int& value) {
  size_t node = 1;
  for (int bit = 6; bit >= 0; --bit) {
    bool one = (value >> bit & 1) != 0;
    coder.code(tree[node], one);
    node = 2 * node + one;
  }
  value = static_cast<int>(node) - 128;
}

// A size of one or more: unary up to sixteen, then the exponent of the rest in unary and its bits.
template <class Coder>
void code_size(Coder& coder, std::array<Bit, 16>& unary, std::array<Bit, 32>& exponent, int& size) {
  constexpr int kUnary = 16;
  int coded = 1;
  for (; coded <= kUnary; ++coded) {
    bool more = size > coded;
    coder.code(unary[static_cast<size_t>(coded - 1)], more);
    if (!more) break;
  }
  if (coded <= kUnary) {
    size = coded;
    return;
  }
  const uint32_t rest = static_cast<uint32_t>(std::max(size - kUnary, 1));
  int bits = 0;
  while (bits < 24 && (rest >> (bits + 1)) != 0) ++bits;
  int coded_bits = 0;
  for (; coded_bits < 24; ++coded_bits) {
    bool more = bits > coded_bits;
    coder.code(exponent[static_cast<size_t>(coded_bits)], more);
    if (!more) break;
  }
  uint32_t value = 1;
  for (int bit = coded_bits - 1; bit >= 0; --bit) {
    bool one = (rest >> bit & 1) != 0;
    coder.code_even(one);
    value = value << 1 | static_cast<uint32_t>(one);
  }
  size = kUnary + static_cast<int>(value);
}

const std::array<int, kBlockSize>& zigzag() {
  static const std::array<int, kBlockSize> order = [] {
    std::array<int, kBlockSize> out{};
    int n = 0;
    for (int diagonal = 0; diagonal < 2 * kBlock - 1; ++diagonal)
      for (int i = 0; i < kBlock; ++i) {
        const int y = diagonal % 2 ? i : diagonal - i, x = diagonal - y;
        if (x >= 0 && x < kBlock && y >= 0 && y < kBlock) out[static_cast<size_t>(n++)] = y * kBlock + x;
      }
    return out;
  }();
  return order;
}

template <class Coder>
void code_block(Coder& coder, Model& model, std::array<int, kBlockSize>& levels) {
  const auto& order = zigzag();
  int last = kBlockSize;
  while (last > 0 && levels[static_cast<size_t>(order[static_cast<size_t>(last - 1)])] == 0) --last;
  code_tree(coder, model.last, last);
  last = std::min(last, kBlockSize);  // a damaged file may say more
  int before = 0;  // sizes of the two coefficients before, which tell how large the next may be
  for (int i = 0; i < last; ++i) {
    int& level = levels[static_cast<size_t>(order[static_cast<size_t>(i)])];
    const auto near = static_cast<size_t>(std::min(before, 2));
    bool zero = level == 0;
    if (i + 1 < last)
      coder.code(model.is_zero[static_cast<size_t>(i)][near], zero);
    else
      zero = false;
    int size = 0;
    if (!zero) {
      size = std::abs(level);
      bool negative = level < 0;
      const auto group = static_cast<size_t>(i == 0 ? 0 : std::min(1 + before, 7));
      code_size(coder, model.size[group], model.exponent[i == 0 ? 0 : 1], size);
      coder.code_even(negative);
      level = negative ? -size : size;
    } else {
      level = 0;
    }
    before = (before + size + 1) / 2;
  }
}

// --- Cosine transform, orthonormal. ---

const std::array<std::array<float, kBlock>, kBlock>& basis() {
  static const auto table = [] {
    std::array<std::array<float, kBlock>, kBlock> out{};
    for (size_t k = 0; k < kBlock; ++k)
      for (size_t x = 0; x < kBlock; ++x)
        out[k][x] = static_cast<float>((k == 0 ? std::sqrt(0.125) : 0.5) *
                                       std::cos((static_cast<double>(x) + 0.5) * static_cast<double>(k) *
                                                3.14159265358979323846 / kBlock));
    return out;
  }();
  return table;
}

Block transformed(const Block& in, bool forward) {
  const auto& b = basis();
  Block rows{}, out{};
  for (size_t y = 0; y < kBlock; ++y)
    for (size_t k = 0; k < kBlock; ++k)
      for (size_t x = 0; x < kBlock; ++x)
        rows[y * kBlock + k] += in[y * kBlock + x] * (forward ? b[k][x] : b[x][k]);
  for (size_t k = 0; k < kBlock; ++k)
    for (size_t y = 0; y < kBlock; ++y)
      for (size_t x = 0; x < kBlock; ++x)
        out[k * kBlock + x] += rows[y * kBlock + x] * (forward ? b[k][y] : b[y][k]);
  return out;
}

float step_at(const PlanePrecision& precision, size_t i) {
  const auto diagonal = static_cast<float>(i / kBlock + i % kBlock);
  return precision.step * (1.0f + precision.slope * diagonal);
}

// Calls body(x0, y0) for every block, row by row.
template <class Body>
void for_blocks(int width, int height, const Body& body) {
  for (int y = 0; y < height; y += kBlock)
    for (int x = 0; x < width; x += kBlock) body(x, y);
}

// What the mean of a block is likely to be: that of its left and upper neighbours.
int predicted_mean(const std::vector<int>& means, int blocks_a_row, int bx, int by) {
  const auto at = [&](int x, int y) { return means[static_cast<size_t>(y * blocks_a_row + x)]; };
  if (bx > 0 && by > 0) return (at(bx - 1, by) + at(bx, by - 1)) / 2;
  if (bx > 0) return at(bx - 1, by);
  return by > 0 ? at(bx, by - 1) : 0;
}

template <class T>
void append(std::vector<uint8_t>& out, const T& value) {
  const size_t at = out.size();
  out.resize(at + sizeof(T));
  std::memcpy(out.data() + at, &value, sizeof(T));
}

}  // namespace

std::vector<uint8_t> encode_planes(const PlaneStack& stack, std::span<const PlanePrecision> precision) {
  PATINA_CHECK_EQ(precision.size(), stack.planes.size());
  PATINA_CHECK(stack.width > 0 && stack.height > 0 && stack.width <= kMaxSide && stack.height <= kMaxSide);
  PATINA_CHECK(stack.width % kBlock == 0 && stack.height % kBlock == 0);
  PATINA_CHECK_LE(stack.planes.size(), static_cast<size_t>(kMaxPlanes));
  std::vector<uint8_t> out;
  append(out, kMagic);
  append(out, static_cast<uint16_t>(stack.width));
  append(out, static_cast<uint16_t>(stack.height));
  append(out, static_cast<uint16_t>(stack.planes.size()));
  for (const PlanePrecision& p : precision) {
    append(out, p.step);
    append(out, p.slope);
  }
  Writer writer(out);
  const auto width = static_cast<size_t>(stack.width);
  for (size_t c = 0; c < stack.planes.size(); ++c) {
    const std::vector<float>& plane = stack.planes[c];
    PATINA_CHECK_EQ(plane.size(), width * static_cast<size_t>(stack.height));
    Model model;
    const int blocks_a_row = stack.width / kBlock;
    std::vector<int> means(plane.size() / kBlockSize);
    for_blocks(stack.width, stack.height, [&](int x0, int y0) {
      Block block;
      for (size_t i = 0; i < kBlockSize; ++i)
        block[i] =
            plane[(static_cast<size_t>(y0) + i / kBlock) * width + static_cast<size_t>(x0) + i % kBlock];
      block = transformed(block, true);
      std::array<int, kBlockSize> levels;
      for (size_t i = 0; i < kBlockSize; ++i) {
        // Rounding toward zero a little more than to nearest saves bits for almost no error [Sullivan1996].
        const float level = block[i] / step_at(precision[c], i);
        const float dead = i == 0 ? 0.5f : 0.4f;
        levels[i] = static_cast<int>(std::floor(std::abs(level) + dead)) * (level < 0 ? -1 : 1);
      }
      const int bx = x0 / kBlock, by = y0 / kBlock;
      means[static_cast<size_t>(by * blocks_a_row + bx)] = levels[0];
      levels[0] -= predicted_mean(means, blocks_a_row, bx, by);
      code_block(writer, model, levels);
    });
  }
  writer.finish();
  return out;
}

PlaneStack decode_planes(std::span<const uint8_t> bytes, const std::string& name) {
  size_t at = 0;
  const auto take = [&]<class T>(T value) {
    if (bytes.size() - at < sizeof(T))
      throw Error(ErrorCode::kFormat, name, "the header of a plane stack ends early");
    std::memcpy(&value, bytes.data() + at, sizeof(T));
    at += sizeof(T);
    return value;
  };
  if (take(uint32_t{}) != kMagic)
    throw Error(ErrorCode::kFormat, name,
                "expected a plane stack (its first bytes are PLS1), found something else");
  PlaneStack stack;
  stack.width = take(uint16_t{});
  stack.height = take(uint16_t{});
  const int num_planes = take(uint16_t{});
  if (stack.width < kBlock || stack.height < kBlock || stack.width > kMaxSide || stack.height > kMaxSide ||
      stack.width % kBlock || stack.height % kBlock || num_planes > kMaxPlanes)
    throw Error(ErrorCode::kFormat, name,
                "expected sides that are multiples of 8 up to 4096 and at most 64 planes, found " +
                    std::to_string(stack.width) + " x " + std::to_string(stack.height) + " x " +
                    std::to_string(num_planes));
  std::vector<PlanePrecision> precision(static_cast<size_t>(num_planes));
  for (PlanePrecision& p : precision) {
    p.step = take(float{});
    p.slope = take(float{});
    if (!std::isfinite(p.step) || !std::isfinite(p.slope))
      throw Error(ErrorCode::kFormat, name, "expected finite quantisation steps");
  }

  Reader reader(bytes.subspan(at), name);
  const auto width = static_cast<size_t>(stack.width);
  for (size_t c = 0; c < precision.size(); ++c) {
    std::vector<float>& plane = stack.planes.emplace_back(width * static_cast<size_t>(stack.height));
    Model model;
    const int blocks_a_row = stack.width / kBlock;
    std::vector<int> means(plane.size() / kBlockSize);
    for_blocks(stack.width, stack.height, [&](int x0, int y0) {
      std::array<int, kBlockSize> levels{};
      code_block(reader, model, levels);
      const int bx = x0 / kBlock, by = y0 / kBlock;
      levels[0] += predicted_mean(means, blocks_a_row, bx, by);
      // Sums of damaged differences could otherwise grow past an int.
      if (std::abs(levels[0]) > kMaxLevel)
        throw Error(ErrorCode::kFormat, name, "a block's mean is out of range: make the data anew");
      means[static_cast<size_t>(by * blocks_a_row + bx)] = levels[0];
      Block block;
      for (size_t i = 0; i < kBlockSize; ++i)
        block[i] = static_cast<float>(levels[i]) * step_at(precision[c], i);
      block = transformed(block, false);
      for (size_t i = 0; i < kBlockSize; ++i)
        plane[(static_cast<size_t>(y0) + i / kBlock) * width + static_cast<size_t>(x0) + i % kBlock] =
            block[i];
    });
  }
  return stack;
}

}  // namespace patina::mini_data
