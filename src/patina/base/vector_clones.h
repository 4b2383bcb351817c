// For functions whose loops the compiler turns into vector instructions: PATINA_VECTOR_CLONES in front of one
// compiles it for AVX-512 too, and the version is chosen when the program starts.
#pragma once

// A sanitiser is not ready that early.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define PATINA_VECTOR_CLONES __attribute__((target_clones("avx512f", "default")))
#else
#define PATINA_VECTOR_CLONES
#endif
