#include "patina/diffusion/files/config.h"

#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "patina/base/error.h"
#include "patina/base/files.h"

namespace patina::diffusion {
namespace {

using Json = nlohmann::json;

constexpr int64_t kMaxSize = 1 << 20;  // larger widths are damage, and products of two stay within 63 bits

/// Typed look-ups in one configuration; null counts as absent.
class Reader {
 public:
  explicit Reader(const std::filesystem::path& folder) : file_((folder / "config.json").string()) {
    object_ = Json::parse(read_text_file(file_, 1 << 24), nullptr, /*allow_exceptions=*/false);
    if (!object_.is_object())
      throw Error(ErrorCode::kFormat, file_, "is not a JSON object; expected a model configuration");
  }

  bool has(const char* key) const { return object_.contains(key) && !object_[key].is_null(); }

  int64_t integer(const char* key, int64_t absent) const {
    return has(key) ? as_integer(key, object_[key]) : absent;
  }
  double number(const char* key, double absent) const {
    if (!has(key)) return absent;
    if (!object_[key].is_number()) fail(key, "a number");
    return object_[key].get<double>();
  }
  bool boolean(const char* key, bool absent) const {
    if (!has(key)) return absent;
    if (!object_[key].is_boolean()) fail(key, "true or false");
    return object_[key].get<bool>();
  }
  std::string string(const char* key, const std::string& absent) const {
    if (!has(key)) return absent;
    if (!object_[key].is_string()) fail(key, "a string");
    return object_[key].get<std::string>();
  }
  std::vector<int64_t> integers(const char* key, std::vector<int64_t> absent) const {
    if (!has(key)) return absent;
    if (!object_[key].is_array() || object_[key].empty() || object_[key].size() > 16)
      fail(key, "a list of 1 to 16 integers");
    std::vector<int64_t> values;
    for (const Json& value : object_[key]) values.push_back(as_integer(key, value));
    return values;
  }
  std::vector<std::string> strings(const char* key, std::vector<std::string> absent) const {
    if (!has(key)) return absent;
    std::vector<std::string> values;
    if (!object_[key].is_array()) fail(key, "a list of strings");
    for (const Json& value : object_[key]) {
      if (!value.is_string()) fail(key, "a list of strings");
      values.push_back(value.get<std::string>());
    }
    return values;
  }
  /// One integer for every level, or a list with one for each.
  std::vector<int64_t> per_level(const char* key, int64_t absent, size_t num_levels) const {
    if (!has(key) || !object_[key].is_array()) return std::vector<int64_t>(num_levels, integer(key, absent));
    std::vector<int64_t> values = integers(key, {});
    if (values.size() != num_levels)
      fail(key, "an integer or a list of " + std::to_string(num_levels) + " integers");
    return values;
  }

  /// Refuses a setting other than the given one; absent and null pass.
  void require(const char* key, const Json& only) const {
    if (has(key) && object_[key] != only) {
      throw Error(ErrorCode::kUnsupported, file_,
                  std::string(key) + " is " + printable(object_[key].dump(), 80) + "; patina supports only " +
                      only.dump());
    }
  }
  /// Refuses any setting but null (and false).
  void require_absent(const char* key) const {
    if (has(key) && object_[key] != false) {
      throw Error(
          ErrorCode::kUnsupported, file_,
          std::string(key) + " is " + printable(object_[key].dump(), 80) + "; patina has no network with it");
    }
  }
  [[noreturn]] void fail(const char* key, const std::string& expected) const {
    throw Error(ErrorCode::kFormat, file_,
                std::string(key) + " is " + printable(object_[key].dump(), 80) + ", expected " + expected);
  }
  [[noreturn]] void fail(const std::string& message) const {
    throw Error(ErrorCode::kFormat, file_, message);
  }

 private:
  int64_t as_integer(const char* key, const Json& value) const {
    const std::string expected = "integers from 0 to " + std::to_string(kMaxSize);
    if (!value.is_number_integer()) fail(key, expected);
    if (value.is_number_unsigned() && value.get<uint64_t>() > static_cast<uint64_t>(kMaxSize))
      fail(key, expected);
    if (value.get<int64_t>() < 0) fail(key, expected);
    return value.get<int64_t>();
  }

  std::string file_;
  Json object_;
};

int64_t positive(const Reader& reader, const char* key, int64_t absent) {
  const int64_t value = reader.integer(key, absent);
  if (value == 0) reader.fail(key, "a positive integer");
  return value;
}

void check_divisible(const Reader& reader, int64_t channels, int64_t divisor, const char* of_what) {
  if (divisor <= 0 || channels % divisor != 0) {
    reader.fail(std::to_string(channels) + " channels cannot be divided into " + std::to_string(divisor) +
                " " + of_what);
  }
}

/// Which blocks have attention, from their type names.
std::vector<bool> attention_of_blocks(const Reader& reader, const char* key,
                                      const std::vector<std::string>& absent, const std::string& with,
                                      const std::string& without, size_t num_levels) {
  const std::vector<std::string> types = reader.strings(key, absent);
  if (types.size() != num_levels) {
    reader.fail(std::string(key) + " names " + std::to_string(types.size()) + " blocks, expected " +
                std::to_string(num_levels) + ", one for each of block_out_channels");
  }
  std::vector<bool> attention;
  for (const std::string& type : types) {
    if (type != with && type != without) {
      reader.fail(std::string(key) + " names the block '" + printable(type, 60) + "', expected " + with +
                  " or " + without);
    }
    attention.push_back(type == with);
  }
  return attention;
}

/// What U-Net and ControlNet have in common.
UNetConfig read_encoder(const Reader& reader) {
  for (const char* key : {"class_embed_type", "addition_embed_type", "num_class_embeds", "encoder_hid_dim",
                          "encoder_hid_dim_type", "time_cond_proj_dim", "time_embedding_dim",
                          "time_embedding_act_fn", "timestep_post_act", "cross_attention_norm",
                          "dual_cross_attention", "resnet_skip_time_act", "mid_block_only_cross_attention",
                          "class_embeddings_concat", "reverse_transformer_layers_per_block"}) {
    reader.require_absent(key);
  }
  reader.require("act_fn", "silu");
  reader.require("mid_block_type", "UNetMidBlock2DCrossAttn");
  reader.require("time_embedding_type", "positional");
  reader.require("resnet_time_scale_shift", "default");
  reader.require("resnet_out_scale_factor", 1.0);
  reader.require("mid_block_scale_factor", 1);
  reader.require("downsample_padding", 1);
  reader.require("only_cross_attention", false);
  reader.require("attention_type", "default");

  UNetConfig config;
  config.in_channels = positive(reader, "in_channels", 4);
  config.norm_num_groups = positive(reader, "norm_num_groups", 32);
  config.norm_epsilon = reader.number("norm_eps", 1e-5);
  config.use_linear_projection = reader.boolean("use_linear_projection", false);
  config.flip_sin_to_cos = reader.boolean("flip_sin_to_cos", true);
  config.freq_shift = reader.number("freq_shift", 0);
  config.center_input_sample = reader.boolean("center_input_sample", false);
  config.conv_in_kernel = positive(reader, "conv_in_kernel", 3);

  const std::vector<int64_t> channels = reader.integers("block_out_channels", {320, 640, 1280, 1280});
  const size_t num_levels = channels.size();
  const std::vector<bool> down_attention = attention_of_blocks(
      reader, "down_block_types",
      {"CrossAttnDownBlock2D", "CrossAttnDownBlock2D", "CrossAttnDownBlock2D", "DownBlock2D"},
      "CrossAttnDownBlock2D", "DownBlock2D", num_levels);
  const std::vector<int64_t> num_layers = reader.per_level("layers_per_block", 2, num_levels);
  // diffusers' attention_head_dim of these networks is the number of heads, unless num_attention_heads gives
  // it.
  const char* heads_key = reader.has("num_attention_heads") ? "num_attention_heads" : "attention_head_dim";
  const std::vector<int64_t> num_heads = reader.per_level(heads_key, 8, num_levels);
  const std::vector<int64_t> transformers = reader.per_level("transformer_layers_per_block", 1, num_levels);
  const std::vector<int64_t> text_widths = reader.per_level("cross_attention_dim", 1280, num_levels);
  for (size_t i = 0; i < num_levels; ++i) {
    check_divisible(reader, channels[i], config.norm_num_groups, "groups (norm_num_groups)");
    check_divisible(reader, channels[i], num_heads[i], "attention heads");
    if (channels[i] == 0) reader.fail("block_out_channels", "positive integers");
    if (num_layers[i] < 1 || num_layers[i] > 64) reader.fail("layers_per_block", "integers from 1 to 64");
    if (transformers[i] > 64) reader.fail("transformer_layers_per_block", "integers from 0 to 64");
    config.levels.push_back({channels[i], num_layers[i], num_heads[i], transformers[i], text_widths[i],
                             down_attention[i], false});
  }
  return config;
}

}  // namespace

UNetConfig read_unet_config(const std::filesystem::path& folder) {
  const Reader reader(folder);
  UNetConfig config = read_encoder(reader);
  config.out_channels = positive(reader, "out_channels", 4);
  config.conv_out_kernel = positive(reader, "conv_out_kernel", 3);
  const std::vector<bool> up_attention =
      attention_of_blocks(reader, "up_block_types",
                          {"UpBlock2D", "CrossAttnUpBlock2D", "CrossAttnUpBlock2D", "CrossAttnUpBlock2D"},
                          "CrossAttnUpBlock2D", "UpBlock2D", config.levels.size());
  // up_block_types run from the coarsest level to the finest.
  for (size_t i = 0; i < config.levels.size(); ++i)
    config.levels[i].up_attention = up_attention[config.levels.size() - 1 - i];
  return config;
}

ControlNetConfig read_controlnet_config(const std::filesystem::path& folder) {
  const Reader reader(folder);
  reader.require("global_pool_conditions", false);
  ControlNetConfig config{read_encoder(reader), 3, {}, false};
  config.conditioning_channels = positive(reader, "conditioning_channels", 3);
  config.embedding_channels = reader.integers("conditioning_embedding_out_channels", {16, 32, 96, 256});
  const std::string order = reader.string("controlnet_conditioning_channel_order", "rgb");
  if (order != "rgb" && order != "bgr") reader.fail("controlnet_conditioning_channel_order", "rgb or bgr");
  config.bgr = order == "bgr";
  return config;
}

VaeConfig read_vae_config(const std::filesystem::path& folder) {
  const Reader reader(folder);
  reader.require("act_fn", "silu");
  for (const char* key : {"latents_mean", "latents_std", "shift_factor"}) reader.require_absent(key);
  VaeConfig config;
  config.in_channels = positive(reader, "in_channels", 3);
  config.out_channels = positive(reader, "out_channels", 3);
  config.latent_channels = positive(reader, "latent_channels", 4);
  config.block_out_channels = reader.integers("block_out_channels", {64});
  config.layers_per_block = positive(reader, "layers_per_block", 1);
  if (config.layers_per_block > 64) reader.fail("layers_per_block", "an integer from 1 to 64");
  config.norm_num_groups = positive(reader, "norm_num_groups", 32);
  config.scaling_factor = reader.number("scaling_factor", 0.18215);
  if (!(config.scaling_factor > 0)) reader.fail("scaling_factor", "a positive number");
  config.mid_attention = reader.boolean("mid_block_add_attention", true);
  config.quant_conv = reader.boolean("use_quant_conv", true);
  config.post_quant_conv = reader.boolean("use_post_quant_conv", true);
  const size_t num_levels = config.block_out_channels.size();
  for (const auto& [key, type] : {std::pair("down_block_types", "DownEncoderBlock2D"),
                                  std::pair("up_block_types", "UpDecoderBlock2D")}) {
    attention_of_blocks(reader, key, std::vector<std::string>(num_levels, type), type, type, num_levels);
  }
  for (const int64_t channels : config.block_out_channels) {
    if (channels == 0) reader.fail("block_out_channels", "positive integers");
    check_divisible(reader, channels, config.norm_num_groups, "groups (norm_num_groups)");
  }
  return config;
}

TextEncoderConfig read_text_encoder_config(const std::filesystem::path& folder) {
  const Reader reader(folder);
  TextEncoderConfig config;
  config.vocab_size = positive(reader, "vocab_size", 49408);
  config.hidden_size = positive(reader, "hidden_size", 512);
  config.intermediate_size = positive(reader, "intermediate_size", 2048);
  config.num_layers = positive(reader, "num_hidden_layers", 12);
  if (config.num_layers > 256) reader.fail("num_hidden_layers", "an integer from 1 to 256");
  config.num_heads = positive(reader, "num_attention_heads", 8);
  config.max_positions = positive(reader, "max_position_embeddings", 77);
  config.eos_token_id = reader.integer("eos_token_id", 49407);
  config.layer_norm_epsilon = reader.number("layer_norm_eps", 1e-5);
  const std::string activation = reader.string("hidden_act", "quick_gelu");
  if (activation != "quick_gelu" && activation != "gelu") {
    throw Error(ErrorCode::kUnsupported, (folder / "config.json").string(),
                "hidden_act is '" + printable(activation, 40) + "'; patina supports quick_gelu and gelu");
  }
  config.activation = activation == "gelu" ? TextActivation::kGelu : TextActivation::kQuickGelu;
  check_divisible(reader, config.hidden_size, config.num_heads, "attention heads");
  return config;
}

}  // namespace patina::diffusion
