// What the model's autoencoder loses: held-out renders encoded and decoded again.
#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include <nlohmann/json.hpp>

#include "patina/diffusion/edit.h"
#include "patina/image/image.h"

namespace patina::bench {

/// The mean of the encoder's posterior, decoded; [H,W,3] sRGB in [0,1], as the pipeline uses the autoencoder.
Image vae_round_trip(const diffusion::Model& model, const Image& srgb);

/// `after` as an edited view shows it: the same, with the fine detail of `before` that the detail stage gives
/// back by default.
Image as_edited_view(const diffusion::Model& model, const Image& before, const Image& after);

struct MaskedPicture {
  Image srgb;      // [H,W,3]
  Image coverage;  // [H,W,1], the object
};

/// Energy of the two finest octaves within the object (mini_data::fine_energy), a window's mean. `windows` of
/// 4 × 4 pixels were counted.
struct ObjectEnergy {
  double finest = 0, both = 0;
  int64_t windows = 0;
};
ObjectEnergy object_energy(const Image& srgb, const Image& coverage);

/// Mean over pictures of the PSNR, of whole pictures and of the object's pixels; energy of the finest octaves
/// of all pictures over that of the true ones; leaves a sheet (a picture,
/// what came back, their difference × 4) at `sheet`.
nlohmann::json measure_vae(const diffusion::Model& model, std::span<const MaskedPicture> pictures,
                           const std::filesystem::path& sheet);

}  // namespace patina::bench
