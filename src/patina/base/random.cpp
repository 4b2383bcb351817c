#include "patina/base/random.h"

namespace patina {
namespace {

// The key: the seed's low word, and its high word mixed with the purpose by an odd constant, so that
// purposes of one seed and seeds of one purpose both get different keys.
std::array<uint32_t, 2> make_key(uint64_t seed, RandomPurpose purpose) {
  return {static_cast<uint32_t>(seed),
          static_cast<uint32_t>(seed >> 32) ^ (static_cast<uint32_t>(purpose) * 0x9E3779B1u)};
}

}  // namespace

std::array<uint32_t, 4> philox(std::array<uint32_t, 4> c, std::array<uint32_t, 2> k) {
  for (int round = 0; round < 10; ++round) {
    const uint64_t p0 = uint64_t{0xD2511F53u} * c[0];
    const uint64_t p1 = uint64_t{0xCD9E8D57u} * c[2];
    c = {static_cast<uint32_t>(p1 >> 32) ^ c[1] ^ k[0], static_cast<uint32_t>(p1),
         static_cast<uint32_t>(p0 >> 32) ^ c[3] ^ k[1], static_cast<uint32_t>(p0)};
    k[0] += 0x9E3779B9u;
    k[1] += 0xBB67AE85u;
  }
  return c;
}

std::array<float, 4> gaussian_from_bits(const std::array<uint32_t, 4>& bits) {
  std::array<float, 4> out;
  for (int pair = 0; pair < 2; ++pair) {
    // 1 - u lies in (0,1], so the logarithm is finite.
    const float radius = std::sqrt(-2.0f * std::log(1.0f - uniform_from_bits(bits[2 * pair])));
    const float angle = 2.0f * kPi * uniform_from_bits(bits[2 * pair + 1]);
    out[2 * pair] = radius * std::cos(angle);
    out[2 * pair + 1] = radius * std::sin(angle);
  }
  return out;
}

std::array<float, 4> gaussian4(uint64_t seed, RandomPurpose purpose, uint64_t index, uint32_t sub_index) {
  return gaussian_from_bits(
      philox({static_cast<uint32_t>(index), static_cast<uint32_t>(index >> 32), sub_index, 0},
             make_key(seed, purpose)));
}

RandomStream::RandomStream(uint64_t seed, RandomPurpose purpose, uint64_t index, uint32_t sub_index)
    : key_(make_key(seed, purpose)),
      counter_{static_cast<uint32_t>(index), static_cast<uint32_t>(index >> 32), sub_index, 0} {}

std::array<uint32_t, 4> RandomStream::next_block() {
  const auto block = philox(counter_, key_);
  ++counter_[3];
  return block;
}

float RandomStream::uniform() {
  if (used_ == 4) {
    block_ = next_block();
    used_ = 0;
  }
  return uniform_from_bits(block_[static_cast<size_t>(used_++)]);
}

float RandomStream::gaussian() {
  return gaussian_from_bits(next_block())[0];
}

}  // namespace patina
