// Options of the diffusion model: where its parts lie, and how they run.
#include "patina/pipeline/option_groups.h"
#include "patina/pipeline/option_kinds.h"

namespace patina::pipeline {

using namespace option_kinds;
using diffusion::Device;
using diffusion::Dtype;
using diffusion::LoraChoice;
using diffusion::PredictionChoice;

namespace {

namespace fs = std::filesystem;

const Place<EditSettings> kModelPlace{"Model", &Config::edit, kEdit};

/// FILE or FILE:WEIGHT; a file's name may hold colons itself.
Kind<LoraChoice> lora() {
  return {.kind = ValueKind::kText,
          .expected = "FILE or FILE:WEIGHT with a weight from -10 to 10",
          .decode = [](const json& value) -> std::optional<LoraChoice> {
            if (!value.is_string()) return std::nullopt;
            const std::string given = value.get<std::string>();
            const size_t colon = given.rfind(':');
            if (colon == std::string::npos || fs::exists(given)) return LoraChoice{given, 1.0f};
            const json weight = json::parse(given.substr(colon + 1), nullptr, /*allow_exceptions=*/false);
            const std::optional<float> decoded = number(-10, 10).decode(weight);
            if (colon == 0 || !decoded) return std::nullopt;
            return LoraChoice{given.substr(0, colon), *decoded};
          },
          .encode =
              [](const LoraChoice& choice) {
                return json(fmt::format("{}:{}", choice.file.string(), choice.weight));
              }};
}

}  // namespace

std::vector<Option> model_options() {
  const auto& at = kModelPlace;
  std::vector<Option> list{
      option(
          at,
          {.name = "model",
           .aliases = {"-m"},
           .placeholder = "PATH",
           .help = "Diffusion model (Stable Diffusion 1.x or 2.x): a diffusers folder, a .safetensors "
                   "checkpoint, or the name of one in the model folders.",
           .default_text = "patina-mini, which comes with patina"},
          path(), [](auto& s) -> auto& { return s.model.model; }),
      option(
          at,
          {.name = "controlnet-tile",
           .placeholder = "PATH",
           .help = "ControlNet that is given the render: a diffusers folder, a .safetensors file or a "
                   "name.",
           .default_text = "MODEL/controlnet_tile, else by name in the model folders"},
          path(), [](auto& s) -> auto& { return s.model.controlnet_tile; }),
      option(
          at,
          {.name = "controlnet-normal",
           .placeholder = "PATH",
           .help = "ControlNet that is given the normals: a diffusers folder, a .safetensors file or a "
                   "name.",
           .default_text = "MODEL/controlnet_normal, else by name in the model folders"},
          path(), [](auto& s) -> auto& { return s.model.controlnet_normal; }),
      option(
          at,
          {.name = "vae",
           .placeholder = "PATH",
           .help = "VAE to use in place of the model's own.",
           .default_text = "the model's own"},
          path(), [](auto& s) -> auto& { return s.model.vae; }),
      option(
          at,
          {.name = "text-encoder",
           .placeholder = "PATH",
           .help = "Text encoder to use in place of the model's own.",
           .default_text = "the model's own"},
          path(), [](auto& s) -> auto& { return s.model.text_encoder; }),
      option(
          at,
          {.name = "tokenizer",
           .placeholder = "DIR",
           .help = "Folder with CLIP's merges.txt and vocab.json, for checkpoints without one.",
           .default_text = "the model's own, else searched (docs/models.md)"},
          path(), [](auto& s) -> auto& { return s.model.tokenizer; }),
      list_option(
          at,
          {.name = "lora",
           .placeholder = "FILE:WEIGHT",
           .help = "LoRAs to merge into the model, and how much of each.",
           .default_text = "none"},
          lora(), [](auto& s) -> auto& { return s.model.loras; }),
      list_option(
          at,
          {.name = "embedding",
           .placeholder = "FILE",
           .help = "Textual inversions: their words may then stand in the prompts. Those in the model "
                   "folders need not be named.",
           .default_text = "none"},
          path(), [](auto& s) -> auto& { return s.model.embeddings; }),
      list_option(
          at,
          {.name = "model-dir",
           .placeholder = "DIR",
           .help = "Folders of models, such as that of ComfyUI or AUTOMATIC1111, in which names are "
                   "looked for.",
           .default_text = "none"},
          path(), [](auto& s) -> auto& { return s.model.model_dirs; }),
      option(
          at,
          {.name = "clip-skip",
           .placeholder = "N",
           .help = "1 runs the whole text encoder. 2 leaves out its last layer, as some fine-tunes want."},
          integer(1, 24), [](auto& s) -> auto& { return s.options.clip_skip; }),
      option(
          at,
          {.name = "prediction",
           .help = "What the U-Net was trained to predict. auto finds out (docs/models.md)."},
          choice<PredictionChoice>({{"auto", PredictionChoice::kAuto},
                                    {"epsilon", PredictionChoice::kEpsilon},
                                    {"v", PredictionChoice::kV}}),
          [](auto& s) -> auto& { return s.model.prediction; }),
      option(
          at,
          {.name = "dtype",
           .help = "Arithmetic of the networks. auto takes bf16 where it is faster here. f16 needs "
                   "--device cuda."},
          choice<Dtype>(
              {{"auto", Dtype::kAuto}, {"f32", Dtype::kF32}, {"bf16", Dtype::kBf16}, {"f16", Dtype::kF16}}),
          [](auto& s) -> auto& { return s.dtype; }),
      option(
          at,
          {.name = "device",
           .help = "Where the networks run. auto takes a GPU if this patina was built with CUDA and finds "
                   "one."},
          choice<Device>({{"auto", Device::kAuto}, {"cpu", Device::kCpu}, {"cuda", Device::kCuda}}),
          [](auto& s) -> auto& { return s.device; }),
      option(
          at,
          {.name = "low-memory",
           .help = "Keep only the U-Net in memory, with its weights in their smallest form. Text encoder, "
                   "ControlNets and VAE are read anew for each use. Pictures differ by rounding."},
          truth(), [](auto& s) -> auto& { return s.low_memory; }),
  };
  // The renders' resolution follows from the model where it is not given.
  list.front().parts |= kRender;
  return list;
}

}  // namespace patina::pipeline
