#include "patina/diffusion/networks/text_encoder.h"

#include <cmath>
#include <limits>

#include <ATen/ATen.h>

#include "patina/base/check.h"
#include "patina/base/error.h"
#include "patina/diffusion/networks/component.h"

namespace patina::diffusion {
namespace {

TextLayer load_layer(nn::WeightReader& weights, const std::string& name, const TextEncoderConfig& config) {
  const int64_t width = config.hidden_size;
  const std::string attention = name + ".self_attn", mlp = name + ".mlp";
  return {name,
          nn::load_layer_norm(weights, name + ".layer_norm1", width, config.layer_norm_epsilon),
          {attention, nn::load_linear(weights, attention + ".q_proj", width, width),
           nn::load_linear(weights, attention + ".k_proj", width, width),
           nn::load_linear(weights, attention + ".v_proj", width, width),
           nn::load_linear(weights, attention + ".out_proj", width, width), config.num_heads},
          nn::load_layer_norm(weights, name + ".layer_norm2", width, config.layer_norm_epsilon),
          {mlp, nn::load_linear(weights, mlp + ".fc1", width, config.intermediate_size),
           nn::load_linear(weights, mlp + ".fc2", config.intermediate_size, width), config.activation}};
}

}  // namespace

at::Tensor TextAttention::operator()(const at::Tensor& x, const nn::Recorder& record) const {
  const int64_t batch = x.size(0), tokens = x.size(1), width = x.size(2), head_dim = width / num_heads;
  const auto heads_first = [&](const at::Tensor& y) {
    return y.view({batch, tokens, num_heads, head_dim}).transpose(1, 2);
  };
  const at::Tensor q = heads_first(q_proj(x, record)) / std::sqrt(static_cast<double>(head_dim));
  const at::Tensor k = heads_first(k_proj(x, record)), v = heads_first(v_proj(x, record));
  // Scores [B,heads,T,T]; T is 77, so nothing is gained by not materialising them.
  const at::Tensor later = at::ones({tokens, tokens}, x.options().dtype(at::kBool)).triu(1);
  const at::Tensor scores =
      at::matmul(q, k.transpose(2, 3)).masked_fill(later, -std::numeric_limits<double>::infinity());
  const at::Tensor attended = at::matmul(at::softmax(scores, -1), v);
  return record(name, out_proj(attended.transpose(1, 2).reshape({batch, tokens, width}), record));
}

at::Tensor TextMlp::operator()(const at::Tensor& x, const nn::Recorder& record) const {
  const at::Tensor h = fc1(x, record);
  return record(name,
                fc2(activation == TextActivation::kQuickGelu ? nn::quick_gelu(h) : at::gelu(h), record));
}

at::Tensor TextLayer::operator()(const at::Tensor& x, const nn::Recorder& record) const {
  const at::Tensor h = x + self_attn(layer_norm1(x, record), record);
  return record(name, h + mlp(layer_norm2(h, record), record));
}

TextEncoder::TextEncoder(const TextEncoderConfig& config, nn::WeightReader& weights) : config_(config) {
  const std::string root = "text_model.";
  token_embedding_ =
      weights.take(root + "embeddings.token_embedding.weight", {config_.vocab_size, config_.hidden_size});
  position_embedding_ = weights.take(root + "embeddings.position_embedding.weight",
                                     {config_.max_positions, config_.hidden_size});
  for (int64_t i = 0; i < config_.num_layers; ++i) {
    layers_.push_back(load_layer(weights, root + "encoder.layers." + std::to_string(i), config_));
  }
  final_layer_norm_ = nn::load_layer_norm(weights, root + "final_layer_norm", config_.hidden_size,
                                          config_.layer_norm_epsilon);
  // Position ids are a constant that older files store; the others belong to whole CLIP models.
  for (const char* name : {"text_model.embeddings.position_ids", "text_projection", "logit_scale",
                           "vision_model.", "visual_projection"}) {
    weights.ignore(name);
  }
  count_ = weights.count();
}

TextEncoder::TextEncoder(const std::filesystem::path& folder, at::ScalarType type)
    : TextEncoder(load_network<TextEncoder>(open_text_encoder(folder), type)) {}

TextConditioning TextEncoder::operator()(const at::Tensor& token_ids, int64_t clip_skip,
                                         const nn::Recorder& record, const at::Tensor& learned) const {
  const at::Tensor ids = token_ids.to(token_embedding_.device());
  PATINA_CHECK_EQ(ids.dim(), 2);
  PATINA_CHECK_LE(ids.size(1), config_.max_positions);
  PATINA_CHECK(clip_skip >= 1 && clip_skip <= config_.num_layers);
  const int64_t num_learned = learned.defined() ? learned.size(0) : 0;
  if (ids.min().item<int64_t>() < 0 || ids.max().item<int64_t>() >= config_.vocab_size + num_learned) {
    throw Error(ErrorCode::kFormat, "text encoder",
                "the tokenizer gives the id " + std::to_string(ids.max().item<int64_t>()) +
                    ", but the text encoder knows " + std::to_string(config_.vocab_size) +
                    " tokens: they belong to different models");
  }
  // Learned words take their place among the tokens' vectors; for the search of the end token they are 0.
  const at::Tensor is_learned = ids.ge(config_.vocab_size);
  const at::Tensor known = num_learned > 0 ? ids.masked_fill(is_learned, 0) : ids;
  at::Tensor vectors = at::embedding(token_embedding_, known);
  if (num_learned > 0) {
    const at::Tensor rows = (ids - config_.vocab_size).clamp(0);
    vectors = at::where(is_learned.unsqueeze(-1), at::embedding(learned, rows), vectors);
  }
  at::Tensor h = record("text_model.embeddings", vectors + position_embedding_.slice(0, 0, ids.size(1)));
  const auto num_layers = layers_.size() - static_cast<size_t>(clip_skip - 1);
  for (size_t i = 0; i < num_layers; ++i) h = layers_[i](h, record);
  h = final_layer_norm_(h, record);

  // The end token: the first one of its id. Configurations of old files give 2, which is wrong; there the
  // largest id is it.
  constexpr int64_t kWrongEos = 2;
  const at::Tensor end = config_.eos_token_id == kWrongEos
                             ? known.argmax(1)
                             : known.eq(config_.eos_token_id).to(at::kInt).argmax(1);
  return {h, h.index({at::arange(ids.size(0), ids.options()), end})};
}

}  // namespace patina::diffusion
