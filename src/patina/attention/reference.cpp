// The definition of biased attention: one row at a time in float64, scores of the whole row kept, nothing
// clever.
#include <algorithm>
#include <cmath>
#include <vector>

#include "patina/attention/attention.h"
#include "patina/base/bf16.h"

namespace patina::attention {
namespace {

double read(const Arguments& a, const void* tensor, int64_t offset) {
  if (a.element == Element::kF32) return static_cast<double>(static_cast<const float*>(tensor)[offset]);
  return static_cast<double>(float_of_bf16(static_cast<const uint16_t*>(tensor)[offset]));
}

void write(const Arguments& a, int64_t offset, double value) {
  if (a.element == Element::kF32)
    static_cast<float*>(a.out)[offset] = static_cast<float>(value);
  else
    static_cast<uint16_t*>(a.out)[offset] = bf16_of_float(static_cast<float>(value));
}

}  // namespace

void attention_reference(const Arguments& a) {
  validate(a);
  const Shape& n = a.shape;
  std::vector<double> weights(static_cast<size_t>(n.num_keys)), row(static_cast<size_t>(n.head_dim));
  const auto offset = [](const Strides& s, int64_t b, int64_t token, int64_t h) {
    return b * s.batch + token * s.token + h * s.head;
  };

  for (int64_t b = 0; b < n.batch; ++b)
    for (int64_t h = 0; h < n.num_heads; ++h)
      for (int64_t i = 0; i < n.num_queries; ++i) {
        const int64_t q = offset(a.q_strides, b, i, h);
        for (int64_t j = 0; j < n.num_keys; ++j) {
          const int64_t k = offset(a.k_strides, b, j, h);
          double dot = 0;
          for (int64_t d = 0; d < n.head_dim; ++d) dot += read(a, a.q, q + d) * read(a, a.k, k + d);
          weights[static_cast<size_t>(j)] = dot * static_cast<double>(a.scale);
        }
        if (a.buckets)
          for (const int32_t j : biased_keys(*a.buckets, i))
            weights[static_cast<size_t>(j)] += static_cast<double>(a.beta);

        // Softmax about the largest score; all -inf gives -inf - -inf = NaN, as does any +inf.
        const double largest = *std::max_element(weights.begin(), weights.end());
        double sum = 0;
        for (double& weight : weights) sum += weight = std::exp(weight - largest);

        std::fill(row.begin(), row.end(), 0.0);
        for (int64_t j = 0; j < n.num_keys; ++j) {
          const int64_t v = offset(a.v_strides, b, j, h);
          for (int64_t d = 0; d < n.head_dim; ++d)
            row[static_cast<size_t>(d)] += weights[static_cast<size_t>(j)] * read(a, a.v, v + d);
        }
        const int64_t out = offset(a.out_strides, b, i, h);
        for (int64_t d = 0; d < n.head_dim; ++d) write(a, out + d, row[static_cast<size_t>(d)] / sum);
        if (a.log_sum_exp)
          a.log_sum_exp[(b * n.num_heads + h) * n.num_queries + i] =
              static_cast<float>(largest + std::log(sum));
      }
}

}  // namespace patina::attention
