#include "patina/inverse/fit_step.h"

#include <algorithm>
#include <cmath>

#include "patina/base/parallel.h"
#include "patina/inverse/fit_slots.h"

namespace patina::inverse {
namespace {

constexpr int kMaxInnerSteps = 12;
constexpr double kInnerTolerance = 0.03;  // of the preconditioned residual's norm
constexpr float kCostOfKinds = 0.1f;
constexpr int64_t kNumbersPerTask = 1 << 14;

// What a squared coefficient costs at a level of a field: see Prior::detail. That texels of one kind change
// alike costs hardly anything.
float level_cost(const Prior& prior, size_t level, size_t num_levels) {
  if (level + 1 == num_levels) return kCostOfKinds;
  return prior.detail * std::pow(prior.coarser, static_cast<float>(level));
}

// Calls body(block, first, last) over blocks of one size, whatever the number of threads.
template <class Body>
void for_blocks(size_t count, const Body& body) {
  const auto num_blocks = static_cast<int64_t>((count + kNumbersPerTask - 1) / kNumbersPerTask);
  parallel_for(0, num_blocks, 1, [&](int64_t begin, int64_t end) {
    for (int64_t block = begin; block < end; ++block) {
      const auto first = static_cast<size_t>(block * kNumbersPerTask);
      body(static_cast<size_t>(block), first, std::min(count, first + kNumbersPerTask));
    }
  });
}

// Calls body(i) for every number of many.
template <class Body>
void each_number(size_t count, const Body& body) {
  for_blocks(count, [&](size_t, size_t first, size_t last) {
    for (size_t i = first; i < last; ++i) body(i);
  });
}

double dot(const std::vector<float>& a, const std::vector<float>& b) {
  std::vector<double> sums((a.size() + kNumbersPerTask - 1) / kNumbersPerTask);
  for_blocks(a.size(), [&](size_t block, size_t first, size_t last) {
    double sum = 0;
    for (size_t i = first; i < last; ++i) sum += double{a[i]} * b[i];
    sums[block] = sum;
  });
  double total = 0;
  for (const double sum : sums) total += sum;
  return total;
}

// The maps that take part in a step, their parameters as one vector a level.
class Problem {
 public:
  Problem(const FitState& state, const Evaluator& evaluator, int iterations)
      : state_(state), evaluator_(evaluator) {
    const float progress =
        static_cast<float>(state.next_iteration) / static_cast<float>(std::max(1, iterations));
    // Without the maps that should come first nothing is worth waiting for.
    float first_start = 1.0f;
    for (const FittedMap& map : state.fitted) first_start = std::min(first_start, fit_slot(map.slot).start);
    for (size_t f = 0; f < state.fitted.size(); ++f)
      if (progress + first_start >= fit_slot(state.fitted[f].slot).start) joined_.push_back(f);
    set_curvatures();
  }

  Parameters zero() const {
    Parameters out = parameters_of(state_.fitted);
    each(out, [](std::vector<float>& values) { std::fill(values.begin(), values.end(), 0.0f); });
    return out;
  }

  /// −gradient of the objective.
  Parameters descent() const {
    std::vector<float>& values = values_;
    each_pixel([&](size_t pixel, size_t first, size_t last) {
      const vec3 residual = evaluator_.residuals()[pixel];
      for (size_t i = first; i < last; ++i) {
        const SampleTerms& terms = evaluator_.terms()[i];
        const float* beyond = &terms.beyond.base_color.x;
        for (size_t v = 0; v < kNumValues; ++v) {
          float sum = terms.weight * beyond[v];
          for (size_t c = 0; c < 3; ++c)
            sum += (&terms.derivative[c].base_color.x)[v] * residual[static_cast<int>(c)];
          values[i * kNumValues + v] = -sum;
        }
      }
    });
    Parameters out = zero();
    for (const size_t f : joined_) {
      const FittedMap& map = state_.fitted[f];
      Image texels = map.field.delta.texels;
      gather_from_samples(evaluator_.taps_of(f), values.data() + fit_slot(map.slot).first_value, kNumValues,
                          texels);
      const float change = fit_slot(map.slot).prior.change;
      const std::vector<float>& delta = map.field.delta.texels.pixels;
      const std::vector<float>& guess = map.field.guess.pixels;
      each_number(delta.size(), [&](size_t i) {
        texels.pixels[i] -= change * (guess.empty() ? delta[i] : delta[i] - guess[i]);
      });
      out[f] = restrict_to_levels(map.field, std::move(texels));
      for (size_t level = 0; level < out[f].size(); ++level) {
        std::vector<float>& to = out[f][level].pixels;
        const std::vector<float>&curvature = detail_curvature_[f][level].pixels,
              &from = map.field.levels[level].pixels;
        each_number(to.size(), [&](size_t i) { to[i] -= curvature[i] * from[i]; });
      }
    }
    return out;
  }

  /// The curvature of the objective, damped, times `x`.
  Parameters apply(const Parameters& x) const {
    std::vector<float>& values = values_;
    each_number(values.size(), [&](size_t i) { values[i] = 0.0f; });
    std::vector<Image> deltas(state_.fitted.size());
    for (const size_t f : joined_) {
      const FittedMap& map = state_.fitted[f];
      deltas[f] = composed(map.field, x[f]);
      add_to_samples(evaluator_.taps_of(f), deltas[f], kNumValues,
                     values.data() + fit_slot(map.slot).first_value);
    }
    each_pixel([&](size_t, size_t first, size_t last) {
      apply_pixel(evaluator_.terms().subspan(first, last - first), values.data() + first * kNumValues);
    });
    Parameters out = zero();
    for (const size_t f : joined_) {
      const FittedMap& map = state_.fitted[f];
      Image texels(deltas[f].width, deltas[f].height, deltas[f].channels);
      gather_from_samples(evaluator_.taps_of(f), values.data() + fit_slot(map.slot).first_value, kNumValues,
                          texels);
      const float change = fit_slot(map.slot).prior.change;
      each_number(texels.pixels.size(), [&](size_t i) { texels.pixels[i] += change * deltas[f].pixels[i]; });
      out[f] = restrict_to_levels(map.field, std::move(texels));
      for (size_t level = 0; level < out[f].size(); ++level) {
        std::vector<float>& to = out[f][level].pixels;
        const std::vector<float>&curvature = detail_curvature_[f][level].pixels,
              &diagonal = diagonal_[f][level].pixels, &from = x[f][level].pixels;
        each_number(to.size(),
                    [&](size_t i) { to[i] += (curvature[i] + state_.damping * diagonal[i]) * from[i]; });
      }
    }
    return out;
  }

  /// `x` divided by the damped curvature's diagonal.
  Parameters preconditioned(const Parameters& x) const {
    Parameters out = x;
    for (const size_t f : joined_)
      for (size_t level = 0; level < out[f].size(); ++level) {
        std::vector<float>& to = out[f][level].pixels;
        const std::vector<float>& curvature = diagonal_[f][level].pixels;
        each_number(to.size(), [&](size_t i) {
          const float diagonal = (1.0f + state_.damping) * curvature[i];
          to[i] = diagonal > 0.0f ? to[i] / diagonal : 0.0f;
        });
      }
    return out;
  }

  double inner_product(const Parameters& a, const Parameters& b) const {
    double sum = 0;
    for (const size_t f : joined_)
      for (size_t level = 0; level < a[f].size(); ++level) sum += dot(a[f][level].pixels, b[f][level].pixels);
    return sum;
  }

  /// a = own · a + scale · b
  void combine(Parameters& a, float own, float scale, const Parameters& b) const {
    for (const size_t f : joined_)
      for (size_t level = 0; level < a[f].size(); ++level) {
        std::vector<float>& to = a[f][level].pixels;
        const std::vector<float>& from = b[f][level].pixels;
        each_number(to.size(), [&](size_t i) { to[i] = own * to[i] + scale * from[i]; });
      }
  }

 private:
  template <class Body>
  static void each(Parameters& parameters, const Body& body) {
    for (auto& levels : parameters)
      for (Image& level : levels) body(level.pixels);
  }
  // Calls body(pixel, first, last) with the range of the pixel's samples.
  template <class Body>
  void each_pixel(const Body& body) const {
    const std::span<const uint32_t> first = evaluator_.first_sample();
    parallel_for(0, static_cast<int64_t>(first.size()) - 1, 1024, [&](int64_t begin, int64_t end) {
      for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i)
        body(i, first[i], first[i + 1]);
    });
  }

  // values = Jᵀ J values, and the spring's share beyond bounds; of a pixel's samples.
  static void apply_pixel(std::span<const SampleTerms> samples, float* values) {
    vec3 along(0.0f);
    for (size_t s = 0; s < samples.size(); ++s)
      for (size_t c = 0; c < 3; ++c)
        for (size_t v = 0; v < kNumValues; ++v)
          along[static_cast<int>(c)] +=
              (&samples[s].derivative[c].base_color.x)[v] * values[s * kNumValues + v];
    for (size_t s = 0; s < samples.size(); ++s)
      for (size_t v = 0; v < kNumValues; ++v) {
        float& value = values[s * kNumValues + v];
        value = (&samples[s].beyond.base_color.x)[v] != 0.0f ? samples[s].weight * value : 0.0f;
        for (size_t c = 0; c < 3; ++c)
          value += (&samples[s].derivative[c].base_color.x)[v] * along[static_cast<int>(c)];
      }
  }

  // Diagonals: of the prior on detail, and of all curvature (near enough to precondition with).
  void set_curvatures() {
    detail_curvature_.resize(state_.fitted.size());
    diagonal_.resize(state_.fitted.size());
    values_.assign(evaluator_.terms().size() * kNumValues, 0.0f);
    std::vector<float>& values = values_;
    each_pixel([&](size_t, size_t first, size_t last) {
      for (size_t i = first; i < last; ++i) {
        const SampleTerms& terms = evaluator_.terms()[i];
        for (size_t v = 0; v < kNumValues; ++v) {
          float sum = (&terms.beyond.base_color.x)[v] != 0.0f ? terms.weight : 0.0f;
          for (size_t c = 0; c < 3; ++c) sum += square((&terms.derivative[c].base_color.x)[v]);
          values[i * kNumValues + v] = sum;
        }
      }
    });
    for (const size_t f : joined_) {
      const FittedMap& map = state_.fitted[f];
      const Prior& prior = fit_slot(map.slot).prior;
      Image texels = map.field.delta.texels;
      gather_from_samples(evaluator_.taps_of(f), values.data() + fit_slot(map.slot).first_value, kNumValues,
                          texels);
      for (float& value : texels.pixels) value += prior.change;
      diagonal_[f] = restrict_to_levels(map.field, std::move(texels));
      detail_curvature_[f] = map.field.levels;
      for (size_t level = 0; level < diagonal_[f].size(); ++level) {
        const float detail = level_cost(prior, level, diagonal_[f].size());
        for (size_t i = 0; i < diagonal_[f][level].pixels.size(); ++i) {
          float& curvature = detail_curvature_[f][level].pixels[i];
          curvature = detail / std::sqrt(1.0f + square(curvature / prior.knee));
          diagonal_[f][level].pixels[i] += curvature;
        }
      }
    }
  }

  const FitState& state_;
  const Evaluator& evaluator_;
  std::vector<size_t> joined_;
  Parameters detail_curvature_, diagonal_;  // [map][level]
  mutable std::vector<float> values_;       // [samples, kNumValues] of what is being multiplied
};

}  // namespace

double objective(const FitState& state, const Evaluator& evaluator) {
  double sum = 0;
  for (const vec3& residual : evaluator.residuals()) sum += 0.5 * glm::dot(residual, residual);
  for (const SampleTerms& terms : evaluator.terms()) {
    const float* beyond = &terms.beyond.base_color.x;
    for (size_t v = 0; v < kNumValues; ++v) sum += 0.5 * terms.weight * square(beyond[v]);
  }
  for (const FittedMap& map : state.fitted) {
    const Prior& prior = fit_slot(map.slot).prior;
    const std::vector<float>&delta = map.field.delta.texels.pixels, &guess = map.field.guess.pixels;
    for (size_t i = 0; i < delta.size(); ++i)
      sum += 0.5 * prior.change * square(guess.empty() ? delta[i] : delta[i] - guess[i]);
    const double knee2 = square(double{prior.knee});
    for (size_t level = 0; level < map.field.levels.size(); ++level) {
      const double detail = level_cost(prior, level, map.field.levels.size());
      for (const float value : map.field.levels[level].pixels)
        sum += detail * knee2 * (std::sqrt(1 + value * value / knee2) - 1);
    }
  }
  return sum;
}

Parameters solve_step(const FitState& state, const Evaluator& evaluator, int iterations) {
  const Problem problem(state, evaluator, iterations);
  Parameters x = problem.zero(), residual = problem.descent(), direction = problem.preconditioned(residual);
  double norm = problem.inner_product(residual, direction);
  const double first_norm = norm;
  for (int step = 0; step < kMaxInnerSteps && norm > square(kInnerTolerance) * first_norm; ++step) {
    const Parameters curved = problem.apply(direction);
    const auto length = static_cast<float>(norm / problem.inner_product(direction, curved));
    problem.combine(x, 1.0f, length, direction);
    problem.combine(residual, 1.0f, -length, curved);
    const Parameters scaled = problem.preconditioned(residual);
    const double next_norm = problem.inner_product(residual, scaled);
    problem.combine(direction, static_cast<float>(next_norm / norm), 1.0f, scaled);
    norm = next_norm;
  }
  return x;
}

}  // namespace patina::inverse
