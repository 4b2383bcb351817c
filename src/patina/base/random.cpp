#include "patina/base/random.h"

namespace patina {
namespace {

// The key: the seed's low word, and its high word mixed with the purpose by an odd constant, so that
// purposes of one seed and seeds of one purpose both get different keys.
std::array<uint32_t, 2> make_key(uint64_t seed, RandomPurpose purpose) {
  return {static_cast<uint32_t>(seed),
          static_cast<uint32_t>(seed >> 32) ^ (static_cast<uint32_t>(purpose) * 0x9E3779B1u)};
}

uint32_t reversed(uint32_t x) {
  x = __builtin_bswap32(x);
  x = ((x & 0x0F0F0F0Fu) << 4) | ((x >> 4) & 0x0F0F0F0Fu);
  x = ((x & 0x33333333u) << 2) | ((x >> 2) & 0x33333333u);
  return ((x & 0x55555555u) << 1) | ((x >> 1) & 0x55555555u);
}

/// A permutation in which every bit is flipped or not by a hash of the bits below it: Owen's scrambling of
/// a number whose digits stand in reverse order. Constants of [Burley2020].
uint32_t scrambled(uint32_t x, uint32_t seed) {
  x += seed;
  x ^= x * 0x6c50b47cu;
  x ^= x * 0xb82f1e52u;
  x ^= x * 0xc7afe638u;
  x ^= x * 0x8d22f6e6u;
  return x;
}

/// Sobol's second dimension, digits in reverse order. Its matrix is Pascal's triangle modulo 2: by Lucas's
/// theorem digit i is the parity of all digits j of the index whose binary form contains that of i, which
/// five steps sum up.
uint32_t second_dimension(uint32_t index) {
  index ^= (index >> 1) & 0x55555555u;
  index ^= (index >> 2) & 0x33333333u;
  index ^= (index >> 4) & 0x0F0F0F0Fu;
  index ^= (index >> 8) & 0x00FF00FFu;
  return index ^ ((index >> 16) & 0x0000FFFFu);
}

/// Every bit of the result depends on every bit of x [Appleby2011, MurmurHash3's finalizer].
uint32_t mixed(uint32_t x) {
  x = (x ^ (x >> 16)) * 0x85ebca6bu;
  x = (x ^ (x >> 13)) * 0xc2b2ae35u;
  return x ^ (x >> 16);
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

RandomStream RandomStream::even(uint64_t seed, RandomPurpose purpose, uint64_t index, uint32_t sample) {
  RandomStream stream(seed, purpose, index);
  stream.block_ = stream.next_block();  // what the scrambling of every draw follows from
  stream.is_even_ = true;
  stream.reversed_sample_ = reversed(sample);
  return stream;
}

std::array<uint32_t, 2> RandomStream::next_even() {
  const uint32_t seed = mixed(block_[0] + draw_++);
  const uint32_t index = reversed(scrambled(reversed_sample_, seed));
  return {reversed(scrambled(index, mixed(seed ^ block_[1]))),
          reversed(scrambled(second_dimension(index), mixed(seed ^ block_[2])))};
}

std::array<uint32_t, 4> RandomStream::next_block() {
  const auto block = philox(counter_, key_);
  ++counter_[3];
  return block;
}

float RandomStream::uniform() {
  if (is_even_) return uniform_from_bits(next_even()[0]);
  if (used_ == 4) {
    block_ = next_block();
    used_ = 0;
  }
  return uniform_from_bits(block_[static_cast<size_t>(used_++)]);
}

vec2 RandomStream::uniform2() {
  if (is_even_) {
    const std::array<uint32_t, 2> bits = next_even();
    return {uniform_from_bits(bits[0]), uniform_from_bits(bits[1])};
  }
  const float x = uniform();
  return {x, uniform()};
}

float RandomStream::gaussian() {
  return gaussian_from_bits(next_block())[0];
}

}  // namespace patina
