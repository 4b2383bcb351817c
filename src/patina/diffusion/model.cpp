#include "patina/diffusion/model.h"

#include <cstdio>

#include <ATen/ATen.h>
#include <c10/core/InferenceMode.h>

#include "patina/base/bf16.h"
#include "patina/base/error.h"
#include "patina/diffusion/control_kinds.h"
#include "patina/diffusion/files/unet_blocks.h"
#include "patina/diffusion/model_state.h"
#include "patina/diffusion/networks/component.h"
#include "patina/diffusion/prediction.h"

namespace patina::diffusion {
namespace {

/// Smaller networks run in f32: it is exact, and they take no time. patina-mini is above (four views of 256²:
/// 11 s in f32, 4 s in bf16, the same pictures to 56 dB).
constexpr int64_t kLargeNetwork = 5'000'000;  // parameters

Device resolve(Device wanted) {
  return wanted == Device::kAuto ? (has_cuda() ? Device::kCuda : Device::kCpu) : wanted;
}

/// bf16 pays where the processor multiplies it natively; on CUDA always, and the biased attention needs 16
/// bits there.
Dtype resolve(Dtype wanted, Device device, const TensorTable& unet) {
  if (wanted != Dtype::kAuto) return wanted;
  if (device == Device::kCuda) return Dtype::kBf16;
  int64_t parameters = 0;
  for (const auto& [name, tensor] : unet.tensors) parameters += tensor.entry.num_elements();
  return multiplies_bf16() && parameters >= kLargeNetwork ? Dtype::kBf16 : Dtype::kF32;
}

at::ScalarType scalar_type(Dtype dtype) {
  return dtype == Dtype::kBf16 ? at::kBFloat16 : dtype == Dtype::kF16 ? at::kHalf : at::kFloat;
}

const char* name_of(Dtype dtype) {
  return dtype == Dtype::kBf16 ? "bf16" : dtype == Dtype::kF16 ? "f16" : "f32";
}

/// One size of a network against that of another.
void check_size(int64_t found, int64_t expected, const std::string& what) {
  if (found != expected) {
    throw Error(ErrorCode::kFormat, "model",
                what + ": found " + std::to_string(found) + ", expected " + std::to_string(expected) +
                    "; the components belong to different models");
  }
}

void check_text_width(const UNetConfig& network, int64_t text_width, const std::string& what) {
  for (const LevelConfig& level : network.levels) {
    if (level.down_attention || level.up_attention) check_size(level.cross_attention_dim, text_width, what);
  }
}

/// A ControlNet adds to what the U-Net keeps on its way down.
void check_fit(const ControlNetConfig& control, const std::string& name, const Model::State& state,
               int64_t text_width) {
  const UNetConfig &copy = control.unet, &unet = state.unet.config();
  const std::string what = "ControlNet " + name + ": ";
  const std::vector<int64_t> kept = skip_channels(unet.levels), found = skip_channels(copy.levels);
  check_size(copy.in_channels, unet.in_channels, what + "in_channels");
  check_size(static_cast<int64_t>(found.size()), static_cast<int64_t>(kept.size()),
             what + "number of residuals");
  for (size_t i = 0; i < kept.size(); ++i) check_size(found[i], kept[i], what + "channels of a residual");
  check_text_width(copy, text_width, what + "cross_attention_dim");
  check_size(int64_t{1} << (control.embedding_channels.size() - 1), state.vae.config().latent_scale(),
             what + "pixels a latent pixel");
}

/// The networks must fit each other: what one gives is what the next takes.
void check_fit(const Model::State& state) {
  const UNetConfig& unet = state.unet.config();
  int64_t text_width = 0;
  for (const TextStage& text : state.texts) text_width += text.encoder.config().hidden_size;
  check_text_width(unet, text_width, "cross_attention_dim of the U-Net against the text encoder's width");
  check_size(unet.in_channels, state.vae.config().latent_channels,
             "in_channels of the U-Net against the VAE's latent channels");
  check_size(unet.out_channels, unet.in_channels, "out_channels of the U-Net");
  check_size(state.vae.config().in_channels, 3, "in_channels of the VAE");
  for (size_t i = 0; i < kControlKinds.size(); ++i)
    check_fit(state.controlnets[i].config(), kControlKinds[i].name, state, text_width);
}

/// All text encoders with their tokenizers and words.
std::vector<TextStage> load_texts(const ModelParts& parts, nn::Placement placement, bool resident) {
  std::vector<TextStage> stages;
  for (size_t i = 0; i < parts.texts.size(); ++i) {
    const TextPart& text = parts.texts[i];
    stages.push_back(
        {Tokenizer(text.tokenizer, text.pad_id),
         hold_network<TextEncoder>(text.encoder, placement, resident, parts.loras.text_encoders[i]),
         load_words(text.words, text.encoder.config, placement)});
  }
  return stages;
}

std::vector<Held<ControlNet>> load_controlnets(const ModelParts& parts, nn::Placement placement,
                                               bool resident) {
  std::vector<Held<ControlNet>> networks;
  for (const ControlNetPart& part : parts.controlnets)
    networks.push_back(hold_network<ControlNet>(part, placement, resident));
  return networks;
}

}  // namespace

bool has_cuda() {
  return at::hasCUDA();
}

void check_device(Device device, Dtype dtype) {
  if (device == Device::kCuda && !has_cuda())
    throw Error(
        ErrorCode::kDevice, "device",
        "is cuda, but there is no CUDA device here, or this patina was built without CUDA (docs/models.md)");
  if (dtype == Dtype::kF16 && resolve(device) == Device::kCpu)
    throw Error(ErrorCode::kUsage, "dtype", "f16 is for CUDA alone; on a processor take bf16 or f32");
}

Model::Model(const ModelParts& parts, const ModelOptions& options) {
  check_device(options.device, options.dtype);

  const c10::InferenceMode inference;
  const Device device = resolve(options.device);
  const Dtype dtype = resolve(options.dtype, device, parts.unet.table);
  const nn::Placement placement{scalar_type(dtype), device == Device::kCuda ? c10::kCUDA : c10::kCPU,
                                options.low_memory};
  const bool resident = !options.low_memory;
  state_ = std::make_unique<State>(State{dtype, device, load_texts(parts, placement, resident),
                                         load_network<UNet>(parts.unet, placement, &parts.loras.unet),
                                         hold_network<Vae>(parts.vae, placement, resident),
                                         load_controlnets(parts, placement, resident), parts.scheduler,
                                         parts.guidance, parts.notes});
  check_fit(*state_);
  if (parts.ask_prediction) {
    state_->scheduler.prediction = ask_prediction(state_->unet, state_->scheduler);
    state_->notes.push_back(std::string("the U-Net predicts ") +
                            (state_->scheduler.prediction == Prediction::kV ? "v" : "noise") +
                            " by its answer to noise");
  }
}

Model::~Model() = default;
Model::Model(Model&&) noexcept = default;
Model& Model::operator=(Model&&) noexcept = default;

int Model::latent_scale() const {
  return static_cast<int>(state_->vae.config().latent_scale());
}
int Model::latent_channels() const {
  return static_cast<int>(state_->vae.config().latent_channels);
}
Dtype Model::dtype() const {
  return state_->dtype;
}
Device Model::device() const {
  return state_->device;
}

std::string Model::description() const {
  const State& s = *state_;
  const auto millions = [](int64_t count) {
    char text[32];
    std::snprintf(text, sizeof text, "%.1f M", static_cast<double>(count) * 1e-6);
    return std::string(text);
  };
  int64_t text_parameters = 0;
  for (const TextStage& text : s.texts) text_parameters += text.encoder.num_parameters();
  std::string notes;
  for (const std::string& note : s.notes) notes += "; " + note;
  return std::string(name_of(family_of(s.unet.config()))) + " architecture, U-Net " +
         millions(s.unet.num_parameters()) + ", ControlNets " + std::to_string(s.controlnets.size()) + " × " +
         millions(s.controlnets.front().num_parameters()) + ", VAE " + millions(s.vae.num_parameters()) +
         ", text encoder " + millions(text_parameters) + " parameters, " + name_of(s.dtype) +
         (s.device == Device::kCuda ? " on CUDA" : "") + notes;
}

Guidance guidance_of(const Model& model, const EditOptions& options) {
  const Guidance& defaults = model.state().guidance;
  Guidance guidance{options.guidance_scale == kAutoGuidanceScale ? defaults.scale : options.guidance_scale,
                    options.negative_prompt.value_or(defaults.negative_prompt)};
  if (guidance.scale == 1) guidance.negative_prompt.clear();
  return guidance;
}

}  // namespace patina::diffusion
