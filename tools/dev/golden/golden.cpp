#include "dev/golden/golden.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <nlohmann/json.hpp>

#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>

#include "dev/golden/golden_compare.h"
#include "patina/base/error.h"
#include "patina/base/files.h"

namespace patina::diffusion {

namespace fs = std::filesystem;

namespace golden {

void Comparison::fail(std::string why) {
  if (result_.fault.empty()) result_.fault = std::move(why);
}

void Comparison::add(const std::string& tensor, const at::Tensor& found, const at::Tensor& expected,
                     Limit limit) {
  at::Tensor value = found;
  if (found.dim() == 3 && expected.dim() == 4 && found.size(1) == expected.size(2) * expected.size(3)) {
    value = nn::image_from_tokens(found, expected.size(2), expected.size(3));
  } else if (found.dim() == 4 && expected.dim() == 3 && found.size(2) * found.size(3) == expected.size(1)) {
    value = nn::tokens_from_image(found);
  }
  if (value.sizes() != expected.sizes()) {
    return fail(tensor + " has the shape " + nn::shape_text(found.sizes().vec()) + ", expected " +
                nn::shape_text(expected.sizes().vec()));
  }
  ++result_.num_tensors;
  if (expected.numel() == 0) return;
  const at::Tensor a = value.to(at::kDouble), b = expected.to(at::kDouble);
  double difference = (a - b).abs().max().item<double>();
  if (std::isnan(difference)) difference = std::numeric_limits<double>::infinity();
  const double allowed = limit.absolute + limit.relative * b.abs().max().item<double>();
  // Cross-multiplied, since a limit may be 0.
  if (result_.worst.empty() || difference * result_.limit > result_.difference * allowed) {
    result_.worst = tensor, result_.difference = difference, result_.limit = allowed;
  }
}

at::Tensor Stored::operator[](const std::string& name) const {
  const nn::TensorEntry* entry = file_.find(name);
  if (!entry) throw Error(ErrorCode::kFormat, file_.path().string(), "lacks the tensor " + name);
  const bool floating = entry->type == nn::ElementType::kF32 || entry->type == nn::ElementType::kF64 ||
                        entry->type == nn::ElementType::kF16 || entry->type == nn::ElementType::kBF16;
  return nn::read_tensor(file_, *entry, floating ? at::kFloat : at::kLong);
}

std::vector<std::string> Stored::names(const std::string& prefix) const {
  std::vector<std::string> names;
  for (const nn::TensorEntry& entry : file_.tensors()) {
    if (entry.name.starts_with(prefix)) names.push_back(entry.name);
  }
  return names;
}

std::string Stored::metadata(const std::string& key) const {
  const auto found = file_.metadata().find(key);
  if (found == file_.metadata().end())
    throw Error(ErrorCode::kFormat, file_.path().string(), "lacks the metadata " + key);
  return found->second;
}

const Tokenizer& Parts::tokenizer() {
  if (!tokenizer_) tokenizer_.emplace(folder_ / "tokenizer");
  return *tokenizer_;
}
const TextEncoder& Parts::text_encoder() {
  if (!text_encoder_) text_encoder_.emplace(folder_ / "text_encoder", at::kFloat);
  return *text_encoder_;
}
const UNet& Parts::unet() {
  if (!unet_) unet_.emplace(folder_ / "unet", at::kFloat);
  return *unet_;
}
const Vae& Parts::vae() {
  if (!vae_) vae_.emplace(folder_ / "vae", at::kFloat);
  return *vae_;
}
const Held<ControlNet>& Parts::controlnet(const std::string& name) {
  const auto found = controlnets_.find(name);
  if (found != controlnets_.end()) return found->second;
  ControlNet network(folder_ / ("controlnet_" + name), at::kFloat);
  return controlnets_.emplace(name, Held<ControlNet>(std::move(network))).first->second;
}

namespace {

/// Compares every stored activation "act/<module path>" with what the network recorded under that path.
class Activations {
 public:
  nn::Recorder recorder() {
    return nn::Recorder(
        [this](const std::string& path, const at::Tensor& output) { recorded_[path] = output; });
  }
  void compare(const Stored& stored, Comparison& comparison) const {
    const std::string prefix = "act/";
    for (const std::string& name : stored.names(prefix)) {
      const auto found = recorded_.find(name.substr(prefix.size()));
      if (found == recorded_.end())
        return comparison.fail("the network has no module " + name.substr(prefix.size()));
      comparison.add(name, found->second, stored[name], kModuleLimit);
    }
  }

 private:
  std::map<std::string, at::Tensor> recorded_;
};

void check_tokenizer(const fs::path& file, Parts& parts, Comparison& comparison) {
  const nlohmann::json json = nlohmann::json::parse(read_text_file(file));
  const auto compare = [&](const std::string& name, const std::vector<int64_t>& found,
                           const nlohmann::json& expected) {
    const auto ids = expected.get<std::vector<int64_t>>();
    if (found.size() != ids.size()) {
      return comparison.fail(name + " gives " + std::to_string(found.size()) + " tokens, expected " +
                             std::to_string(ids.size()));
    }
    comparison.add(name, at::tensor(found, at::kLong), at::tensor(ids, at::kLong), {0, 0});
  };
  for (const nlohmann::json& test : json.at("cases")) {
    // Where the reference's own tokenizers differ among each other, either answer is right.
    if (!test.at("agree").get<bool>()) continue;
    const auto name = test.at("name").get<std::string>(), prompt = test.at("prompt").get<std::string>();
    compare(name, parts.tokenizer().encode(prompt), test.at("ids"));
    compare(name, parts.tokenizer().encode_padded(prompt, 77), test.at("ids_77"));
  }
}

void check_text_encoder(const Stored& stored, Parts& parts, Comparison& comparison) {
  Activations activations;
  const at::Tensor ids = stored["input_ids"];
  const TextConditioning encoding = parts.text_encoder()(ids, 1, activations.recorder());
  if (stored.has("last_hidden_state")) {
    comparison.add("last_hidden_state", encoding.tokens, stored["last_hidden_state"], kModuleLimit);
  }
  if (stored.has("pooler_output"))
    comparison.add("pooler_output", encoding.pooled, stored["pooler_output"], kModuleLimit);
  const std::string skip = "clip_skip_";
  for (const std::string& name : stored.names(skip)) {
    const int clip_skip = std::stoi(name.substr(skip.size()));
    comparison.add(name, parts.text_encoder()(ids, clip_skip).tokens, stored[name], kModuleLimit);
  }
  activations.compare(stored, comparison);
}

void check_vae_encode(const Stored& stored, Parts& parts, Comparison& comparison) {
  Activations activations;
  const Posterior posterior = parts.vae().encode(stored["image"], activations.recorder());
  comparison.add("mean", posterior.mean, stored["mean"], kModuleLimit);
  if (stored.has("logvar")) comparison.add("logvar", posterior.logvar, stored["logvar"], kModuleLimit);
  if (stored.has("std")) comparison.add("std", at::exp(0.5 * posterior.logvar), stored["std"], kModuleLimit);
  if (stored.has("moments")) {
    // The posterior's logvar is clamped, the stored moments are not: compare where that changes nothing.
    const std::vector<at::Tensor> halves = stored["moments"].chunk(2, 1);
    comparison.add("moments", at::cat({posterior.mean, posterior.logvar}, 1),
                   at::cat({halves[0], at::clamp(halves[1], -30, 20)}, 1), kModuleLimit);
  }
  activations.compare(stored, comparison);
}

void check_vae_decode(const Stored& stored, Parts& parts, Comparison& comparison) {
  Activations activations;
  at::Tensor latent = stored.has("latent") ? stored["latent"] : at::Tensor();
  if (stored.has("latent_scaled")) {
    const at::Tensor unscaled = stored["latent_scaled"] / parts.vae().config().scaling_factor;
    if (latent.defined()) comparison.add("latent", unscaled, latent, kModuleLimit);
    latent = unscaled;
  }
  comparison.add("image", parts.vae().decode(latent, activations.recorder()), stored["image"], kModuleLimit);
  activations.compare(stored, comparison);
}

void check_timestep_embedding(const Stored& stored, Parts&, Comparison& comparison) {
  const at::Tensor expected = stored["embedding"];
  comparison.add(
      "embedding",
      timestep_embedding(stored["timesteps"], expected.size(1), /*flip_sin_to_cos=*/true, /*freq_shift=*/0),
      expected, kEmbeddingLimit);
}

NetworkInputs unet_inputs(const Stored& stored) {
  return {stored["sample"], stored["timestep"], {stored["encoder_hidden_states"], {}}};
}

void check_unet(const Stored& stored, Parts& parts, Comparison& comparison) {
  Activations activations;
  comparison.add("out", parts.unet()(unet_inputs(stored), {}, activations.recorder()), stored["out"],
                 kModuleLimit);
  activations.compare(stored, comparison);
}

/// The stored pairs (query, key) of a level of height × width pixels. With windows of one cell a query's
/// bucket is all of its biased keys, so buckets can hold any set of pairs.
attention::KeyBuckets buckets_from_pairs(const at::Tensor& pairs, int64_t height, int64_t width) {
  attention::KeyBuckets buckets;
  buckets.view_width = static_cast<int>(width), buckets.view_height = static_cast<int>(height);
  std::vector<std::vector<int32_t>> rows(static_cast<size_t>(height * width));
  const auto values = pairs.accessor<int64_t, 2>();
  for (int64_t i = 0; i < pairs.size(0); ++i) {
    if (values[i][0] < 0 || values[i][0] >= height * width)
      throw Error(ErrorCode::kFormat, "bias pairs", "a query lies outside the level");
    rows[static_cast<size_t>(values[i][0])].push_back(static_cast<int32_t>(values[i][1]));
  }
  buckets.offsets.push_back(0);
  for (std::vector<int32_t>& row : rows) {
    std::sort(row.begin(), row.end());
    buckets.keys.insert(buckets.keys.end(), row.begin(), row.end());
    buckets.offsets.push_back(static_cast<int32_t>(buckets.keys.size()));
  }
  return buckets;
}

void check_unet_bias(const Stored& stored, Parts& parts, Comparison& comparison) {
  const at::Tensor sample = stored["sample"];
  std::vector<attention::KeyBuckets> levels;
  int64_t height = sample.size(2), width = sample.size(3);
  size_t num_found = 0;
  for (size_t i = 0; i < parts.unet().config().levels.size(); ++i) {
    const std::string name = "pairs_" + std::to_string(height * width);
    if (stored.has(name)) levels.push_back(buckets_from_pairs(stored[name], height, width)), ++num_found;
    height = (height + 1) / 2, width = (width + 1) / 2;
  }
  if (num_found != stored.names("pairs_").size())
    return comparison.fail("some pairs_N belong to no level of the U-Net");

  Activations activations;
  NetworkInputs inputs = unet_inputs(stored);
  const nn::SelfAttentionBias bias{levels, stored["weight"].item<float>(), /*scaled_with_scores=*/true};
  if (stored.has("out_without_bias"))
    comparison.add("out_without_bias", parts.unet()(inputs), stored["out_without_bias"], kModuleLimit);
  inputs.bias = &bias;
  comparison.add("out", parts.unet()(inputs, {}, activations.recorder()), stored["out"], kModuleLimit);
  activations.compare(stored, comparison);
}

void compare_residuals(const ControlResiduals& residuals, const std::string& prefix, const Stored& stored,
                       Comparison& comparison) {
  if (stored.has(prefix + "mid"))
    comparison.add(prefix + "mid", residuals.mid, stored[prefix + "mid"], kModuleLimit);
  const size_t num_stored = stored.names(prefix + "down_").size();
  if (num_stored > 0 && num_stored != residuals.down.size())
    return comparison.fail("the ControlNet gives another number of residuals");
  for (size_t i = 0; i < num_stored; ++i) {
    const std::string name = prefix + "down_" + std::to_string(i);
    comparison.add(name, residuals.down[i], stored[name], kModuleLimit);
  }
}

void check_controlnet(const Stored& stored, const std::string& which, Parts& parts, Comparison& comparison) {
  Activations activations;
  const nn::Recorder record = activations.recorder();
  const ControlNet& network = *parts.controlnet(which).use();
  const float scale = stored.has("conditioning_scale") ? stored["conditioning_scale"].item<float>() : 1.0f;
  const NetworkInputs inputs = unet_inputs(stored);
  const at::Tensor hint = network.hint(stored["controlnet_cond"], record);
  compare_residuals(network(inputs, hint, scale, record), "", stored, comparison);
  activations.compare(stored, comparison);
}

void check_unet_controlnets(const Stored& stored, Parts& parts, Comparison& comparison) {
  const NetworkInputs inputs = unet_inputs(stored);
  if (stored.has("out_without_control")) {
    comparison.add("out_without_control", parts.unet()(inputs), stored["out_without_control"], kModuleLimit);
  }
  const at::Tensor scales = stored["scales"];
  ControlResiduals residuals;
  int64_t index = 0;
  for (const std::string name : {"tile", "normal"}) {
    const ControlNet& network = *parts.controlnet(name).use();
    residuals = sum(std::move(residuals),
                    network(inputs, network.hint(stored["cond_" + name]), scales[index++].item<float>()));
  }
  compare_residuals(residuals, "sum_", stored, comparison);
  comparison.add("out", parts.unet()(inputs, residuals), stored["out"], kModuleLimit);
}

/// Finds out what a file is and checks it; false if it is of no known kind.
bool check_known(const fs::path& file, const fs::path& root, Parts& parts, Comparison& comparison) {
  const std::string name = file.filename().string();
  if (name == "tokenizer_cases.json") return check_tokenizer(file, parts, comparison), true;
  if (file.extension() != ".safetensors") return false;
  if (file.parent_path() != root) {
    if (file.parent_path().filename() != "schedulers") return false;
    return check_scheduler(file, comparison), true;
  }
  const Stored stored(file);
  // Longer beginnings first.
  if (name.starts_with("text_encoder")) return check_text_encoder(stored, parts, comparison), true;
  if (name.starts_with("vae_encode_")) return check_vae_encode(stored, parts, comparison), true;
  if (name.starts_with("vae_decode_")) return check_vae_decode(stored, parts, comparison), true;
  if (name.starts_with("timestep_embedding_"))
    return check_timestep_embedding(stored, parts, comparison), true;
  if (name.starts_with("unet_attn_bias_")) return check_unet_bias(stored, parts, comparison), true;
  if (name.starts_with("unet_two_controlnets_"))
    return check_unet_controlnets(stored, parts, comparison), true;
  if (name.starts_with("unet_")) return check_unet(stored, parts, comparison), true;
  if (const std::string start = "controlnet_"; name.starts_with(start)) {
    const std::string which = name.substr(start.size(), name.find('_', start.size()) - start.size());
    return check_controlnet(stored, which, parts, comparison), true;
  }
  if (name.starts_with("e2e_txt2img_")) return check_text_to_image(stored, parts, comparison), true;
  if (name.starts_with("e2e_img2img_")) return check_image_to_image(stored, parts, comparison), true;
  return false;
}

}  // namespace
}  // namespace golden

struct GoldenChecker::State {
  golden::Parts parts;
  fs::path golden;
};

GoldenChecker::GoldenChecker(fs::path model, fs::path golden)
    : state_(new State{golden::Parts(std::move(model)), std::move(golden)}) {}
GoldenChecker::~GoldenChecker() = default;

GoldenResult GoldenChecker::check(const fs::path& file) {
  const c10::InferenceMode inference;
  golden::Comparison comparison(fs::relative(file, state_->golden).replace_extension().generic_string());
  try {
    if (!golden::check_known(file, state_->golden, state_->parts, comparison))
      comparison.fail("is of no known kind");
  } catch (const Error& error) {
    if (error.context() != file.string()) throw;  // the model's fault, not this file's
    comparison.fail(error.message());
  } catch (const nlohmann::json::exception& error) {
    comparison.fail(error.what());
  }
  GoldenResult result = comparison.result();
  if (result.fault.empty() && result.num_tensors == 0) result.fault = "holds nothing to compare";
  return result;
}

std::vector<fs::path> golden_files(const fs::path& folder) {
  if (!fs::is_directory(folder))
    throw Error(ErrorCode::kNotFound, folder.string(), "is no folder; expected one with golden files");
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    const bool index = name == "INDEX.json" || name == "index.json" || name == "tolerances.json" ||
                       name == "inputs.safetensors" || entry.path().extension() == ".md";
    if (entry.is_regular_file() && !index) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace patina::diffusion
