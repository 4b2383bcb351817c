#include "patina/diffusion/model.h"

#include <cstdio>

#include <ATen/ATen.h>
#include <ATen/Parallel.h>
#include <c10/core/InferenceMode.h>

#include "patina/base/error.h"
#include "patina/base/parallel.h"
#include "patina/diffusion/model_parts.h"
#include "patina/diffusion/model_state.h"
#include "patina/diffusion/networks/component.h"
#include "patina/diffusion/prediction.h"

namespace patina::diffusion {
namespace {

/// Smaller networks run in f32: it is exact, and they take no time. patina-mini is above (four views of 256²:
/// 11 s in f32, 4 s in bf16, the same pictures to 56 dB).
constexpr int64_t kLargeNetwork = 5'000'000;  // parameters

Device resolve(Device wanted) {
  return wanted == Device::kAuto ? (at::hasCUDA() ? Device::kCuda : Device::kCpu) : wanted;
}

/// bf16 pays where the processor multiplies it natively; on CUDA always, and the biased attention needs 16
/// bits there.
Dtype resolve(Dtype wanted, Device device, const TensorTable& unet) {
  if (wanted != Dtype::kAuto) return wanted;
  if (device == Device::kCuda) return Dtype::kBf16;
  int64_t parameters = 0;
  for (const auto& [name, tensor] : unet.tensors) parameters += tensor.entry.num_elements();
  return __builtin_cpu_supports("avx512bf16") && parameters >= kLargeNetwork ? Dtype::kBf16 : Dtype::kF32;
}

at::ScalarType scalar_type(Dtype dtype) {
  return dtype == Dtype::kBf16 ? at::kBFloat16 : dtype == Dtype::kF16 ? at::kHalf : at::kFloat;
}

const char* name_of(Dtype dtype) {
  return dtype == Dtype::kBf16 ? "bf16" : dtype == Dtype::kF16 ? "f16" : "f32";
}

/// The networks must fit each other: what one gives is what the next takes.
void check_fit(const Model::State& state) {
  const auto check = [](int64_t found, int64_t expected, const char* what) {
    if (found != expected) {
      throw Error(ErrorCode::kFormat, "model",
                  std::string(what) + ": found " + std::to_string(found) + ", expected " +
                      std::to_string(expected) + "; the components belong to different models");
    }
  };
  const UNetConfig& unet = state.unet.config();
  for (const LevelConfig& level : unet.levels) {
    if (level.down_attention || level.up_attention) {
      check(level.cross_attention_dim, state.text_encoder.config().hidden_size,
            "cross_attention_dim of the U-Net against the text encoder's width");
    }
  }
  check(unet.in_channels, state.vae.config().latent_channels,
        "in_channels of the U-Net against the VAE's latent channels");
  check(unet.out_channels, unet.in_channels, "out_channels of the U-Net");
  check(state.vae.config().in_channels, 3, "in_channels of the VAE");
  const std::vector<int64_t> kept = skip_channels(unet);
  for (const auto& [control, name] :
       {std::pair(&state.controlnet_tile, "tile"), std::pair(&state.controlnet_normal, "normal")}) {
    const UNetConfig& copy = control->config().unet;
    const std::string what = std::string("ControlNet ") + name + ": ";
    check(copy.in_channels, unet.in_channels, (what + "in_channels").c_str());
    check(static_cast<int64_t>(skip_channels(copy).size()), static_cast<int64_t>(kept.size()),
          (what + "number of residuals").c_str());
    for (size_t i = 0; i < kept.size(); ++i)
      check(skip_channels(copy)[i], kept[i], (what + "channels of a residual").c_str());
    for (const LevelConfig& level : copy.levels) {
      if (level.down_attention) {
        check(level.cross_attention_dim, state.text_encoder.config().hidden_size,
              (what + "cross_attention_dim").c_str());
      }
    }
    check(int64_t{1} << (control->config().embedding_channels.size() - 1), state.vae.config().latent_scale(),
          (what + "pixels a latent pixel").c_str());
  }
}

}  // namespace

void check_device(Device device, Dtype dtype) {
  if (device == Device::kCuda && !at::hasCUDA())
    throw Error(ErrorCode::kDevice, "--device cuda",
                "there is no CUDA device here, or this patina was built without CUDA (docs/models.md)");
  if (dtype == Dtype::kF16 && resolve(device) == Device::kCpu)
    throw Error(ErrorCode::kUsage, "--dtype f16", "is for --device cuda; on a processor take bf16 or f32");
}

Model::Model(const ModelPaths& paths, const ModelOptions& options) {
  check_device(options.device, options.dtype);
  if (options.num_threads < 0) {
    throw Error(ErrorCode::kUsage, "threads",
                "is " + std::to_string(options.num_threads) + ", expected 0 (all) or more");
  }
  set_num_threads(options.num_threads);
  at::set_num_threads(patina::num_threads());

  const c10::InferenceMode inference;
  const ModelParts parts = find_model_parts(paths);
  const Device device = resolve(options.device);
  const Dtype dtype = resolve(options.dtype, device, parts.unet.table);
  const nn::Placement placement{scalar_type(dtype), device == Device::kCuda ? c10::kCUDA : c10::kCPU,
                                options.low_memory};
  const bool resident = !options.low_memory;
  state_ = std::unique_ptr<State>(
      new State{dtype, device, Tokenizer(parts.tokenizer, parts.pad_id),
                hold_network<TextEncoder>(parts.text_encoder, placement, resident, parts.loras.text_encoder),
                load_network<UNet>(parts.unet, placement, &parts.loras.unet),
                hold_network<Vae>(parts.vae, placement, resident),
                hold_network<ControlNet>(parts.controlnet_tile, placement, resident),
                hold_network<ControlNet>(parts.controlnet_normal, placement, resident), parts.scheduler,
                parts.guidance, load_words(parts.words, parts.text_encoder.config, placement), parts.notes});
  check_fit(*state_);
  if (parts.ask_prediction) {
    state_->scheduler.prediction = ask_prediction(state_->unet, state_->scheduler);
    state_->notes.push_back(std::string("the U-Net predicts ") +
                            (state_->scheduler.prediction == Prediction::kV ? "v" : "noise") +
                            " by its answer to noise (--prediction says otherwise)");
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
  std::string notes;
  for (const std::string& note : s.notes) notes += "; " + note;
  return std::string(name_of(family_of(s.unet.config()))) + " architecture, U-Net " +
         millions(s.unet.num_parameters()) + ", ControlNets 2 × " +
         millions(s.controlnet_tile.num_parameters()) + ", VAE " + millions(s.vae.num_parameters()) +
         ", text encoder " + millions(s.text_encoder.num_parameters()) + " parameters, " + name_of(s.dtype) +
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
