// Batches for the denoiser: latents, condition images and token ids of crops, views or grids of views.
#pragma once

#include <filesystem>
#include <random>
#include <vector>

#include <ATen/core/Tensor.h>

#include "patina/diffusion/text/tokenizer.h"
#include "samples.h"

namespace patina::train_mini {

enum class Cut {
  kCrop,  // a square of half a view's side
  kView,
  kGrid,  // 2 × 2 views of one object
};

struct DenoiserBatch {
  at::Tensor latents;       // [B,C,h,w] f32 of the target, unit variance
  at::Tensor tile, normal;  // [B,3,8h,8w] f32 [0,1]
  at::Tensor ids;           // [B,T]
};

class DenoiserData {
 public:
  /// `folder` is WORK/training or WORK/held_out. Throws Error.
  DenoiserData(const std::filesystem::path& folder, const std::filesystem::path& model);

  int64_t size() const { return samples_.size(); }  // views

  /// `vary` false: captions as they are and no mirroring, for measuring.
  DenoiserBatch draw(Cut cut, int64_t count, std::mt19937_64& random, bool vary) const;

 private:
  SampleFolder samples_;
  MappedFile latents_;
  diffusion::Tokenizer tokenizer_;
  int64_t channels_ = 0, latent_side_ = 0;
  double scaling_factor_ = 1;
  std::vector<int64_t> groups_;  // the first sample of each group of four views
};

}  // namespace patina::train_mini
