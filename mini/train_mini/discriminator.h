// Tells true pictures from decoded ones by their grain, patch by patch [Isola2017], to train a decoder
// against.
#pragma once

#include <vector>

#include <ATen/core/Tensor.h>

#include "patina/nn/layers.h"

namespace patina::train_mini {

/// Strided convolutions over what a picture has finer than about eight pixels, 0.3 M weights. Coarser colours
/// are hidden from it: a decoder that must keep them cannot answer for them.
class Discriminator {
 public:
  explicit Discriminator(nn::WeightReader& weights);

  struct Judgement {
    at::Tensor scores;                 // [B,1,H/8,W/8], above zero: true; each sees 54 × 54 pixels
    std::vector<at::Tensor> features;  // of the hidden layers
  };
  /// grain [B,3,H,W], as grain_of() makes it.
  Judgement operator()(const at::Tensor& grain) const;

 private:
  std::vector<nn::Conv2d> hidden_;
  nn::Conv2d last_;
};

/// pictures [B,3,H,W] in [-1,1] less their means over 9 × 9 pixels, times 4.
at::Tensor grain_of(const at::Tensor& pictures);

/// R1: the square of the slope of the scores' sum at true grain, a score [Mescheder2018]; a scalar with
/// gradients.
at::Tensor slope_penalty(const Discriminator& discriminator, const at::Tensor& grain);

}  // namespace patina::train_mini
