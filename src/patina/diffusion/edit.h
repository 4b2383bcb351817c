// Editing views with a diffusion model: renders in, edited views out. No Torch type passes this header.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "patina/attention/attention.h"
#include "patina/base/progress.h"
#include "patina/diffusion/model.h"
#include "patina/image/image.h"

namespace patina::diffusion {

struct EditInputs {
  int grid = 1;                     // views a side
  std::vector<Image> tile_views;    // grid² × [H,W,3] sRGB [0,1]: tile condition and start image
  std::vector<Image> normal_views;  // grid² × [H,W,3] [0,1]
  std::vector<float> noise;         // [C, grid·H/scale, grid·W/scale] f32, unit variance
  std::vector<attention::KeyBuckets>
      bias_levels;  // finest first; empty: no bias; levels coarser than the U-Net's coarsest are not used
  std::vector<Image> start_views = {};  // grid² × [H,W,3] sRGB [0,1]: start image where it is not the tile
                                        // condition; empty: tile_views
  std::vector<Image> strength_views = {};  // grid² × [H,W,1] [0,1]: share of EditOptions::strength with which
                                           // a place is edited, 0: not at all, below 0: shows nothing that
                                           // has a strength (late_join.h); empty: 1 everywhere
  std::vector<Image> part_views = {};  // grid² × [H,W,parts] [0,1]: how much of each pixel shows each part
                                       // of EditOptions::part_prompts; the rest follows the prompt
  struct Exemplar {
    Image picture;                    // [H,W,3] sRGB of a view's size
    std::vector<Image> view_weights;  // grid² × [H,W,1], 0 or more: how much a pixel looks at it: 1 is
                                      // as much as at all views together
  };
  std::vector<Exemplar> exemplars = {};  // pictures that the edit shall be like (networks/reference.h)
};

/// Where a run stands between two steps, as bytes that restore it exactly; for resuming a killed run.
struct Checkpoint {
  int next_step = 0;
  std::vector<uint8_t> bytes;
};
struct EditHooks {
  std::function<void(const Checkpoint&)> on_checkpoint;  // after every step; may be empty
  std::optional<Checkpoint> resume;                      // from an earlier call with equal inputs and options
};

/// Bytes that edit_views needs for views of this size.
struct EditMemory {
  int64_t weights = 0;      // of the networks that are in memory at once, and of the libraries
  int64_t activations = 0;  // what they compute on, at the most
};
EditMemory predict_memory(const Model& model, int grid, int view_width, int view_height,
                          const EditOptions& options);

/// Image-to-image with two ControlNets over the whole grid at once [Hadadan2025, Sec. 4], and what the VAE
/// lost of the renders put back. Encodes and decodes view by view. Returns grid² sRGB images [H,W,3] in
/// [0,1]. Throws Error{kUsage} if sizes do not fit.
std::vector<Image> edit_views(const Model& model, const EditInputs& inputs, const EditOptions& options,
                              const EditHooks& hooks, const Progress& progress);

}  // namespace patina::diffusion
