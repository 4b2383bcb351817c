#include "denoiser_data.h"

#include <ATen/ATen.h>

#include "captions.h"
#include "patina/base/error.h"
#include "patina/diffusion/files/config.h"

namespace patina::train_mini {
namespace {

using mini_data::kViewSide;

constexpr int64_t kGroupViews = 4;

}  // namespace

DenoiserData::DenoiserData(const std::filesystem::path& folder, const std::filesystem::path& model)
    : samples_(folder), latents_(folder / "latents.f16"), tokenizer_(model / "tokenizer") {
  const diffusion::VaeConfig vae = diffusion::read_vae_config(model / "vae");
  channels_ = vae.latent_channels;
  latent_side_ = kViewSide / vae.latent_scale();
  scaling_factor_ = vae.scaling_factor;
  const int64_t record = 2 * channels_ * latent_side_ * latent_side_ * static_cast<int64_t>(sizeof(at::Half));
  const auto stored = static_cast<int64_t>(latents_.bytes().size()) / record;
  if (stored < samples_.size()) {
    throw Error(ErrorCode::kFormat, (folder / "latents.f16").string(),
                "holds latents of " + std::to_string(stored) + " samples of " +
                    std::to_string(samples_.size()) + "; make them anew with: train_mini latents");
  }
  for (int64_t i = 0; i < samples_.size(); ++i) {
    const Sample& sample = samples_.samples()[static_cast<size_t>(i)];
    if (sample.group_views == kGroupViews && sample.view == 0 && i + kGroupViews <= samples_.size())
      groups_.push_back(i);
  }
}

DenoiserBatch DenoiserData::draw(Cut cut, int64_t count, std::mt19937_64& random, bool vary) const {
  const auto below = [&](int64_t end) { return static_cast<int64_t>(random() % static_cast<uint64_t>(end)); };
  const int64_t scale = kViewSide / latent_side_;
  std::vector<at::Tensor> latents, tiles, normals;
  std::vector<int64_t> ids;
  for (int64_t i = 0; i < count; ++i) {
    const bool grid = cut == Cut::kGrid;
    const int64_t first = grid ? groups_[static_cast<size_t>(below(static_cast<int64_t>(groups_.size())))]
                               : below(samples_.size());
    const bool mirrored = vary && below(2);
    const int64_t side = cut == Cut::kCrop ? latent_side_ / 2 : latent_side_;
    const int64_t y = cut == Cut::kCrop ? below(latent_side_ - side + 1) : 0,
                  x = cut == Cut::kCrop ? below(latent_side_ - side + 1) : 0;
    std::vector<at::Tensor> view_latents, view_tiles, view_normals;
    // The views of a grid in the product's order begin anywhere on the orbit.
    const int64_t turn = grid ? below(kGroupViews) : 0;
    for (int64_t k = 0; k < (grid ? kGroupViews : 1); ++k) {
      const int64_t index = first + (k + turn) % (grid ? kGroupViews : 1);
      const int64_t plane = channels_ * latent_side_ * latent_side_;
      auto* data = const_cast<uint8_t*>(latents_.bytes().data()) +
                   plane * static_cast<int64_t>(sizeof(at::Half)) * (2 * index + (mirrored ? 1 : 0));
      view_latents.push_back(at::from_blob(data, {channels_, latent_side_, latent_side_}, at::kHalf)
                                 .slice(1, y, y + side)
                                 .slice(2, x, x + side)
                                 .to(at::kFloat) *
                             scaling_factor_);
      // A mirrored crop lies on the other side of the stored picture.
      const int64_t left = scale * (mirrored ? latent_side_ - x - side : x);
      at::Tensor pictures = samples_.pictures(index)
                                .slice(0, kTile, kNormal + 1)
                                .slice(2, scale * y, scale * (y + side))
                                .slice(3, left, left + scale * side)
                                .to(at::kFloat) /
                            255.0;
      if (mirrored) {
        pictures = pictures.flip({3});
        pictures[kNormal][0] = 1 - pictures[kNormal][0];  // x of the normals turns round
      }
      view_tiles.push_back(pictures[kTile]);
      view_normals.push_back(pictures[kNormal]);
    }
    const auto tiled = [&](const std::vector<at::Tensor>& v) {
      return grid ? at::cat({at::cat({v[0], v[1]}, 2), at::cat({v[2], v[3]}, 2)}, 1) : v[0];
    };
    latents.push_back(tiled(view_latents));
    tiles.push_back(tiled(view_tiles));
    normals.push_back(tiled(view_normals));
    const std::string& caption = samples_.samples()[static_cast<size_t>(first)].caption;
    const std::string said = vary ? with_noise_words(caption, random) : caption;
    const std::vector<int64_t> tokens = tokenizer_.encode_padded(said, tokenizer_.max_length());
    ids.insert(ids.end(), tokens.begin(), tokens.end());
  }
  return {at::stack(latents), at::stack(tiles), at::stack(normals),
          at::tensor(ids, at::kLong).view({count, -1})};
}

}  // namespace patina::train_mini
