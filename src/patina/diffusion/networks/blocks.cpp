#include "patina/diffusion/networks/blocks.h"

#include <cmath>
#include <limits>
#include <vector>

#include <ATen/ATen.h>

#include "patina/base/check.h"

namespace patina::diffusion {
namespace {

constexpr double kTransformerNormEpsilon = 1e-6;  // diffusers' Transformer2DModel, whatever norm_eps says
constexpr int64_t kFeedForwardFactor = 4;
constexpr int64_t kFeedForwardTokens = 8192;  // that pass through it at once

Attention load_attention(nn::WeightReader& weights, const std::string& name, int64_t channels,
                         int64_t context_width, int64_t num_heads) {
  return {name,
          nn::load_linear(weights, name + ".to_q", channels, channels, /*bias=*/false),
          nn::load_linear(weights, name + ".to_k", context_width, channels, /*bias=*/false),
          nn::load_linear(weights, name + ".to_v", context_width, channels, /*bias=*/false),
          nn::load_linear(weights, name + ".to_out.0", channels, channels),
          num_heads};
}

TransformerBlock load_transformer_block(nn::WeightReader& weights, const std::string& name,
                                        const LevelConfig& level) {
  const int64_t channels = level.channels, inner = kFeedForwardFactor * channels;
  return {name,
          nn::load_layer_norm(weights, name + ".norm1", channels),
          load_attention(weights, name + ".attn1", channels, channels, level.num_heads),
          nn::load_layer_norm(weights, name + ".norm2", channels),
          load_attention(weights, name + ".attn2", channels, level.cross_attention_dim, level.num_heads),
          nn::load_layer_norm(weights, name + ".norm3", channels),
          {name + ".ff", nn::load_linear(weights, name + ".ff.net.0.proj", channels, 2 * inner),
           nn::load_linear(weights, name + ".ff.net.2", inner, channels)}};
}

}  // namespace

at::Tensor ResnetBlock::operator()(const at::Tensor& x, const at::Tensor& time,
                                   const nn::Recorder& record) const {
  at::Tensor h = conv1(norm1.with_silu(x, record), record);
  if (time_emb_proj) h = h + (*time_emb_proj)(time, record).unsqueeze(-1).unsqueeze(-1);
  h = conv2(norm2.with_silu(h, record), record);
  return record(name, (conv_shortcut ? (*conv_shortcut)(x, record) : x) + h);
}

ResnetBlock load_resnet(nn::WeightReader& weights, const std::string& name, int64_t in, int64_t out,
                        int64_t time_width, int64_t num_groups, double epsilon) {
  ResnetBlock block;
  block.name = name;
  block.norm1 = nn::load_group_norm(weights, name + ".norm1", in, num_groups, epsilon);
  block.conv1 = nn::load_conv2d(weights, name + ".conv1", in, out, 3);
  if (time_width > 0)
    block.time_emb_proj = nn::load_linear(weights, name + ".time_emb_proj", time_width, out);
  block.norm2 = nn::load_group_norm(weights, name + ".norm2", out, num_groups, epsilon);
  block.conv2 = nn::load_conv2d(weights, name + ".conv2", out, out, 3);
  if (in != out) block.conv_shortcut = nn::load_conv2d(weights, name + ".conv_shortcut", in, out, 1);
  return block;
}

at::Tensor Attention::operator()(const at::Tensor& x, const at::Tensor& context, const nn::Recorder& record,
                                 const nn::LevelBias& bias, std::span<const nn::ExtraKeys> extra) const {
  const at::Tensor q = to_q(x, record), k = to_k(context, record), v = to_v(context, record);
  return record(name, to_out_0(nn::attend(q, k, v, num_heads, bias, extra), record));
}

at::Tensor Attention::in_parts(const at::Tensor& x, std::span<const at::Tensor> texts,
                               std::span<const PartPixels> parts, const nn::Recorder& record) const {
  PATINA_CHECK_EQ(texts.size(), parts.size());
  const at::Tensor q = to_q(x, record);
  at::Tensor attended = at::zeros_like(q);
  for (size_t i = 0; i < parts.size(); ++i) {
    if (parts[i].index.numel() == 0) continue;
    const at::Tensor index = parts[i].index.to(q.device()), share = parts[i].share.to(q.device(), q.dtype());
    const at::Tensor own =
        nn::attend(q.index_select(1, index), to_k(texts[i], record), to_v(texts[i], record), num_heads);
    attended.index_add_(1, index, own * share);
  }
  return record(name, to_out_0(attended, record));
}

at::Tensor FeedForward::operator()(const at::Tensor& x, const nn::Recorder& record) const {
  // The values between the layers are eight times as many as those around them, and each token is for itself.
  std::vector<at::Tensor> parts;
  for (const at::Tensor& tokens : x.split(kFeedForwardTokens, 1)) {
    const at::Tensor gated = record(name + ".net.0", nn::geglu(net_0_proj(tokens, record)));
    parts.push_back(net_2(gated, record));
  }
  return record(name, parts.size() == 1 ? parts.front() : at::cat(parts, 1));
}

at::Tensor TransformerBlock::operator()(const at::Tensor& x, int64_t height, int64_t width,
                                        const Conditions& conditions) const {
  const nn::Recorder& record = conditions.record;
  const nn::LevelBias bias =
      conditions.bias ? conditions.bias->at(height, width, x.size(2) / attn1.num_heads) : nn::LevelBias{};

  const at::Tensor n1 = norm1(x, record);
  std::vector<nn::ExtraKeys> extra;
  for (const Reference& reference : conditions.references) {
    const at::Tensor tokens = reference.tokens->at(norm1.name).expand({x.size(0), -1, -1});
    // Only the last of the batch, the prompt's, sees it: guidance then leads toward it.
    at::Tensor weight = reference.weights->log_at(height, width).repeat({x.size(0), 1, 1});
    if (x.size(0) > 1) weight.slice(0, 0, x.size(0) - 1).fill_(-std::numeric_limits<float>::infinity());
    extra.push_back({attn1.to_k(tokens, record), attn1.to_v(tokens, record), weight});
  }
  at::Tensor h = x + attn1(n1, n1, record, bias, extra);
  const at::Tensor n2 = norm2(h, record);
  h = h + (conditions.parts
               ? attn2.in_parts(n2, conditions.texts, conditions.parts->at(height, width), record)
               : attn2(n2, conditions.texts.front(), record));
  h = h + ff(norm3(h, record), record);
  return record(name, h);
}

at::Tensor Transformer::operator()(const at::Tensor& x, const Conditions& conditions) const {
  const nn::Recorder& record = conditions.record;
  const int64_t height = x.size(2), width = x.size(3);
  at::Tensor tokens = proj_in(nn::tokens_from_image(norm(x, record)), record);
  for (const TransformerBlock& block : transformer_blocks) tokens = block(tokens, height, width, conditions);
  return record(name, nn::image_from_tokens(proj_out(tokens, record), height, width) + x);
}

Transformer load_transformer(nn::WeightReader& weights, const std::string& name, const LevelConfig& level,
                             const UNetConfig& config) {
  const int64_t channels = level.channels;
  const bool as_convolution = !config.use_linear_projection;
  Transformer transformer;
  transformer.name = name;
  transformer.norm =
      nn::load_group_norm(weights, name + ".norm", channels, config.norm_num_groups, kTransformerNormEpsilon);
  transformer.proj_in = nn::load_linear_1x1(weights, name + ".proj_in", channels, channels, as_convolution);
  for (int64_t i = 0; i < level.num_transformer_layers; ++i) {
    transformer.transformer_blocks.push_back(
        load_transformer_block(weights, name + ".transformer_blocks." + std::to_string(i), level));
  }
  transformer.proj_out = nn::load_linear_1x1(weights, name + ".proj_out", channels, channels, as_convolution);
  return transformer;
}

at::Tensor Downsample::operator()(const at::Tensor& x, const nn::Recorder& record) const {
  return record(name, conv(x, record));
}

at::Tensor Upsample::operator()(const at::Tensor& x, int64_t height, int64_t width,
                                const nn::Recorder& record) const {
  return record(name, conv(at::upsample_nearest2d(x, {height, width}), record));
}

}  // namespace patina::diffusion
