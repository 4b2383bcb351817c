// Which CPU kernel runs: the one dispatch function, asked once a call.
#include <algorithm>
#include <string>

#include "patina/attention/attention.h"
#include "patina/attention/cpu/kernel.h"
#include "patina/base/error.h"

#if defined(PATINA_X86_KERNELS) && defined(__linux__)
#include <sys/syscall.h>
#include <unistd.h>
#endif

namespace patina::attention {
namespace {

#ifdef PATINA_X86_KERNELS
/// Linux gives AMX's 8 KiB of tile registers only to processes that request them.
bool amx_permitted() {
#ifdef __linux__
  static const bool permitted = [] {
    constexpr long kRequestPermission = 0x1023, kTileData = 18;  // ARCH_REQ_XCOMP_PERM, XFEATURE_XTILEDATA
    return ::syscall(SYS_arch_prctl, kRequestPermission, kTileData) == 0;
  }();
  return permitted;
#else
  return false;
#endif
}

bool has_avx512() {
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
         __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
}

/// CPUID leaf 7, EDX: AMX-BF16 is bit 22, AMX-TILE bit 24. (GCC 12 has no name for them.)
bool has_amx_bf16() {
  unsigned a = 7, b = 0, c = 0, d = 0;
  __asm__ volatile("cpuid" : "+a"(a), "=b"(b), "+c"(c), "=d"(d));
  return (d >> 22 & 1) && (d >> 24 & 1) && amx_permitted();
}
#endif

bool runs_here(CpuIsa isa) {
#ifdef PATINA_X86_KERNELS
  switch (isa) {
    case CpuIsa::kGeneric:
      return true;
    case CpuIsa::kAvx2:
      return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
    case CpuIsa::kAvx512:
      return has_avx512();
    case CpuIsa::kAvx512Bf16:
      return has_avx512() && __builtin_cpu_supports("avx512bf16");
    case CpuIsa::kAmxBf16:
      return has_avx512() && __builtin_cpu_supports("avx512bf16") && __builtin_cpu_supports("avx512vbmi") &&
             has_amx_bf16();
  }
#endif
  return isa == CpuIsa::kGeneric;
}

Kernel kernel_of(CpuIsa isa) {
  switch (isa) {
#ifdef PATINA_X86_KERNELS
    case CpuIsa::kAvx2:
      return avx2_kernel();
    case CpuIsa::kAvx512:
      return avx512_kernel();
    case CpuIsa::kAvx512Bf16:
      return avx512_bf16_kernel();
    case CpuIsa::kAmxBf16:
      return amx_bf16_kernel();
#endif
    default:
      return generic_kernel();
  }
}

}  // namespace

const char* name_of(CpuIsa isa) {
  switch (isa) {
    case CpuIsa::kGeneric:
      return "generic";
    case CpuIsa::kAvx2:
      return "avx2";
    case CpuIsa::kAvx512:
      return "avx512";
    case CpuIsa::kAvx512Bf16:
      return "avx512-bf16";
    case CpuIsa::kAmxBf16:
      return "amx-bf16";
  }
  return "unknown";
}

std::vector<CpuIsa> supported_isas(Element element) {
  std::vector<CpuIsa> isas;
  for (const CpuIsa isa :
       {CpuIsa::kGeneric, CpuIsa::kAvx2, CpuIsa::kAvx512, CpuIsa::kAvx512Bf16, CpuIsa::kAmxBf16}) {
    const bool bf16_only = isa == CpuIsa::kAvx512Bf16 || isa == CpuIsa::kAmxBf16;
    if ((element == Element::kBf16 || !bf16_only) && runs_here(isa)) isas.push_back(isa);
  }
  return isas;
}

void attention_cpu(const Arguments& arguments, CpuIsa isa) {
  validate(arguments);
  const std::vector<CpuIsa> isas = supported_isas(arguments.element);
  if (std::find(isas.begin(), isas.end(), isa) == isas.end())
    throw Error(ErrorCode::kDevice, "attention",
                std::string("this processor does not run ") + name_of(isa) + " for this element type");
  run_blocks(arguments, kernel_of(isa));
}

void attention_cpu(const Arguments& arguments) {
  attention_cpu(arguments, supported_isas(arguments.element).back());
}

}  // namespace patina::attention
