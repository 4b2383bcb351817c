#include "problem.h"

#include <algorithm>
#include <cmath>
#include <ostream>
#include <set>

#include <gtest/gtest.h>

#include "patina/base/bf16.h"
#include "patina/base/random.h"

namespace patina::attention::test {
namespace {

constexpr float kUntouched = -12345.0f;  // representable in bf16

std::vector<float> gaussian(size_t count, float deviation, uint64_t seed, uint32_t which) {
  std::vector<float> values;
  for (uint64_t i = 0; values.size() < count; ++i)
    for (const float value : gaussian4(seed, RandomPurpose::kTest, i, which))
      values.push_back(value * deviation);
  values.resize(count);
  return values;
}

std::vector<uint16_t> to_bf16(const std::vector<float>& values) {
  std::vector<uint16_t> result;
  for (const float value : values) result.push_back(bf16_of_float(value));
  return result;
}

void round_to_bf16(std::vector<float>& values) {
  for (float& value : values) value = float_of_bf16(bf16_of_float(value));
}

}  // namespace

void PrintTo(const Spec& s, std::ostream* out) {
  *out << "batch " << s.batch << ", heads " << s.heads << ", queries " << s.queries << ", keys " << s.keys
       << ", dim " << s.dim << ", layout " << static_cast<int>(s.layout) << ", score deviation "
       << s.score_deviation;
  if (s.buckets)
    *out << ", grid " << s.buckets->grid << " of views " << s.buckets->view_width << " x "
         << s.buckets->view_height << ", radius " << s.buckets->radius << ", landing "
         << static_cast<int>(s.buckets->landing) << ", beta " << s.buckets->beta;
}

KeyBuckets make_buckets(const BucketSpec& spec, uint64_t seed) {
  KeyBuckets buckets;
  buckets.grid = spec.grid;
  buckets.view_width = spec.view_width;
  buckets.view_height = spec.view_height;
  buckets.window_radius = spec.radius;
  const int64_t n = buckets.num_pixels();
  std::vector<std::set<int32_t>> cells(static_cast<size_t>(n));
  RandomStream random(seed, RandomPurpose::kTest, 7);
  const int views = spec.grid * spec.grid;
  for (int32_t key = 0; key < n; ++key) {
    const int own =
        key / buckets.width() / spec.view_height * spec.grid + key % buckets.width() / spec.view_width;
    for (int view = 0; view < views && spec.landing == Landing::kProjected; ++view) {
      if ((view == own && views > 1) || random.uniform() > 0.66f) continue;
      const int x = view % spec.grid * spec.view_width +
                    static_cast<int>(random.uniform() * static_cast<float>(spec.view_width));
      const int y = view / spec.grid * spec.view_height +
                    static_cast<int>(random.uniform() * static_cast<float>(spec.view_height));
      cells[static_cast<size_t>(y) * static_cast<size_t>(buckets.width()) + static_cast<size_t>(x)].insert(
          key);
    }
    if (spec.landing == Landing::kEverywhere)
      for (auto& cell : cells) cell.insert(key);
  }
  buckets.offsets.push_back(0);
  for (const auto& cell : cells) {
    buckets.keys.insert(buckets.keys.end(), cell.begin(), cell.end());
    buckets.offsets.push_back(static_cast<int32_t>(buckets.keys.size()));
  }
  return buckets;
}

Problem make_problem(const Spec& given, Element element, uint64_t seed) {
  Problem p;
  p.spec = given;
  p.element = element;
  Spec& s = p.spec;
  if (s.buckets) {
    p.buckets = make_buckets(*s.buckets, seed);
    s.queries = s.keys = p.buckets.num_pixels();
  }
  const auto strides = [&](int64_t tokens) -> Strides {
    switch (s.layout) {
      case Layout::kTokens:
        return {tokens * s.heads * s.dim, s.heads * s.dim, s.dim};
      case Layout::kHeads:
        return {tokens * s.heads * s.dim, s.dim, tokens * s.dim};
      case Layout::kFused:
        break;
    }
    const int64_t row = 3 * s.heads * s.dim + 5;
    return {tokens * row, row, s.dim};
  };
  p.q_strides = strides(s.queries);
  p.k_strides = strides(s.keys);
  p.out_strides = strides(s.queries);

  // Unit-variance factors give q·k/√d a deviation of one.
  const float factor = std::sqrt(s.score_deviation);
  p.q = gaussian(static_cast<size_t>(s.batch * p.q_strides.batch), factor, seed, 1);
  p.k = gaussian(static_cast<size_t>(s.batch * p.k_strides.batch), factor, seed, 2);
  p.v = gaussian(static_cast<size_t>(s.batch * p.k_strides.batch), 1.0f, seed, 3);
  if (element == Element::kBf16) {
    for (std::vector<float>* tensor : {&p.q, &p.k, &p.v}) round_to_bf16(*tensor);
    p.q16 = to_bf16(p.q);
    p.k16 = to_bf16(p.k);
    p.v16 = to_bf16(p.v);
  }
  return p;
}

Arguments Problem::arguments(Element as, void* out, float* log_sum_exp) const {
  Arguments a;
  a.shape = {spec.batch, spec.queries, spec.keys, spec.heads, spec.dim};
  a.element = as;
  const bool bf16 = as == Element::kBf16;
  a.q = bf16 ? static_cast<const void*>(q16.data()) : q.data();
  a.k = bf16 ? static_cast<const void*>(k16.data()) : k.data();
  a.v = bf16 ? static_cast<const void*>(v16.data()) : v.data();
  a.out = out;
  a.log_sum_exp = log_sum_exp;
  a.q_strides = q_strides;
  a.k_strides = a.v_strides = k_strides;
  a.out_strides = out_strides;
  a.scale = 1.0f / std::sqrt(static_cast<float>(spec.dim));
  if (spec.buckets) {
    a.buckets = &buckets;
    a.beta = spec.buckets->beta;
  }
  return a;
}

size_t Problem::out_size() const {
  return static_cast<size_t>(spec.batch * out_strides.batch);
}

int64_t Problem::out_offset(int64_t row) const {
  const int64_t query = row % spec.queries, head = row / spec.queries % spec.heads,
                batch = row / spec.queries / spec.heads;
  return batch * out_strides.batch + query * out_strides.token + head * out_strides.head;
}

namespace {

/// Rows of a strided f32 output; what lies between must be untouched.
Result gather(const Problem& p, std::vector<float> out, const std::vector<float>& log_sum_exp) {
  Result result;
  for (int64_t row = 0; row < p.num_rows(); ++row)
    for (int64_t d = 0; d < p.spec.dim; ++d) {
      float& value = out[static_cast<size_t>(p.out_offset(row) + d)];
      result.out.push_back(static_cast<double>(value));
      value = kUntouched;
    }
  EXPECT_TRUE(std::all_of(out.begin(), out.end(), [](float value) { return value == kUntouched; }))
      << "wrote between rows";
  result.log_sum_exp.assign(log_sum_exp.begin(), log_sum_exp.end());
  return result;
}

}  // namespace

Result truth(const Problem& p) {
  std::vector<float> out(p.out_size(), kUntouched), log_sum_exp(static_cast<size_t>(p.num_rows()));
  attention_reference(p.arguments(Element::kF32, out.data(), log_sum_exp.data()));
  return gather(p, std::move(out), log_sum_exp);
}

Result run(const Problem& p, CpuIsa isa) {
  std::vector<float> log_sum_exp(static_cast<size_t>(p.num_rows()));
  std::vector<float> out(p.out_size(), kUntouched);
  if (p.element == Element::kF32) {
    attention_cpu(p.arguments(Element::kF32, out.data(), log_sum_exp.data()), isa);
  } else {
    std::vector<uint16_t> out16(p.out_size(), bf16_of_float(kUntouched));
    attention_cpu(p.arguments(Element::kBf16, out16.data(), log_sum_exp.data()), isa);
    std::transform(out16.begin(), out16.end(), out.begin(), float_of_bf16);
    const float untouched = float_of_bf16(bf16_of_float(kUntouched));
    std::replace(out.begin(), out.end(), untouched, kUntouched);
  }
  return gather(p, std::move(out), log_sum_exp);
}

Result plain(const Problem& p) {
  const Spec& s = p.spec;
  const bool bf16 = p.element == Element::kBf16;
  const Arguments a = p.arguments(Element::kF32, const_cast<float*>(p.q.data()), nullptr);
  Result result;
  std::vector<float> score(static_cast<size_t>(s.keys));
  for (int64_t row = 0; row < p.num_rows(); ++row) {
    const int64_t i = row % s.queries, h = row / s.queries % s.heads, b = row / s.queries / s.heads;
    const float* q = p.q.data() + b * p.q_strides.batch + i * p.q_strides.token + h * p.q_strides.head;
    const int64_t base = b * p.k_strides.batch + h * p.k_strides.head;
    for (int64_t j = 0; j < s.keys; ++j) {
      float dot = 0;
      for (int64_t d = 0; d < s.dim; ++d)
        dot += q[d] * p.k[static_cast<size_t>(base + j * p.k_strides.token + d)];
      score[static_cast<size_t>(j)] = dot * a.scale;
    }
    if (a.buckets)
      for (const int32_t j : biased_keys(p.buckets, i)) score[static_cast<size_t>(j)] += a.beta;
    const float largest = *std::max_element(score.begin(), score.end());
    float sum = 0;
    for (float& value : score) sum += value = std::exp(value - largest);
    if (bf16) round_to_bf16(score);
    for (int64_t d = 0; d < s.dim; ++d) {
      float out = 0;
      for (int64_t j = 0; j < s.keys; ++j)
        out += score[static_cast<size_t>(j)] * p.v[static_cast<size_t>(base + j * p.k_strides.token + d)];
      out /= sum;
      result.out.push_back(static_cast<double>(bf16 ? float_of_bf16(bf16_of_float(out)) : out));
    }
    result.log_sum_exp.push_back(static_cast<double>(largest + std::log(sum)));
  }
  return result;
}

Difference difference(const std::vector<double>& a, const std::vector<double>& b) {
  Difference result;
  for (size_t i = 0; i < a.size(); ++i) {
    const double d = std::abs(a[i] - b[i]);
    result.max = d <= result.max ? result.max : d;  // a NaN stays
    result.rms += d * d;
  }
  result.rms = std::sqrt(result.rms / static_cast<double>(a.size()));
  return result;
}

}  // namespace patina::attention::test
