// What a self-attention of the U-Net looks at: its queries and keys as they were at one step of a run, and
// the softmax row of one query [Hadadan2025, Fig. 3]. No Torch type passes this header.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "patina/diffusion/edit.h"

namespace patina::diffusion {

/// One self-attention of the U-Net over the latent pixels of a whole view grid.
struct AttentionLayer {
  std::string name;  // its path in the weight file: "up_blocks.3.attentions.2.transformer_blocks.0.attn1"
  int64_t width = 0, height = 0;  // latent pixels of the grid at its resolution; N = width · height
  int64_t num_heads = 0, head_dim = 0;
};

/// All of them in the order in which they run, for a grid of width × height image pixels.
std::vector<AttentionLayer> self_attention_layers(const Model& model, int width, int height);

/// The name as people say it: without ".transformer_blocks.0.attn1" where that is its end.
std::string short_name(const AttentionLayer& layer);

/// The layer of that name, short or whole. Empty: the last of the finest resolution, where the bias acts on
/// the finest detail. Throws Error{kUsage} that lists all.
AttentionLayer find_layer(const std::vector<AttentionLayer>& layers, std::string_view name);

struct CapturedAttention {
  AttentionLayer layer;
  std::vector<float> q, k;  // [N, num_heads · head_dim] of the prompt's half of the guidance, not the
                            // negative prompt's
  int evaluation = 0, num_evaluations = 0;  // counted from 1; which of the run's
  double timestep = 0;
  int bias_level = -1;  // which of the inputs' levels acts here; -1: none
  float beta = 0;       // what the bias adds to the exponent here
};

/// Runs edit_views's way up to evaluation `evaluation` (from 1; 0: the middle one) and returns what
/// `layer` saw in it; the bias acts in the run as the options say. Throws Error{kUsage} where there is no
/// such evaluation.
CapturedAttention capture_attention(const Model& model, const EditInputs& inputs, const EditOptions& options,
                                    const AttentionLayer& layer, int evaluation, const Progress& progress);

/// The attention weights of `query` over all N keys: softmax_j(q·k_j/√d + β·[j ∈ biased_keys]), mean over the
/// heads. [N] f32, sum 1. O(N·d). `biased_keys` ascending, as attention::biased_keys gives them.
std::vector<float> attention_row(const CapturedAttention& captured, int64_t query,
                                 std::span<const int32_t> biased_keys, float beta);

}  // namespace patina::diffusion
