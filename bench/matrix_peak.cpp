#include "matrix_peak.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <ctime>

#include "patina/base/random.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace patina::bench {
namespace {

double seconds(clockid_t clock) {
  timespec now{};
  ::clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Best rate of `loop`, which does `flops` operations a call.
template <class Loop>
double best_gflops(double flops, const Loop& loop) {
  double best = 0;
  for (int run = 0; run < 12; ++run) {
    const double start = thread_seconds();
    loop();
    best = std::max(best, flops / (thread_seconds() - start) * 1e-9);
  }
  return best;
}

constexpr int kRounds = 1 << 20;
constexpr int kChains =
    12;  // enough independent sums to cover the latency of two units; an empty asm keeps them in registers

using Floats = float __attribute__((vector_size(16)));

[[maybe_unused]] void fma_128() {
  Floats sum[kChains] = {};
  Floats factor = {1.0f, 1.0f, 1.0f, 1.0f};
  for (int i = 0; i < kRounds; ++i)
    for (Floats& s : sum) {
      s = s * factor + factor;
#if defined(__x86_64__)
      __asm__ volatile("" : "+x"(s));
#endif
    }
}

#if defined(__x86_64__)
__attribute__((target("avx2,fma"))) void fma_256() {
  __m256 sum[kChains];
  for (__m256& s : sum) s = _mm256_setzero_ps();
  const __m256 factor = _mm256_set1_ps(1.0f);
  for (int i = 0; i < kRounds; ++i)
    for (__m256& s : sum) {
      s = _mm256_fmadd_ps(s, factor, factor);
      __asm__ volatile("" : "+x"(s));
    }
}

__attribute__((target("avx512f"))) void fma_512() {
  __m512 sum[kChains];
  for (__m512& s : sum) s = _mm512_setzero_ps();
  const __m512 factor = _mm512_set1_ps(1.0f);
  for (int i = 0; i < kRounds; ++i)
    for (__m512& s : sum) {
      s = _mm512_fmadd_ps(s, factor, factor);
      __asm__ volatile("" : "+v"(s));
    }
}

__attribute__((target("avx512f,avx512bf16"))) void dot_512() {
  __m512 sum[kChains];
  for (__m512& s : sum) s = _mm512_setzero_ps();
  const __m512bh factor = reinterpret_cast<__m512bh>(_mm512_set1_epi16(0x3f80));
  for (int i = 0; i < kRounds; ++i)
    for (__m512& s : sum) {
      s = _mm512_dpbf16_ps(s, factor, factor);
      __asm__ volatile("" : "+v"(s));
    }
}

/// The operand of LDTILECFG; a constant, since GCC 12 drops stores to a local that only LDTILECFG reads.
constexpr struct alignas(64) {
  uint8_t palette = 1, start_row = 0, reserved[14] = {};
  uint16_t row_bytes[16] = {64, 64, 64, 64, 64, 64, 64, 64};
  uint8_t rows[16] = {16, 16, 16, 16, 16, 16, 16, 16};
} kTileConfig;

__attribute__((target("amx-tile,amx-bf16"))) void tile_dot() {
  _tile_loadconfig(&kTileConfig);
  _tile_zero(0);
  _tile_zero(1);
  _tile_zero(2);
  _tile_zero(3);
  _tile_zero(4);
  _tile_zero(5);
  _tile_zero(6);
  _tile_zero(7);
  for (int i = 0; i < kRounds / 16; ++i) {
    _tile_dpbf16ps(0, 4, 6);
    _tile_dpbf16ps(1, 4, 7);
    _tile_dpbf16ps(2, 5, 6);
    _tile_dpbf16ps(3, 5, 7);
  }
  _tile_release();
}

/// tiles: 16 KiB.
__attribute__((target("amx-tile,amx-bf16"))) void tile_dot_loaded(const char* tiles) {
  _tile_loadconfig(&kTileConfig);
  for (int i = 0; i < kRounds / 16; ++i) {
    const char* at = tiles + i % 4 * 4096;
    _tile_loadd(4, at, 64);
    _tile_loadd(6, at + 1024, 64);
    _tile_dpbf16ps(0, 4, 6);
    _tile_loadd(7, at + 2048, 64);
    _tile_dpbf16ps(1, 4, 7);
    _tile_loadd(5, at + 3072, 64);
    _tile_dpbf16ps(2, 5, 6);
    _tile_dpbf16ps(3, 5, 7);
  }
  _tile_release();
}
#endif

}  // namespace

double loaded_tile_gflops() {
#if defined(__x86_64__)
  alignas(64) static uint16_t tiles[8192];
  for (size_t i = 0; i < 8192; i += 4) {
    const std::array<float, 4> values = gaussian4(2, RandomPurpose::kTest, i, 0);
    for (size_t e = 0; e < 4; ++e)
      tiles[i + e] = static_cast<uint16_t>(std::bit_cast<uint32_t>(values[e]) >> 16);
  }
  return best_gflops(kRounds / 16 * 4 * 2.0 * 16 * 16 * 32,
                     [] { tile_dot_loaded(reinterpret_cast<const char*>(tiles)); });
#else
  return 0;
#endif
}

double thread_seconds() {
  return seconds(CLOCK_THREAD_CPUTIME_ID);
}
double process_seconds() {
  return seconds(CLOCK_PROCESS_CPUTIME_ID);
}

double matrix_peak_gflops(attention::CpuIsa isa) {
  const double operations = static_cast<double>(kRounds) * kChains;  // multiply-add instructions a call
  switch (isa) {
#if defined(__x86_64__)
    case attention::CpuIsa::kAvx2:
      return best_gflops(operations * 2 * 8, fma_256);
    case attention::CpuIsa::kAvx512:
      return best_gflops(operations * 2 * 16, fma_512);
    case attention::CpuIsa::kAvx512Bf16:
      return best_gflops(operations * 2 * 32, dot_512);
    case attention::CpuIsa::kAmxBf16:
      return best_gflops(kRounds / 16 * 4 * 2.0 * 16 * 16 * 32, tile_dot);
#endif
    default:  // the compiler widens the generic kernel to what the build allows
#if defined(__AVX2__)
      return best_gflops(operations * 2 * 8, fma_256);
#else
      return best_gflops(operations * 2 * 4, fma_128);
#endif
  }
}

}  // namespace patina::bench
