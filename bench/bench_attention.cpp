// attention_cpu on every instruction set, dense and biased, against the core's own multiply-add peak measured
// in the same run. Prints a table and writes it to attention.json beside the program (or to the path given).
//
// Useful operations are 4 · queries · keys · head_dim (two products); the exponentials, padding and bias
// count nothing. Rates are per core: CPU seconds of the process, the best of some runs, so that other load on
// the machine disturbs little.
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <vector>

#include <nlohmann/json.hpp>

#include "matrix_peak.h"
#include "patina/attention/attention.h"
#include "patina/base/files.h"
#include "patina/base/math.h"
#include "patina/base/parallel.h"
#include "patina/base/random.h"

namespace {

using namespace patina;
using namespace patina::attention;

/// Buckets as views of a cylinder give them, at equal steps of azimuth: the object covers the middle 80 % of
/// each view, and a key lands in another view where its surface point faces it.
KeyBuckets cylinder_buckets(int grid, int view_size, int window_radius) {
  KeyBuckets buckets;
  buckets.grid = grid;
  buckets.view_width = buckets.view_height = view_size;
  buckets.window_radius = window_radius;
  const int views = grid * grid;
  std::vector<std::vector<int32_t>> cells(static_cast<size_t>(buckets.num_pixels()));
  for (int32_t key = 0; key < buckets.num_pixels(); ++key) {
    const int x = key % buckets.width(), y = key / buckets.width();
    const float u = (static_cast<float>(x % view_size) + 0.5f) / static_cast<float>(view_size) * 2 - 1;
    const float v = (static_cast<float>(y % view_size) + 0.5f) / static_cast<float>(view_size) * 2 - 1;
    if (std::abs(u) > 0.8f || std::abs(v) > 0.8f) continue;
    const int own = y / view_size * grid + x / view_size;
    for (int view = 0; view < views; ++view) {
      const float angle =
          std::asin(u / 0.8f) + 2 * kPi * static_cast<float>(own - view) / static_cast<float>(views);
      if (view == own || std::cos(angle) < 0.1f) continue;
      const int column = static_cast<int>((0.8f * std::sin(angle) + 1) / 2 * static_cast<float>(view_size));
      const int cell_x = view % grid * view_size + column, cell_y = view / grid * view_size + y % view_size;
      cells[static_cast<size_t>(cell_y) * static_cast<size_t>(buckets.width()) + static_cast<size_t>(cell_x)]
          .push_back(key);
    }
  }
  buckets.offsets.push_back(0);
  for (const std::vector<int32_t>& cell : cells) {
    buckets.keys.insert(buckets.keys.end(), cell.begin(), cell.end());
    buckets.offsets.push_back(static_cast<int32_t>(buckets.keys.size()));
  }
  return buckets;
}

/// Share of all pairs that are biased, from a sample of queries.
double biased_share(const KeyBuckets& buckets) {
  double count = 0;
  int samples = 0;
  for (int64_t query = 0; query < buckets.num_pixels(); query += 37, ++samples)
    count += static_cast<double>(biased_keys(buckets, query).size());
  return count / samples / static_cast<double>(buckets.num_pixels());
}

struct Case {
  CpuIsa isa;
  Element element;
  int64_t heads, head_dim;
  const KeyBuckets* buckets;
  int runs;
};

/// Best process CPU seconds of one call.
double measure(const Case& c, float beta) {
  const int64_t tokens = c.buckets->num_pixels();
  const size_t size = static_cast<size_t>(tokens * c.heads * c.head_dim);
  std::vector<std::vector<float>> f32(4, std::vector<float>(size));
  std::vector<std::vector<uint16_t>> bf16(4, std::vector<uint16_t>(size));
  for (uint32_t tensor = 0; tensor < 3; ++tensor)
    for (size_t i = 0; i + 4 <= size; i += 4) {
      const std::array<float, 4> values = gaussian4(1, RandomPurpose::kTest, i, tensor);
      for (size_t e = 0; e < 4; ++e) {
        f32[tensor][i + e] = values[e];
        bf16[tensor][i + e] = static_cast<uint16_t>(std::bit_cast<uint32_t>(values[e]) >> 16);
      }
    }
  const auto data = [&](size_t tensor) -> void* {
    return c.element == Element::kF32 ? static_cast<void*>(f32[tensor].data()) : bf16[tensor].data();
  };
  Arguments arguments;
  arguments.shape = {1, tokens, tokens, c.heads, c.head_dim};
  arguments.element = c.element;
  arguments.q = data(0);
  arguments.k = data(1);
  arguments.v = data(2);
  arguments.out = data(3);
  arguments.q_strides = arguments.k_strides = arguments.v_strides =
      arguments.out_strides = {tokens * c.heads * c.head_dim, c.heads * c.head_dim, c.head_dim};
  arguments.scale = 1 / std::sqrt(static_cast<float>(c.head_dim));
  arguments.buckets = beta != 0 ? c.buckets : nullptr;
  arguments.beta = beta;
  double best = 1e30;
  for (int run = 0; run < c.runs; ++run) {
    const double start = bench::process_seconds();
    attention_cpu(arguments, c.isa);
    best = std::min(best, bench::process_seconds() - start);
  }
  return best;
}

}  // namespace

int main(int argc, char** argv) {
  const std::filesystem::path report =
      argc > 1 ? std::filesystem::path(argv[1])
               : std::filesystem::path(argv[0]).parent_path() / "bench" / "attention.json";
  set_num_threads(1);
  const KeyBuckets four_views = cylinder_buckets(4, 16, 2), nine_views = cylinder_buckets(3, 64, 4);

  std::vector<Case> cases;
  for (const Element element : {Element::kF32, Element::kBf16}) {
    for (const CpuIsa isa : supported_isas(element))
      for (const int64_t head_dim : {40, 80, 160})
        cases.push_back({isa, element, 2, head_dim, &four_views, isa == CpuIsa::kGeneric ? 2 : 5});
    cases.push_back({supported_isas(element).back(), element, 1, 40, &nine_views, 2});
  }

  std::printf("%-12s %-5s %6s %4s %9s %9s %6s %9s %7s\n", "kernel", "type", "tokens", "dim", "GFLOP/s",
              "peak", "share", "biased", "ratio");
  nlohmann::json rows = nlohmann::json::array();
  for (const Case& c : cases) {
    const double tokens = static_cast<double>(c.buckets->num_pixels());
    const double operations = 4 * tokens * tokens * static_cast<double>(c.head_dim * c.heads) * 1e-9;
    const double peak = bench::matrix_peak_gflops(c.isa);
    const double dense = measure(c, 0), biased = measure(c, 1.8f);
    std::printf("%-12s %-5s %6.0f %4d %9.1f %9.1f %6.3f %9.1f %7.3f\n", name_of(c.isa),
                c.element == Element::kF32 ? "f32" : "bf16", tokens, static_cast<int>(c.head_dim),
                operations / dense, peak, operations / dense / peak, operations / biased, biased / dense);
    std::fflush(stdout);
    rows.push_back({{"isa", name_of(c.isa)},
                    {"element", c.element == Element::kF32 ? "f32" : "bf16"},
                    {"tokens", c.buckets->num_pixels()},
                    {"heads", c.heads},
                    {"head_dim", c.head_dim},
                    {"biased_share", biased_share(*c.buckets)},
                    {"dense_seconds", dense},
                    {"biased_seconds", biased},
                    {"dense_gflops", operations / dense},
                    {"biased_gflops", operations / biased},
                    {"peak_gflops", peak},
                    {"share_of_peak", operations / dense / peak},
                    {"biased_over_dense", biased / dense}});
  }
  write_file(
      report,
      nlohmann::json{{"unit", "GFLOP/s of one core by CPU time, 4 * queries * keys * head_dim operations"},
                     {"cases", rows}}
          .dump(1));
  std::printf("wrote %s\n", report.c_str());
}
