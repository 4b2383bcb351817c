// The attention of a U-Net over nine views of 512² of a real asset, dense and biased; beside the processor's
// own peak and LibTorch's attention on the same tensors, all in one run. Prints tables and writes
// attention.json.
//   bench_attention [OUT.json [ASSET]]      default: bench/attention.json beside the program,
//   examples/kettle.glb
//
// Useful operations are 4 · queries · keys · head_dim (two products); exponentials, padding and bias count
// nothing. Rates of kernels are of one core: CPU seconds of the process, the best of some runs. The
// comparison with LibTorch is wall clock on all cores.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <vector>

#include <nlohmann/json.hpp>

#include "console/program.h"
#include "libtorch_attention.h"
#include "matrix_peak.h"
#include "patina/asset/material_maps.h"
#include "patina/attention/attention.h"
#include "patina/base/files.h"
#include "patina/base/parallel.h"
#include "patina/base/random.h"
#include "patina/correspond/correspondences.h"
#include "patina/views/view_set.h"

namespace {

using namespace patina;
using namespace patina::attention;

constexpr float kBeta = 1.2f;  // time does not depend on it

std::vector<KeyBuckets> buckets_of(const std::filesystem::path& path) {
  const asset::Asset asset = asset::read_asset(path);
  const render::Scene scene(asset, asset::resolve_materials(asset), render::constant_environment(vec3(1.0f)));
  return correspond::bias_levels(scene, views::orbit_cameras(asset::bounds(asset), {}));
}

/// Share of all pairs that are biased, from a sample of queries.
double biased_share(const KeyBuckets& buckets) {
  double count = 0;
  int samples = 0;
  for (int64_t query = 0; query < buckets.num_pixels(); query += 37, ++samples)
    count += static_cast<double>(biased_keys(buckets, query).size());
  return count / samples / static_cast<double>(buckets.num_pixels());
}

/// Gaussian q, k, v and room for the output, [heads, tokens, head_dim] in both element types.
struct Tensors {
  int64_t heads, tokens, head_dim;
  std::vector<float> f32[4];
  std::vector<uint16_t> bf16[4];

  Tensors(int64_t num_heads, int64_t num_tokens, int64_t dim)
      : heads(num_heads), tokens(num_tokens), head_dim(dim) {
    const size_t size = static_cast<size_t>(heads * tokens * head_dim);
    for (uint32_t tensor = 0; tensor < 4; ++tensor) {
      f32[tensor].resize(size);
      bf16[tensor].resize(size);
      for (size_t i = 0; tensor < 3 && i + 4 <= size; i += 4) {
        const std::array<float, 4> values = gaussian4(1, RandomPurpose::kTest, i, tensor);
        for (size_t e = 0; e < 4; ++e) {
          f32[tensor][i + e] = values[e];
          bf16[tensor][i + e] = static_cast<uint16_t>(std::bit_cast<uint32_t>(values[e]) >> 16);
        }
      }
    }
  }
  Arguments arguments(Element element, const KeyBuckets* buckets) {
    const auto data = [&](int tensor) -> void* {
      return element == Element::kF32 ? static_cast<void*>(f32[tensor].data()) : bf16[tensor].data();
    };
    Arguments a;
    a.shape = {1, tokens, tokens, heads, head_dim};
    a.element = element;
    a.q = data(0);
    a.k = data(1);
    a.v = data(2);
    a.out = data(3);
    a.q_strides = a.k_strides = a.v_strides =
        a.out_strides = {heads * tokens * head_dim, head_dim, tokens * head_dim};
    a.scale = 1 / std::sqrt(static_cast<float>(head_dim));
    a.buckets = buckets;
    a.beta = buckets ? kBeta : 0;
    return a;
  }
  double operations() const { return 4e-9 * static_cast<double>(tokens * tokens * head_dim * heads); }
};

struct Times {
  double dense = std::numeric_limits<double>::infinity(), biased = dense;
};

/// Best CPU seconds, dense and biased runs in turn so that both see the same machine.
Times measure(Tensors& tensors, Element element, CpuIsa isa, const KeyBuckets& buckets, int runs) {
  Times best;
  for (int run = 0; run < runs; ++run) {
    double start = bench::process_seconds();
    attention_cpu(tensors.arguments(element, nullptr), isa);
    best.dense = std::min(best.dense, bench::process_seconds() - start);
    start = bench::process_seconds();
    attention_cpu(tensors.arguments(element, &buckets), isa);
    best.biased = std::min(best.biased, bench::process_seconds() - start);
  }
  return best;
}

double wall_seconds(Tensors& tensors, int runs) {
  double best = std::numeric_limits<double>::infinity();
  for (int run = 0; run < runs; ++run) {
    const auto start = std::chrono::steady_clock::now();
    attention_cpu(tensors.arguments(Element::kBf16, nullptr));
    best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  return best;
}

const char* name_of(Element element) {
  return element == Element::kF32 ? "f32" : "bf16";
}

// The processor's own peak, and what LibTorch reaches of it.
nlohmann::json measure_peak() {
  nlohmann::json json;
  const CpuIsa best_isa = supported_isas(Element::kBf16).back();
  const double peak = bench::matrix_peak_gflops(best_isa);
  json["matrix_peak_gflops"] = peak;
  json["matrix_peak_of"] = name_of(best_isa);
  if (best_isa == CpuIsa::kAmxBf16) json["loaded_tile_gflops"] = bench::loaded_tile_gflops();
  json["libtorch_matmul_gflops"] = bench::libtorch_matmul_gflops(2048, 1);
  std::printf("one core: %.0f GFLOP/s peak of %s", peak, name_of(best_isa));
  if (json.contains("loaded_tile_gflops"))
    std::printf(", %.0f with Gaussian operands from the first cache",
                json["loaded_tile_gflops"].get<double>());
  std::printf("; LibTorch's 2048³ bf16 product %.0f\n\n", json["libtorch_matmul_gflops"].get<double>());
  return json;
}

// Kernels on one core. Adds to `json`.
void measure_kernels(const std::vector<KeyBuckets>& levels, nlohmann::json& json) {
  // The U-Net's own sizes: levels 1 to 3 of Stable Diffusion 1.5.
  std::printf("%-12s %-5s %6s %4s %5s %9s %6s %9s %7s\n", "kernel", "type", "tokens", "dim", "heads",
              "GFLOP/s", "share", "biased", "ratio");
  const struct {
    size_t level;
    int64_t head_dim, heads;
  } sizes[] = {{0, 40, 1}, {1, 80, 4}, {2, 160, 8}};
  double dense_total = 0, biased_total = 0;
  for (const Element element : {Element::kBf16, Element::kF32})
    for (const CpuIsa isa : supported_isas(element)) {
      const double isa_peak = bench::matrix_peak_gflops(isa);
      const bool is_best = isa == supported_isas(element).back();
      for (const auto& size : sizes) {
        const KeyBuckets& buckets = levels[size.level];
        if (!is_best && size.level == 0) continue;  // minutes, and the second level shows the same
        Tensors tensors(is_best ? size.heads : 1, buckets.num_pixels(), size.head_dim);
        const Times times = measure(tensors, element, isa, buckets, is_best ? 5 : 2);
        const double rate = tensors.operations() / times.dense, share = rate / isa_peak;
        std::printf("%-12s %-5s %6lld %4lld %5lld %9.1f %6.3f %9.1f %7.3f\n", name_of(isa), name_of(element),
                    static_cast<long long>(tensors.tokens), static_cast<long long>(size.head_dim),
                    static_cast<long long>(tensors.heads), rate, share, tensors.operations() / times.biased,
                    times.biased / times.dense);
        std::fflush(stdout);
        json["kernels"].push_back({{"isa", name_of(isa)},
                                   {"element", name_of(element)},
                                   {"tokens", tensors.tokens},
                                   {"heads", tensors.heads},
                                   {"head_dim", size.head_dim},
                                   {"biased_share", biased_share(buckets)},
                                   {"dense_gflops", rate},
                                   {"biased_gflops", tensors.operations() / times.biased},
                                   {"peak_gflops", isa_peak},
                                   {"share_of_peak", share},
                                   {"biased_over_dense", times.biased / times.dense}});
        if (element != Element::kBf16 || !is_best) continue;
        const std::string dim = std::to_string(size.head_dim);
        json["dense_fraction_of_peak"][dim] = share;
        json["biased_over_dense_by_head_dim"][dim] = times.biased / times.dense;
        // All eight heads of a level.
        dense_total += times.dense * 8 / static_cast<double>(size.heads);
        biased_total += times.biased * 8 / static_cast<double>(size.heads);
      }
    }
  json["biased_over_dense"] = biased_total / dense_total;
  std::printf("biased over dense, all three levels: %.3f\n\n", biased_total / dense_total);
}

// All cores against LibTorch's attention. Adds to `json`.
void compare_with_libtorch(int threads, nlohmann::json& json) {
  std::printf("%6s %4s %5s %9s %9s %7s  LibTorch's fastest\n", "tokens", "dim", "heads", "ours s", "LibTorch",
              "ratio");
  double smallest = std::numeric_limits<double>::infinity();
  for (const auto& [tokens, head_dim, heads] :
       {std::array<int64_t, 3>{4096, 40, 8}, {4096, 80, 8}, {4096, 160, 8}, {36864, 40, 1}}) {
    Tensors tensors(heads, tokens, head_dim);
    const double ours = wall_seconds(tensors, 12);
    const bench::PeerAttention peer =
        bench::libtorch_attention(tensors.bf16[0], tensors.bf16[1], tensors.bf16[2], tensors.bf16[3], heads,
                                  tokens, head_dim, threads, 3);
    std::printf("%6lld %4lld %5lld %9.4f %9.4f %7.2f  %s; outputs differ by %.1g\n",
                static_cast<long long>(tokens), static_cast<long long>(head_dim),
                static_cast<long long>(heads), ours, peer.seconds, peer.seconds / ours, peer.way.c_str(),
                peer.worst_difference);
    std::fflush(stdout);
    smallest = std::min(smallest, peer.seconds / ours);
    json["libtorch"].push_back({{"tokens", tokens},
                                {"head_dim", head_dim},
                                {"heads", heads},
                                {"ours_seconds", ours},
                                {"libtorch_seconds", peer.seconds},
                                {"libtorch_way", peer.way},
                                {"outputs_differ_by", peer.worst_difference},
                                {"speedup", peer.seconds / ours}});
  }
  json["speedup_over_libtorch"] = smallest;
  json["libtorch_version"] = bench::libtorch_version();
}

void run(const std::filesystem::path& report, const std::filesystem::path& asset) {
  const int threads = num_threads();
  std::printf("%s from nine views of 512²; %d threads; LibTorch %s\n", asset.c_str(), threads,
              bench::libtorch_version().c_str());
  const std::vector<KeyBuckets> levels = buckets_of(asset);
  nlohmann::json json = measure_peak();
  set_num_threads(1);
  measure_kernels(levels, json);
  set_num_threads(threads);
  compare_with_libtorch(threads, json);
  json["threads"] = threads;
  json["asset"] = asset.filename().string();
  write_file(report, json.dump(1));
  std::printf("wrote %s\n", report.c_str());
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App program("The attention of a U-Net over nine views of a real asset, dense and biased.",
                   "bench_attention");
  std::filesystem::path report = std::filesystem::path(argv[0]).parent_path() / "bench" / "attention.json",
                        asset = "examples/kettle.glb";
  program.add_option("OUT.json", report, "JSON to write")->capture_default_str();
  program.add_option("ASSET", asset, "Whose views give the bias")->capture_default_str();
  return tools::run_program(program, argc, argv, [&] { run(report, asset); });
}
