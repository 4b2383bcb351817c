// What stands between the matrix products of a network: norms, activations, gates. Each is one pass over
// memory (two for norms over an image), in f32 inside, for f32 and bf16 numbers. No Torch here.
#pragma once

#include <cstdint>

namespace patina::nn {

/// The upper half of a float.
struct Bf16 {
  uint16_t bits;
};

enum class Activation { kNone, kSilu };

struct NormWeights {
  const float* gain;  // [channels]
  const float* bias;  // [channels]
  float epsilon;
};

/// GroupNorm [Wu2018] over x [batch, pixels, channels] (channels-last images), then the activation, to y of
/// the same layout; y may be x. `groups` divides `channels`. T is float or Bf16.
template <class T>
void group_norm(const T* x, T* y, int64_t batch, int64_t pixels, int64_t channels, int64_t groups,
                const NormWeights& weights, Activation activation);

/// LayerNorm [Ba2016] of each of `rows` rows of x [rows, channels] to y.
template <class T>
void layer_norm(const T* x, T* y, int64_t rows, int64_t channels, const NormWeights& weights);

/// GEGLU [Shazeer2020]: x [rows, 2·channels] -> y [rows, channels], the first half times GELU of the second.
/// GELU by the error function to 1.5e-7 [Abramowitz1964, 7.1.26].
template <class T>
void geglu(const T* x, T* y, int64_t rows, int64_t channels);

}  // namespace patina::nn
