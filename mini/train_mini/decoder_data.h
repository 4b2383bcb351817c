// What a decoder is finished on: latents as the encoder and as the denoiser make them, beside true pictures.
#pragma once

#include <cstdint>
#include <filesystem>
#include <random>

#include <ATen/core/Tensor.h>

#include "patina/base/files.h"
#include "patina/diffusion/files/config.h"
#include "samples.h"

namespace patina::train_mini {

/// WORK/training/decoder.f16, one record a sample: latents of the aged picture, latents of the same picture
/// edited by MODEL as `patina enhance` edits (from the aged picture with noise, by its caption, under both
/// ControlNets and guidance, a strength of 0.4 to 1), and what MODEL's decoder makes of these, averaged over
/// latent pixels. Goes on where an earlier call stopped; `count` samples at most. Throws Error.
void make_decoder_data(const std::filesystem::path& work, const std::filesystem::path& model, int64_t count,
                       uint64_t seed);

struct DecoderBatch {
  at::Tensor encoded, denoised;  // [B,C,h,w] f32, unscaled
  at::Tensor pictures;           // [B,3,8h,8w] f32 in [-1,1], true
  at::Tensor colours;            // [B,3,h,w] f32 in [-1,1], of the denoised latents by the decoder as it was
};

class DecoderData {
 public:
  /// Throws Error{kFormat, kNotFound} where `work` lacks decoder.f16.
  DecoderData(const std::filesystem::path& work, const diffusion::VaeConfig& vae);

  int64_t size() const { return size_; }
  /// Crops of `side` pixels of which the object fills a quarter at least, where three tries find one.
  DecoderBatch draw(int64_t count, int64_t side, std::mt19937_64& random) const;

 private:
  SampleFolder samples_;
  MappedFile records_;
  int64_t channels_, scale_, side_, size_;
};

/// Where a sample shows its object: [1,H,W] of 0 and 1, by the normals, which are black elsewhere.
at::Tensor object_of(const at::Tensor& pictures);

}  // namespace patina::train_mini
