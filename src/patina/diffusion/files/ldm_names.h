// The names that the original implementation (LDM) gives to the modules of Stable Diffusion, beside those of
// diffusers [Rombach2022]. Each network has one table, read in both directions: loading takes LDM's names to
// diffusers', writing takes them back. No Torch here.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "patina/diffusion/files/config.h"

namespace patina::diffusion {

/// Names of modules and tensors, one to one.
class NameMap {
 public:
  /// A module's own name and that of everything in it, as in "input_blocks.0.0" and "conv_in".
  void add(std::string ldm, std::string diffusers);

  /// The whole name in the other scheme, by its longest prefix that is a module; nullopt: none is.
  std::optional<std::string> to_diffusers(std::string_view ldm) const;
  std::optional<std::string> to_ldm(std::string_view diffusers) const;

 private:
  using Names = std::map<std::string, std::string, std::less<>>;
  Names diffusers_by_ldm_, ldm_by_diffusers_;
};

/// LDM numbers the blocks of a U-Net in one row, so its names depend on the layers and attentions that each
/// level has (channels are not looked at).
NameMap unet_names(const std::vector<LevelConfig>& levels);
/// `num_embedding_channels` is the number of sizes in the hint's encoder.
NameMap controlnet_names(const std::vector<LevelConfig>& levels, int64_t num_embedding_channels);
/// Decoder levels count from the other end than LDM's.
NameMap vae_names(int64_t num_levels, int64_t layers_per_block);
/// The text encoder of SD 2.x as OpenCLIP names it. Its q, k and v are one tensor there, see
/// kFusedProjection.
NameMap openclip_names(int64_t num_layers);

/// "<layer>.attn.in_proj_weight" and "…_bias" of OpenCLIP hold these three, one above the other.
struct FusedProjection {
  const char* ldm;           // what the fused name ends in
  const char* diffusers[3];  // what the parts' names end in
};
inline constexpr FusedProjection kFusedProjections[] = {
    {"attn.in_proj_weight",
     {"self_attn.q_proj.weight", "self_attn.k_proj.weight", "self_attn.v_proj.weight"}},
    {"attn.in_proj_bias", {"self_attn.q_proj.bias", "self_attn.k_proj.bias", "self_attn.v_proj.bias"}}};

/// Whether any tensor's name begins so.
using HasPrefix = std::function<bool(const std::string& prefix)>;

/// The levels of a U-Net or the encoder of one, from the LDM names that are there: numbers of layers and
/// which have attention. Other fields keep their defaults. Lone missing tensors do not disturb it.
std::vector<LevelConfig> levels_of_ldm(const HasPrefix& has);

}  // namespace patina::diffusion
