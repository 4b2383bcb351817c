#include "merge_problem.h"

#include <algorithm>
#include <cmath>
#include <ostream>

#include <gtest/gtest.h>

#include "emulated_gpu/emulated_gpu.h"
#include "patina/base/bf16.h"

namespace patina::attention::test {
namespace {

using cuda::Element16;

constexpr uint16_t kUntouched = 0x5a5a;

uint16_t bits_of(Element16 element, float value) {
  return element == Element16::kBf16 ? bf16_of_float(value) : half_of_float(value);
}
float value_of(Element16 element, uint16_t bits) {
  return element == Element16::kBf16 ? float_of_bf16(bits) : float_of_half(bits);
}
float rounded(Element16 element, float value) {
  return value_of(element, bits_of(element, value));
}

Strides strides_of(const Spec& s, Memory memory) {
  if (memory == Memory::kHeads) return {s.heads * s.queries * s.dim, s.dim, s.queries * s.dim};
  const int64_t row = s.heads * s.dim + (memory == Memory::kPadded ? 24 : 0);
  return {s.queries * row, row, s.dim};
}

float scale_of(const Problem& p) {
  return p.arguments(Element::kF32, const_cast<float*>(p.q.data()), nullptr).scale;
}

/// f32 throughout in natural order, probabilities and outputs rounded to the 16-bit type.
Result plain16(const Problem& p, Element16 element) {
  const Spec& s = p.spec;
  const float scale = scale_of(p);
  Result result;
  std::vector<float> score(static_cast<size_t>(s.keys));
  for (int64_t row = 0; row < p.num_rows(); ++row) {
    const int64_t i = row % s.queries, h = row / s.queries % s.heads, b = row / s.queries / s.heads;
    const float* q = p.q.data() + b * p.q_strides.batch + i * p.q_strides.token + h * p.q_strides.head;
    const int64_t base = b * p.k_strides.batch + h * p.k_strides.head;
    const auto at = [&](int64_t j, int64_t d) {
      return static_cast<size_t>(base + j * p.k_strides.token + d);
    };
    for (int64_t j = 0; j < s.keys; ++j) {
      float dot = 0;
      for (int64_t d = 0; d < s.dim; ++d) dot += q[d] * p.k[at(j, d)];
      score[static_cast<size_t>(j)] = dot * scale;
    }
    for (const int32_t j : biased_keys(p.buckets, i)) score[static_cast<size_t>(j)] += s.buckets->beta;
    const float largest = *std::max_element(score.begin(), score.end());
    float sum = 0;
    for (float& value : score) {
      sum += value = std::exp(value - largest);
      value = rounded(element, value);
    }
    for (int64_t d = 0; d < s.dim; ++d) {
      float out = 0;
      for (int64_t j = 0; j < s.keys; ++j) out += score[static_cast<size_t>(j)] * p.v[at(j, d)];
      result.out.push_back(static_cast<double>(rounded(element, out / sum)));
    }
    result.log_sum_exp.push_back(static_cast<double>(largest + std::log(sum)));
  }
  return result;
}

}  // namespace

void PrintTo(const MergeCase& c, std::ostream* out) {
  PrintTo(c.spec, out);
  *out << (c.element == Element16::kBf16 ? ", bf16" : ", f16") << ", memory " << static_cast<int>(c.memory);
}

Spec merge_spec(int64_t batch, int64_t heads, int64_t dim, float score_deviation, const BucketSpec& buckets) {
  return {batch, heads, 0, 0, dim, Layout::kTokens, score_deviation, buckets};
}

std::vector<MergeCase> merge_cases() {
  constexpr Element16 kBf16 = Element16::kBf16, kF16 = Element16::kF16;
  std::vector<MergeCase> all;
  const auto add = [&](const Spec& spec, Element16 element = Element16::kBf16,
                       Memory memory = Memory::kTokens) {
    all.push_back({spec, element, memory});
  };
  // Every compiled size, and head dimensions that each of them pads.
  for (const int64_t dim : {8, 16, 24, 40, 48, 64, 72, 80, 88, 96, 104, 128, 136, 160, 168, 192, 200, 256})
    add(merge_spec(1, 1, dim, 1, {2, 5, 6, 2, Landing::kProjected, 1.8f}), dim % 16 == 0 ? kBf16 : kF16);
  for (const int64_t dim : {40, 80, 160})
    for (const Element16 element : {kBf16, kF16})
      add(merge_spec(1, 2, dim, 1, {2, 9, 7, 2, Landing::kProjected, 1.8f}), element);
  // Layouts, batches and heads.
  for (const Memory memory : {Memory::kTokens, Memory::kHeads, Memory::kPadded})
    add(merge_spec(2, 3, 40, 1, {2, 5, 9, 1, Landing::kProjected, 1.8f}), kBf16, memory);
  // Grids: one pixel, one view, views of full blocks, windows of all four levels and larger than a view.
  add(merge_spec(1, 1, 40, 1, {1, 1, 1, 0, Landing::kEverywhere, 1.8f}));
  add(merge_spec(1, 1, 40, 1, {3, 1, 1, 0, Landing::kProjected, 1.8f}));
  add(merge_spec(1, 1, 40, 1, {2, 8, 8, 4, Landing::kProjected, 1.8f}));
  add(merge_spec(1, 1, 40, 1, {1, 20, 20, 3, Landing::kProjected, 1.8f}));
  add(merge_spec(1, 1, 80, 1, {3, 4, 6, 0, Landing::kProjected, 1.8f}));
  add(merge_spec(1, 1, 40, 1, {2, 6, 6, 30, Landing::kProjected, 1.8f}));
  add(merge_spec(1, 1, 40, 1, {2, 17, 3, 1, Landing::kProjected, 1.8f}));
  // Biases, to where unbiased keys vanish and to the limits; rows with no, some and all keys biased; keys in
  // many cells.
  for (const float beta : {1e-6f, 1e-3f, 0.3f, 3.5f, 8.0f, 20.0f, 100.0f, 1e4f, -1e-3f, -0.3f, -1.0f})
    for (const Landing landing : {Landing::kNone, Landing::kProjected, Landing::kEverywhere})
      add(merge_spec(1, 1, 40, 1, {2, 5, 4, 1, landing, beta}), beta == 8 || beta == 100 ? kF16 : kBf16);
  // Score ranges: nearly equal weights, and nearly one-hot.
  for (const float deviation : {0.01f, 10.0f, 50.0f})
    for (const float beta : {-0.5f, 2.0f, 12.0f})
      add(merge_spec(1, 1, 40, deviation, {2, 7, 7, 2, Landing::kProjected, beta}),
          deviation == 10 ? kF16 : kBf16);
  return all;
}

Problem make_problem16(const Spec& spec, Element16 element, uint64_t seed) {
  Problem p = make_problem(spec, Element::kF32, seed);
  for (std::vector<float>* tensor : {&p.q, &p.k, &p.v})
    for (float& value : *tensor) value = rounded(element, value);
  return p;
}

Problem without_bias(Problem p) {
  p.spec.buckets.reset();
  return p;
}

MergeBuffers lay_out(const Problem& p, const Result& dense, Element16 element, Memory memory) {
  const Spec& s = p.spec;
  const Strides strides = strides_of(s, memory);
  const int64_t size = s.batch * strides.batch;
  MergeBuffers buffers{Aligned(size), Aligned(size), Aligned(size), Aligned(size), {}, {}, {}};
  std::fill_n(buffers.out.data(), size, kUntouched);
  size_t row = 0;
  for (int64_t b = 0; b < s.batch; ++b)
    for (int64_t h = 0; h < s.heads; ++h)
      for (int64_t i = 0; i < s.queries; ++i, ++row) {
        buffers.log_sum_exp.push_back(static_cast<float>(dense.log_sum_exp[row]));
        const auto from = [&](const Strides& x) {
          return static_cast<size_t>(b * x.batch + i * x.token + h * x.head);
        };
        const size_t dim = static_cast<size_t>(s.dim);
        for (size_t d = 0; d < dim; ++d) {
          const size_t to = from(strides) + d;
          buffers.q.data()[to] = bits_of(element, p.q[from(p.q_strides) + d]);
          buffers.k.data()[to] = bits_of(element, p.k[from(p.k_strides) + d]);
          buffers.v.data()[to] = bits_of(element, p.v[from(p.k_strides) + d]);
          buffers.out.data()[to] = bits_of(element, static_cast<float>(dense.out[row * dim + d]));
        }
      }

  buffers.tiles = cuda::make_bias_tiles(p.buckets);
  cuda::SparseMerge& m = buffers.merge;
  m.shape = {s.batch, s.queries, s.keys, s.heads, s.dim};
  m.element = element;
  m.q = buffers.q.data(), m.k = buffers.k.data(), m.v = buffers.v.data(), m.out = buffers.out.data();
  m.log_sum_exp = buffers.log_sum_exp.data();
  m.q_strides = m.k_strides = m.v_strides = m.out_strides = strides;
  m.log_sum_exp_strides = {s.heads * s.queries, 1, s.queries};
  m.scale = scale_of(p);
  m.beta = s.buckets->beta;
  m.blocks = buffers.tiles.blocks.data(), m.keys = buffers.tiles.keys.data();
  m.masks = buffers.tiles.masks.data();
  m.num_blocks = static_cast<int32_t>(buffers.tiles.blocks.size()), m.row_stride = buffers.tiles.row_stride;
  return buffers;
}

Merged read_back(const Problem& p, MergeBuffers& buffers) {
  const Spec& s = p.spec;
  const Strides& strides = buffers.merge.out_strides;
  uint16_t* out = buffers.out.data();
  Merged merged;
  for (int64_t b = 0; b < s.batch; ++b)
    for (int64_t h = 0; h < s.heads; ++h)
      for (int64_t i = 0; i < s.queries; ++i)
        for (int64_t d = 0; d < s.dim; ++d) {
          uint16_t& bits = out[b * strides.batch + i * strides.token + h * strides.head + d];
          merged.bits.push_back(bits);
          merged.result.out.push_back(static_cast<double>(value_of(buffers.merge.element, bits)));
          bits = kUntouched;
        }
  EXPECT_TRUE(std::all_of(out, out + buffers.out.size, [](uint16_t bits) { return bits == kUntouched; }))
      << "wrote between rows";
  merged.result.log_sum_exp.assign(buffers.log_sum_exp.begin(), buffers.log_sum_exp.end());
  return merged;
}

void expect_twice_plain(const Problem& p, const Result& found, Element16 element) {
  const Result exact = truth(p), simple = plain16(p, element);
  double largest = 0;
  for (const double value : exact.out) largest = std::max(largest, std::abs(value));
  // One unit in the last place of the largest output: where the plain version happens to be exact.
  const double unit = largest * (element == Element16::kF16 ? 0x1p-11 : 0x1p-8);
  const Difference ours = difference(found.out, exact.out), theirs = difference(simple.out, exact.out);
  EXPECT_LE(ours.max, 2 * theirs.max + unit);
  EXPECT_LE(ours.rms, 2 * theirs.rms + unit / 4);
  double largest_sum = 1;
  for (const double value : exact.log_sum_exp) largest_sum = std::max(largest_sum, std::abs(value));
  EXPECT_LE(difference(found.log_sum_exp, exact.log_sum_exp).max, largest_sum * 0x1p-21);
}

}  // namespace patina::attention::test
