// The network behind the material prior, as tensors: for MaterialPrior and for its trainer.
//
//   inputs ─ pairs of pixels become channels ─ conv_in ─ block ──────────────────── + ─ block ─ norm_out,
//   conv_out ─ pixels
//                                                          └ down ─ block ──── + ─ block ─ up ┘
//                                                                     └ down … up ┘
//
// A U-Net whose finest level works at half of the picture's size. Its output is added to a first guess made
// without any learning: the clean maps, and for the base colour what the clean render's light makes of the
// edited colour.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include <ATen/core/Tensor.h>

#include "patina/nn/layers.h"

namespace patina::prior {

struct MaterialConfig {
  std::vector<int64_t> channels{32, 64, 128, 192};  // of the levels, from half of the picture's size downward
  int64_t norm_groups = 8;

  /// Sides of a picture must be multiples of this.
  int64_t multiple() const { return int64_t{1} << channels.size(); }
};
/// Throws Error{kNotFound, kFormat} that names the file and the entry.
MaterialConfig read_material_config(const std::filesystem::path& file);
inline constexpr const char* kMaterialConfigFile = "config.json";
inline constexpr const char* kMaterialWeightFile = "material.safetensors";

/// All f32; H and W multiples of MaterialConfig::multiple(). Colours are sRGB [0,1].
struct MaterialInputs {
  at::Tensor edited, render, normal, base_color;  // [B,3,H,W]; normals as in MaterialView
  at::Tensor roughness, metallic, mask;           // [B,1,H,W]; mask 1 on the object, 0 elsewhere
};

struct MaterialOutputs {
  at::Tensor base_color;      // [B,3,H,W] sRGB, not clamped
  at::Tensor roughness;       // [B,1,H,W] not clamped
  at::Tensor metallic_logit;  // [B,1,H,W]
  at::Tensor slope;           // [B,2,H,W]
  at::Tensor base_color_error, roughness_error,
      slope_error;  // [B,1,H,W] scales of Laplace distributions, > 0
};

/// The base colour [B,3,H,W] sRGB [0,1] that would turn the clean render into the edited view if light fell
/// alike and nothing were reflected but by base colour: clean base colour × edited light / clean light. Right
/// for matt surfaces whose relief does not change.
at::Tensor divided_base_color(const MaterialInputs& inputs);

/// Unit normals [B,3,H,W] bent by slopes [B,2,H,W] (see bent_normal), and the slopes that bend `normal` to
/// `bent`, each at most kMaxSlope either way.
inline constexpr double kMaxSlope = 3;
at::Tensor bent_normals(const at::Tensor& normal, const at::Tensor& slope);
at::Tensor slopes_between(const at::Tensor& normal, const at::Tensor& bent);

/// [B,C,H,W] → the same shape.
struct MaterialBlock {
  nn::GroupNorm norm1;
  nn::Conv2d conv1;
  nn::GroupNorm norm2;
  nn::Conv2d conv2;

  at::Tensor operator()(const at::Tensor& x) const;
};

class MaterialNetwork {
 public:
  MaterialNetwork(const MaterialConfig& config, nn::WeightReader& weights);
  MaterialOutputs operator()(const MaterialInputs& inputs) const;

 private:
  struct Level {
    MaterialBlock down, up;
    // To the next coarser level and back; none at the coarsest.
    std::optional<nn::Conv2d> downsample, upsample;
  };

  MaterialConfig config_;
  nn::Conv2d conv_in_, conv_out_;
  std::vector<Level> levels_;
  nn::GroupNorm norm_out_;
};

}  // namespace patina::prior
