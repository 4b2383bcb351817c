#include "patina/diffusion/attention_probe.h"

#include <algorithm>
#include <cmath>

#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>

#include "patina/base/check.h"
#include "patina/base/error.h"
#include "patina/diffusion/edit_run.h"
#include "patina/diffusion/files/unet_blocks.h"

namespace patina::diffusion {
namespace {

constexpr std::string_view kLayerEnd = ".transformer_blocks.0.attn1";

/// [B,N,C] of one layer -> [N,C] f32 of the last in the batch, which is the prompt's; of prompts that are
/// evaluated in turn the prompt's comes last too.
std::vector<float> prompt_half(const at::Tensor& tokens) {
  const at::Tensor values = tokens.select(0, tokens.size(0) - 1).to(at::kFloat).contiguous();
  return {values.data_ptr<float>(), values.data_ptr<float>() + values.numel()};
}

/// "24 × 24: down_blocks.0.attentions.0, up_blocks.2.attentions.0; 12 × 12: ...", finest first.
std::string layer_list(std::vector<AttentionLayer> layers) {
  std::stable_sort(layers.begin(), layers.end(),
                   [](const AttentionLayer& a, const AttentionLayer& b) { return a.width > b.width; });
  std::string list;
  for (size_t i = 0; i < layers.size(); ++i) {
    const AttentionLayer& layer = layers[i];
    const std::string size = std::to_string(layer.width) + " × " + std::to_string(layer.height);
    if (i == 0 || layers[i - 1].width != layer.width)
      list += (i ? "; " : "") + size + ": ";
    else
      list += ", ";
    list += short_name(layer);
  }
  return list;
}

}  // namespace

std::string short_name(const AttentionLayer& layer) {
  std::string_view name = layer.name;
  if (name.ends_with(kLayerEnd)) name.remove_suffix(kLayerEnd.size());
  return std::string(name);
}

std::vector<AttentionLayer> self_attention_layers(const Model& model, int width, int height) {
  const std::vector<LevelConfig>& levels = model.state().unet.config().levels;
  const std::vector<LatentSize> sizes =
      level_sizes({width / model.latent_scale(), height / model.latent_scale()}, levels.size());
  std::vector<UNetBlock> blocks = down_blocks(levels);
  blocks.push_back(mid_block(levels));
  for (UNetBlock& block : up_blocks(levels)) blocks.push_back(std::move(block));

  std::vector<AttentionLayer> layers;
  for (const UNetBlock& block : blocks) {
    const LevelConfig& level = levels[block.level];
    for (const UNetLayer& layer : block.layers) {
      for (int64_t t = 0; layer.transformer && t < level.num_transformer_layers; ++t)
        layers.push_back({*layer.transformer + ".transformer_blocks." + std::to_string(t) + ".attn1",
                          sizes[block.level].width, sizes[block.level].height, level.num_heads,
                          level.channels / level.num_heads});
    }
  }
  return layers;
}

AttentionLayer find_layer(const std::vector<AttentionLayer>& layers, std::string_view name) {
  PATINA_CHECK(!layers.empty());
  if (name.empty()) {
    const auto coarser = [](const AttentionLayer& a, const AttentionLayer& b) { return a.width < b.width; };
    // From the end, since max_element takes the first of equals.
    return *std::max_element(layers.rbegin(), layers.rend(), coarser);
  }
  for (const AttentionLayer& layer : layers) {
    if (name == layer.name || name == short_name(layer)) return layer;
  }
  throw Error(ErrorCode::kUsage, "layer",
              "there is no self-attention '" + printable(name) +
                  "'; there are, by latent pixels of the grid, " + layer_list(layers));
}

CapturedAttention capture_attention(const Model& model, const EditInputs& inputs, const EditOptions& options,
                                    const AttentionLayer& layer, int evaluation, const Progress& progress) {
  const c10::InferenceMode inference;
  const std::unique_ptr<EditRun> run = start_edit(model, inputs, options, std::nullopt, progress);
  CapturedAttention captured;
  captured.layer = layer;
  captured.num_evaluations = run->plan.num_calls() - run->start;
  captured.evaluation = evaluation == 0 ? (captured.num_evaluations + 1) / 2 : evaluation;
  if (captured.evaluation < 1 || captured.evaluation > captured.num_evaluations) {
    throw Error(ErrorCode::kUsage, "step",
                "expected 1 to " + std::to_string(captured.num_evaluations) +
                    ", the evaluations of this run, found " + std::to_string(captured.evaluation));
  }
  const int call = run->start + captured.evaluation - 1;
  captured.timestep = run->plan.timesteps[static_cast<size_t>(call)];
  if (const attention::KeyBuckets* buckets = run->bias.level(layer.height, layer.width)) {
    captured.bias_level = static_cast<int>(buckets - inputs.bias_levels.data());
    captured.beta = run->bias.beta(layer.head_dim);
  }

  // Every evaluation overwrites what the one before left; the last that is run is the one asked for.
  run->denoiser.record = nn::Recorder([&](const std::string& module_path, const at::Tensor& output) {
    if (module_path == layer.name + ".to_q") captured.q = prompt_half(output);
    if (module_path == layer.name + ".to_k") captured.k = prompt_half(output);
  });
  const auto report = [&](int next_call) {
    progress.update("detail", next_call - run->start, captured.evaluation);
    progress.throw_if_stopped();
  };
  report(run->start);
  SamplerCallbacks callbacks{
      [&](int index, size_t size) { return scheduler_noise(options.seed, index, size); },
      [&](const SamplerState& after, const Guided&) { report(after.next_call); }};
  callbacks.end = call + 1;
  if (run->late) callbacks.late = &*run->late;
  sample(run->denoiser, run->plan, std::move(run->state), run->shape, callbacks);
  PATINA_CHECK_EQ(static_cast<int64_t>(captured.q.size()),
                  layer.width * layer.height * layer.num_heads * layer.head_dim);
  return captured;
}

std::vector<float> attention_row(const CapturedAttention& captured, int64_t query,
                                 std::span<const int32_t> biased_keys, float beta) {
  const auto num_heads = static_cast<size_t>(captured.layer.num_heads),
             head_dim = static_cast<size_t>(captured.layer.head_dim);
  const size_t width = num_heads * head_dim, num_keys = captured.k.size() / width;
  PATINA_CHECK(query >= 0 && static_cast<size_t>(query) < num_keys);
  const float scale = 1.0f / std::sqrt(static_cast<float>(head_dim));

  std::vector<float> row(num_keys), scores(num_keys);
  for (size_t head = 0; head < num_heads; ++head) {
    const float* q = captured.q.data() + static_cast<size_t>(query) * width + head * head_dim;
    for (size_t j = 0; j < num_keys; ++j) {
      const float* k = captured.k.data() + j * width + head * head_dim;
      float product = 0;
      for (size_t c = 0; c < head_dim; ++c) product += q[c] * k[c];
      scores[j] = scale * product;
    }
    for (const int32_t j : biased_keys) scores[static_cast<size_t>(j)] += beta;

    const float highest = *std::max_element(scores.begin(), scores.end());
    double sum = 0;  // in double, since 262,144 small terms lose a float's last digits
    for (float& score : scores) {
      score = std::exp(score - highest);
      sum += score;
    }
    const auto share = static_cast<float>(1.0 / (sum * static_cast<double>(num_heads)));
    for (size_t j = 0; j < num_keys; ++j) row[j] += share * scores[j];
  }
  return row;
}

}  // namespace patina::diffusion
