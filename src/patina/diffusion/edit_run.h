// A run of image-to-image over a view grid, ready for its first step: what making detail and looking at its
// attention share. Seen only by the sources that see Torch.
#pragma once

#include <array>
#include <memory>

#include "patina/diffusion/edit.h"
#include "patina/diffusion/model_state.h"
#include "patina/diffusion/sampler.h"

namespace patina::diffusion {

/// Sizes of a run, in pixels and latent pixels.
struct GridSizes {
  int64_t grid = 1;                             // views a side
  int64_t view_height = 0, view_width = 0;      // pixels of one view
  int64_t latent_height = 0, latent_width = 0;  // latent pixels of one view
};

/// `denoiser` refers to `bias`, which refers to the inputs' levels: a run stays where it was made, and the
/// model and inputs outlive it.
struct EditRun {
  GridSizes sizes;
  SchedulePlan plan;
  int start = 0;  // first call of the plan that is run
  nn::SelfAttentionBias bias;
  Denoiser denoiser;
  SamplerState state;
  std::array<int64_t, 4> shape{};  // of the grid's latents: [1,C,H,W]
  std::optional<LateJoin> late;    // where the inputs give strengths other than 1

  EditRun() = default;
  EditRun(const EditRun&) = delete;
  EditRun& operator=(const EditRun&) = delete;
};

/// Checks inputs and options, encodes text, conditions and start images, and adds the noise of the first
/// step, or takes the state of `resume`. The caller holds a c10::InferenceMode. Throws Error{kUsage} if sizes
/// do not fit.
std::unique_ptr<EditRun> start_edit(const Model& model, const EditInputs& inputs, const EditOptions& options,
                                    const std::optional<Checkpoint>& resume, const Progress& progress);

/// [1,3,H,W] f32 from an image, values as they are.
at::Tensor tensor_from_image(const Image& image);
/// The image of a [1,C,H,W] f32 tensor.
Image image_from_tensor(const at::Tensor& tensor);

/// Whether guidance evaluates both prompts at once for a grid of so many latent pixels: where that is faster,
/// or as fast and takes little memory. By size alone: how much memory is free does not change the result.
bool guides_in_one_batch(const UNetConfig& unet, int64_t latent_pixels);

/// Noise of ancestral schedulers: a value depends on (seed, call, place) alone, so that a resumed run draws
/// the same.
std::vector<float> scheduler_noise(uint64_t seed, int call, size_t size);

}  // namespace patina::diffusion
