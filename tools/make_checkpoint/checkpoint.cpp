#include "make_checkpoint/checkpoint.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>

#include <nlohmann/json.hpp>

#include <c10/util/BFloat16.h>
#include <c10/util/Half.h>

#include "patina/base/check.h"
#include "patina/base/files.h"
#include "patina/diffusion/files/ldm_names.h"
#include "patina/diffusion/networks/controlnet.h"
#include "patina/diffusion/networks/dry_run.h"
#include "patina/diffusion/networks/text_encoder.h"
#include "patina/diffusion/networks/unet.h"
#include "patina/diffusion/networks/vae.h"

namespace patina::make_checkpoint {
namespace {

namespace fs = std::filesystem;
using nn::ElementType;
using Shape = std::vector<int64_t>;
using Tensors = std::vector<std::pair<std::string, Shape>>;

/// One tensor of a file: its stored name and shape, and the names in diffusers of the parts that lie one
/// behind the other in it.
struct Item {
  std::string stored;
  Shape shape;
  std::vector<std::string> parts;
  ElementType type = ElementType::kF32;
  uint64_t seed = 1;
};

uint64_t mix(uint64_t x) {  // splitmix64's output function
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBULL;
  return x ^ (x >> 31);
}

uint64_t hash_of(const std::string& name, uint64_t seed) {
  uint64_t hash = mix(seed + 0x9E3779B97F4A7C15ULL);
  for (const char c : name) hash = mix(hash ^ static_cast<uint8_t>(c));
  return hash;
}

/// Values that keep activations of order one: matrices of variance 1 / inputs, norms near 1, small biases.
void fill_values(const std::string& name, const Shape& shape, int64_t count, uint64_t seed, ElementType type,
                 std::span<uint8_t> bytes) {
  const bool is_norm = shape.size() == 1 && name.ends_with(".weight");
  const bool is_bias = shape.size() == 1 && !is_norm;
  int64_t inputs = 1;
  for (size_t i = 1; i < shape.size(); ++i) inputs *= shape[i];
  const float spread = is_norm || is_bias ? 0.1f : std::sqrt(3.0f / static_cast<float>(inputs));
  const float centre = is_norm ? 1.0f : 0.0f;
  const uint64_t start = hash_of(name, seed);
  for (int64_t i = 0; i < count; ++i) {
    const uint64_t bits = mix(start + 0x9E3779B97F4A7C15ULL * static_cast<uint64_t>(i));
    const float uniform = static_cast<float>(bits >> 40) * 0x1p-23f - 1.0f;  // [-1,1)
    const float value = centre + spread * uniform;
    if (type == ElementType::kF16) {
      const c10::Half half(value);
      std::memcpy(bytes.data() + 2 * i, &half.x, 2);
    } else if (type == ElementType::kBF16) {
      const c10::BFloat16 brain(value);
      std::memcpy(bytes.data() + 2 * i, &brain.x, 2);
    } else {
      std::memcpy(bytes.data() + 4 * i, &value, 4);
    }
  }
}

ElementType type_of(const Model& model, const std::string& name) {
  return model.mixed && hash_of(name, 0) % 2 ? ElementType::kF32 : model.type;
}

Item item_of(const Model& model, std::string stored, const std::string& name, Shape shape, uint64_t seed) {
  return {std::move(stored), std::move(shape), {name}, type_of(model, name), seed};
}

void write_items(const fs::path& path, const Model& model, const std::vector<Item>& items) {
  std::vector<nn::TensorPlan> plans;
  for (const Item& item : items) plans.push_back({item.stored, item.type, item.shape});
  size_t next = 0;
  const auto fill = [&](const nn::TensorPlan& plan, std::span<uint8_t> bytes) {
    const Item& item = items[next++];
    const size_t part_bytes = bytes.size() / item.parts.size();
    Shape shape = plan.shape;
    if (!shape.empty()) shape[0] /= static_cast<int64_t>(item.parts.size());
    for (size_t i = 0; i < item.parts.size(); ++i) {
      fill_values(item.parts[i], shape, static_cast<int64_t>(part_bytes) / nn::bytes_of(item.type), item.seed,
                  item.type, bytes.subspan(i * part_bytes, part_bytes));
    }
  };
  if (model.empty)
    nn::write_safetensors(path, plans, nullptr);
  else
    nn::write_safetensors(path, plans, fill);
}

std::vector<Item> plain_items(const Model& model, const Tensors& tensors, uint64_t seed) {
  std::vector<Item> items;
  for (const auto& [name, shape] : tensors) items.push_back(item_of(model, name, name, shape, seed));
  return items;
}

/// The tensors under LDM's names; in the VAE its attention's linear layers are 1×1 convolutions.
std::vector<Item> ldm_items(const Model& model, const Tensors& tensors, const diffusion::NameMap& names,
                            const std::string& prefix, uint64_t seed, bool is_vae = false) {
  std::vector<Item> items;
  for (const auto& [name, shape] : tensors) {
    const auto ldm = names.to_ldm(name);
    PATINA_CHECK(ldm.has_value());
    Item item = item_of(model, prefix + *ldm, name, shape, seed);
    if (is_vae && shape.size() == 2) item.shape.insert(item.shape.end(), {1, 1});
    items.push_back(std::move(item));
  }
  return items;
}

/// OpenCLIP's names: q, k and v in one tensor, and a last layer that is never run.
std::vector<Item> openclip_items(const Model& model, const Tensors& tensors) {
  const int64_t num_layers = model.configs.text_encoder.num_layers;
  const diffusion::NameMap names = diffusion::openclip_names(num_layers + 1);
  const std::string prefix = "cond_stage_model.model.";
  std::vector<Item> items;
  std::map<std::string, Item> fused_items;
  const auto add = [&](const std::string& name, const Shape& shape) {
    for (const diffusion::FusedProjection& fused : diffusion::kFusedProjections) {
      for (size_t part = 0; part < 3; ++part) {
        const std::string ending = std::string(".") + fused.diffusers[part];
        if (!name.ends_with(ending)) continue;
        const std::string layer = name.substr(0, name.size() - ending.size());
        Item& item = fused_items[layer + fused.ldm];
        item.stored = prefix + names.to_ldm(layer).value() + "." + fused.ldm;
        item.shape = shape;
        item.shape[0] *= 3;
        item.parts.resize(3);
        item.parts[part] = name;
        item.type = type_of(model, item.stored);
        item.seed = model.seed;
        return;
      }
    }
    items.push_back(item_of(model, prefix + names.to_ldm(name).value(), name, shape, model.seed));
  };
  const std::string first = "text_model.encoder.layers.0.";
  for (const auto& [name, shape] : tensors) {
    add(name, shape);
    if (name.starts_with(first))
      add("text_model.encoder.layers." + std::to_string(num_layers) + "." + name.substr(first.size()), shape);
  }
  for (auto& [layer, item] : fused_items) items.push_back(std::move(item));
  const int64_t width = model.configs.text_encoder.hidden_size;
  items.push_back({prefix + "text_projection", {width, width}, {"text_projection"}, model.type, model.seed});
  items.push_back({prefix + "logit_scale", {}, {"logit_scale"}, model.type, model.seed});
  return items;
}

std::vector<Item> leftover_items(const Model& model) {
  std::vector<Item> items;
  for (const char* name : {"betas", "alphas_cumprod", "model_ema.diffusion_modelinput_blocks00weight",
                           "first_stage_model.loss.logvar", "cond_stage_model.logit_scale"})
    items.push_back({name, {10}, {name}, ElementType::kF32, model.seed});
  return items;
}

void append(std::vector<Item>& to, std::vector<Item> from) {
  to.insert(to.end(), std::make_move_iterator(from.begin()), std::make_move_iterator(from.end()));
}

Tensors unet_tensors(const Model& model) {
  return diffusion::tensors_of<diffusion::UNet>(model.configs.unet);
}
Tensors text_tensors(const Model& model) {
  return diffusion::tensors_of<diffusion::TextEncoder>(model.configs.text_encoder);
}
Tensors vae_tensors(const Model& model) {
  return diffusion::tensors_of<diffusion::Vae>(model.configs.vae);
}
Tensors controlnet_tensors(const Model& model) {
  return diffusion::tensors_of<diffusion::ControlNet>(model.configs.controlnet);
}
diffusion::NameMap vae_map(const Model& model) {
  return diffusion::vae_names(static_cast<int64_t>(model.configs.vae.block_out_channels.size()),
                              model.configs.vae.layers_per_block);
}

/// Shards of about equal numbers of tensors, and their index.
void write_shards(const fs::path& folder, const std::string& stem, const Model& model,
                  const std::vector<Item>& items, int num_shards) {
  nlohmann::json index{{"metadata", nlohmann::json::object()}, {"weight_map", nlohmann::json::object()}};
  const size_t per_shard =
      (items.size() + static_cast<size_t>(num_shards) - 1) / static_cast<size_t>(num_shards);
  for (int shard = 0; shard < num_shards; ++shard) {
    const auto begin = std::min(items.size(), static_cast<size_t>(shard) * per_shard);
    const auto end = std::min(items.size(), begin + per_shard);
    char number[40];
    std::snprintf(number, sizeof number, "-%05d-of-%05d.safetensors", shard + 1, num_shards);
    const std::vector<Item> part(items.begin() + static_cast<std::ptrdiff_t>(begin),
                                 items.begin() + static_cast<std::ptrdiff_t>(end));
    write_items(folder / (stem + number), model, part);
    for (const Item& item : part) index["weight_map"][item.stored] = stem + number;
  }
  write_file(folder / (stem + ".safetensors.index.json"), index.dump(2));
}

std::string lora_module(const std::string& module, LoraNaming naming, bool in_unet,
                        const diffusion::NameMap& ldm) {
  const auto flat = [](std::string text) {
    std::replace(text.begin(), text.end(), '.', '_');
    return text;
  };
  switch (naming) {
    case LoraNaming::kKohya:
      return (in_unet ? "lora_unet_" : "lora_te_") + flat(module);
    case LoraNaming::kKohyaLdm:
      return in_unet ? "lora_unet_" + flat(ldm.to_ldm(module).value()) : "lora_te_" + flat(module);
    case LoraNaming::kDiffusersProcessor: {
      if (!in_unet) return "text_encoder." + module;
      std::string path = module.ends_with(".to_out.0") ? module.substr(0, module.size() - 2) : module;
      return path.insert(path.rfind(".to_"), ".processor");
    }
    default:
      return (in_unet ? "unet." : "text_encoder.") + module;
  }
}

std::pair<std::string, std::string> lora_suffixes(LoraNaming naming, bool in_unet) {
  switch (naming) {
    case LoraNaming::kPeft:
      return {".lora_A.weight", ".lora_B.weight"};
    case LoraNaming::kDiffusersOld:
      return in_unet ? std::pair(".lora.down.weight", ".lora.up.weight")
                     : std::pair(".lora_linear_layer.down.weight", ".lora_linear_layer.up.weight");
    case LoraNaming::kDiffusersProcessor:
      return in_unet ? std::pair("_lora.down.weight", "_lora.up.weight")
                     : std::pair(".lora_linear_layer.down.weight", ".lora_linear_layer.up.weight");
    default:
      return {".lora_down.weight", ".lora_up.weight"};
  }
}

}  // namespace

void write_single_file(const fs::path& path, const Model& model, const SingleFileOptions& options) {
  std::vector<Item> items =
      ldm_items(model, unet_tensors(model), diffusion::unet_names(model.configs.unet.levels),
                "model.diffusion_model.", model.seed);
  if (options.vae)
    append(items,
           ldm_items(model, vae_tensors(model), vae_map(model), "first_stage_model.", model.seed, true));
  if (options.text_encoder) {
    if (model.configs.family == Family::kSd2) {
      append(items, openclip_items(model, text_tensors(model)));
    } else {
      for (Item& item : plain_items(model, text_tensors(model), model.seed)) {
        item.stored = "cond_stage_model.transformer." + item.stored;
        items.push_back(std::move(item));
      }
    }
  }
  if (options.leftovers) append(items, leftover_items(model));
  write_items(path, model, items);
}

void write_diffusers_folder(const fs::path& folder, const Model& model, const FolderOptions& options) {
  const std::string ending = (options.variant.empty() ? "" : "." + options.variant) + ".safetensors";
  const auto component = [&](const char* name, const std::string& config, const std::string& stem,
                             const std::vector<Item>& items) {
    write_file(folder / name / "config.json", config);
    write_items(folder / name / (stem + ending), model, items);
  };
  const std::string stem = "diffusion_pytorch_model";
  const Configs& configs = model.configs;
  const std::vector<Item> unet = plain_items(model, unet_tensors(model), model.seed);
  if (options.num_shards > 1) {
    write_file(folder / "unet" / "config.json", config_json(configs.unet));
    write_shards(folder / "unet", stem, model, unet, options.num_shards);
  } else {
    component("unet", config_json(configs.unet), stem, unet);
  }
  component("vae", config_json(configs.vae), stem, plain_items(model, vae_tensors(model), model.seed));
  component("text_encoder", config_json(configs.text_encoder), "model",
            plain_items(model, text_tensors(model), model.seed));
  for (const bool normal : {false, true})
    component(normal ? "controlnet_normal" : "controlnet_tile", config_json(configs.controlnet), stem,
              plain_items(model, controlnet_tensors(model), model.seed + (normal ? 1 : 0)));
  write_file(folder / "scheduler" / "scheduler_config.json",
             std::string(R"({"_class_name": "PNDMScheduler", "beta_start": 0.00085, "beta_end": 0.012,
 "beta_schedule": "scaled_linear", "num_train_timesteps": 1000, "steps_offset": 1, "skip_prk_steps": true,
 "set_alpha_to_one": false, "prediction_type": "epsilon"})"));
  write_file(folder / "model_index.json", std::string(R"({"_class_name": "StableDiffusionPipeline"})"));
  if (!options.tokenizer.empty())
    fs::copy(options.tokenizer, folder / "tokenizer",
             fs::copy_options::recursive | fs::copy_options::overwrite_existing);
}

void write_controlnet(const fs::path& path, const Model& model, Layout layout, bool normal) {
  const uint64_t seed = model.seed + (normal ? 1 : 0);
  const Tensors tensors = controlnet_tensors(model);
  if (layout == Layout::kDiffusers) return write_items(path, model, plain_items(model, tensors, seed));
  const auto& config = model.configs.controlnet;
  const diffusion::NameMap names =
      diffusion::controlnet_names(config.unet.levels, static_cast<int64_t>(config.embedding_channels.size()));
  write_items(path, model,
              ldm_items(model, tensors, names, layout == Layout::kLdmPrefixed ? "control_model." : "", seed));
}

void write_vae(const fs::path& path, const Model& model, Layout layout) {
  const Tensors tensors = vae_tensors(model);
  if (layout == Layout::kDiffusers) return write_items(path, model, plain_items(model, tensors, model.seed));
  write_items(path, model,
              ldm_items(model, tensors, vae_map(model),
                        layout == Layout::kLdmPrefixed ? "first_stage_model." : "", model.seed, true));
}

void write_lora(const fs::path& path, const Model& model, const LoraOptions& options) {
  const bool kohya = options.naming == LoraNaming::kKohya || options.naming == LoraNaming::kKohyaLdm;
  const diffusion::NameMap ldm = diffusion::unet_names(model.configs.unet.levels);
  std::vector<Item> items;
  std::vector<nn::TensorPlan> alphas;
  const auto add_network = [&](const Tensors& tensors, bool in_unet) {
    const auto [down, up] = lora_suffixes(options.naming, in_unet);
    for (const auto& [name, shape] : tensors) {
      const bool projection =
          name.find(".attn") != std::string::npos || name.find(".self_attn.") != std::string::npos;
      const bool convolution = options.convolutions && shape.size() == 4 && shape[2] == 3;
      if (!name.ends_with(".weight") || shape.size() < 2 || (!projection && !convolution)) continue;
      const std::string module = name.substr(0, name.size() - std::string_view(".weight").size());
      const std::string stored = lora_module(module, options.naming, in_unet, ldm);
      Shape a = shape, b(shape.size(), 1);
      a[0] = b[1] = options.rank, b[0] = shape[0];
      if (convolution && options.cores) {
        a[2] = a[3] = 1;
        items.push_back(item_of(model, stored + ".lora_mid.weight", name + ".mid",
                                {options.rank, options.rank, shape[2], shape[3]}, model.seed));
      }
      items.push_back(item_of(model, stored + down, name + ".down", a, model.seed));
      items.push_back(item_of(model, stored + up, name + ".up", b, model.seed));
      if (kohya) alphas.push_back({stored + ".alpha", ElementType::kF32, {}});
    }
  };
  add_network(unet_tensors(model), true);
  if (options.text_encoder) add_network(text_tensors(model), false);

  std::vector<nn::TensorPlan> plans;
  for (const Item& item : items) plans.push_back({item.stored, item.type, item.shape});
  plans.insert(plans.end(), alphas.begin(), alphas.end());
  size_t next = 0;
  nn::write_safetensors(path, plans, [&](const nn::TensorPlan& plan, std::span<uint8_t> bytes) {
    if (next < items.size()) {
      const Item& item = items[next++];
      return fill_values(item.parts.front(), plan.shape,
                         static_cast<int64_t>(bytes.size()) / nn::bytes_of(item.type), item.seed, item.type,
                         bytes);
    }
    const auto alpha = static_cast<float>(options.alpha);
    std::memcpy(bytes.data(), &alpha, sizeof alpha);
  });
}

}  // namespace patina::make_checkpoint
