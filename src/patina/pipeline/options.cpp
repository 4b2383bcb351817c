#include "patina/pipeline/options.h"

#include <limits>

#include <fmt/format.h>

#include "patina/base/error.h"
#include "patina/pipeline/bundled_model.h"
#include "patina/pipeline/option_kinds.h"
#include "patina/pipeline/own_options.h"

namespace patina::pipeline {
namespace {

using correspond::NoiseMode;
using diffusion::BiasScaling;
using diffusion::Device;
using diffusion::Dtype;
using diffusion::PredictionChoice;
using diffusion::Scheduler;
using render::BsdfModel;
using namespace option_kinds;
using nlohmann::json;
namespace fs = std::filesystem;

std::vector<Option> make_options() {
  const std::string io = "Input and output", views = "Views", model = "Model", edit = "Edit",
                    priors = "Consistency between views", fit = "Inverse rendering", machine = "Machine";
  const Names<Scheduler> schedulers = {{"ddim", Scheduler::kDdim},
                                       {"pndm", Scheduler::kPndm},
                                       {"euler", Scheduler::kEuler},
                                       {"euler-a", Scheduler::kEulerAncestral},
                                       {"dpm++2m", Scheduler::kDpmSolverPp2m},
                                       {"dpm++2m-karras", Scheduler::kDpmSolverPp2mKarras},
                                       {"unipc", Scheduler::kUniPc}};
  std::vector<Option> list;
  const auto add = [&](Option option) { list.push_back(std::move(option)); };
  add(preset_option());

  add(text_option(
      {.name = "prompt",
       .aliases = {"-p"},
       .group = edit,
       .placeholder = "TEXT",
       .help = "What the asset shall look like, e.g. \"a rusty old kettle\".",
       .stages = kDetailStage},
      [](Config & c) -> auto& { return c.detail.prompt; }));
  add(negative_prompt_option(edit));
  add(number_option<float>(
      {.name = "strength",
       .aliases = {},
       .group = edit,
       .placeholder = "S",
       .help = "How far the views may move away from the renders: share of the steps that is run, 0.01 to 1.",
       .stages = kDetailStage},
      0.01f, 1.0f, [](Config & c) -> auto& { return c.detail.strength; }));
  add(guidance_scale_option(edit));
  add(number_option<int>(
      {.name = "steps",
       .aliases = {"-s"},
       .group = edit,
       .placeholder = "N",
       .help = "Steps of the scheduler; steps × strength of them are run.",
       .stages = kDetailStage},
      1, 1000, [](Config & c) -> auto& { return c.detail.num_steps; }));
  add(choice_option<Scheduler>(
      {.name = "scheduler",
       .aliases = {"--sampler"},
       .group = edit,
       .placeholder = "",
       .help = "How the noise is taken away step by step.",
       .stages = kDetailStage},
      schedulers, [](Config & c) -> auto& { return c.detail.scheduler; }));
  add(number_option<float>(
      {.name = "tile-scale",
       .aliases = {},
       .group = edit,
       .placeholder = "X",
       .help = "Weight of ControlNet tile, which holds on to the render's look.",
       .stages = kDetailStage},
      0.0f, 4.0f, [](Config & c) -> auto& { return c.detail.tile_scale; }));
  add(number_option<float>(
      {.name = "normal-scale",
       .aliases = {},
       .group = edit,
       .placeholder = "X",
       .help = "Weight of ControlNet normal, which holds on to the shape.",
       .stages = kDetailStage},
      0.0f, 4.0f, [](Config & c) -> auto& { return c.detail.normal_scale; }));
  add(number_option<float>(
      {.name = "fine-detail",
       .aliases = {},
       .group = edit,
       .placeholder = "SHARE",
       .help =
           "How much of what the VAE blurs in the renders (lettering, thin lines, edges) the edited views "
           "get back, 0 to 1; a --tile-scale below 1 takes it down as well.",
       .stages = kDetailStage},
      0.0f, 1.0f, [](Config & c) -> auto& { return c.detail.fine_detail; }));

  add(text_option(
      {.name = "output",
       .aliases = {"-o"},
       .group = io,
       .placeholder = "OUT.glb",
       .help = "Where the enhanced asset goes: .glb, .gltf or .obj."},
      [](Config & c) -> auto& { return c.output; }));
  add(text_option(
      {.name = "run",
       .aliases = {},
       .group = io,
       .placeholder = "DIR",
       .help = "Run folder: everything in between, kept. The same command continues a killed run there.",
       .default_text = "beside the output, OUT.patina-run"},
      [](Config & c) -> auto& { return c.run; }));
  add(materials_option());

  add(text_option(
      {.name = "model",
       .aliases = {"-m"},
       .group = model,
       .placeholder = "PATH",
       .help =
           "Diffusion model (Stable Diffusion 1.x or 2.x): a diffusers folder, a .safetensors checkpoint, or "
           "the name of one in the model folders.",
       .default_text = bundled_model().empty() ? "" : "patina-mini, which comes with patina",
       .stages = kDetailStage},
      [](Config & c) -> auto& { return c.model.model; }));
  add(text_option(
      {.name = "controlnet-tile",
       .aliases = {},
       .group = model,
       .placeholder = "PATH",
       .help = "ControlNet that is given the render: a diffusers folder, a .safetensors file or a name.",
       .default_text = "MODEL/controlnet_tile, else by name in the model folders",
       .stages = kDetailStage},
      [](Config & c) -> auto& { return c.model.controlnet_tile; }));
  add(text_option(
      {.name = "controlnet-normal",
       .aliases = {},
       .group = model,
       .placeholder = "PATH",
       .help = "ControlNet that is given the normals: a diffusers folder, a .safetensors file or a name.",
       .default_text = "MODEL/controlnet_normal, else by name in the model folders",
       .stages = kDetailStage},
      [](Config & c) -> auto& { return c.model.controlnet_normal; }));
  add(text_option(
      {.name = "vae",
       .aliases = {},
       .group = model,
       .placeholder = "PATH",
       .help = "VAE to use in place of the model's own.",
       .default_text = "the model's own",
       .stages = kDetailStage},
      [](Config & c) -> auto& { return c.model.vae; }));
  add(text_option(
      {.name = "text-encoder",
       .aliases = {},
       .group = model,
       .placeholder = "PATH",
       .help = "Text encoder to use in place of the model's own.",
       .default_text = "the model's own",
       .stages = kDetailStage},
      [](Config & c) -> auto& { return c.model.text_encoder; }));
  add(text_option(
      {.name = "tokenizer",
       .aliases = {},
       .group = model,
       .placeholder = "DIR",
       .help = "Folder with CLIP's merges.txt and vocab.json, for checkpoints that bring none.",
       .default_text = "the model's own, else searched (docs/models.md)",
       .stages = kDetailStage},
      [](Config & c) -> auto& { return c.model.tokenizer; }));
  add(loras_option(model));
  add(paths_option({.name = "embedding",
                    .aliases = {},
                    .group = model,
                    .placeholder = "FILE",
                    .help = "Textual inversion: its word may then stand in the prompts. Those in the model "
                            "folders need not be named.",
                    .default_text = "none",
                    .stages = kDetailStage},
                   [](Config& c) -> std::vector<fs::path>& { return c.model.embeddings; }));
  add(paths_option(
      {.name = "model-dir",
       .aliases = {},
       .group = model,
       .placeholder = "DIR",
       .help = "Folder of models, such as that of ComfyUI or AUTOMATIC1111, in which names are looked "
               "for; may be given several times.",
       .default_text = "none",
       .stages = kDetailStage},
      [](Config& c) -> std::vector<fs::path>& { return c.model.model_dirs; }));
  add(number_option<int>(
      {.name = "clip-skip",
       .aliases = {},
       .group = model,
       .placeholder = "N",
       .help = "1 runs the whole text encoder, 2 leaves out its last layer, as some fine-tunes want.",
       .stages = kDetailStage},
      1, 24, [](Config & c) -> auto& { return c.detail.clip_skip; }));
  add(choice_option<PredictionChoice>(
      {.name = "prediction",
       .aliases = {},
       .group = model,
       .placeholder = "",
       .help = "What the U-Net was trained to tell; auto finds out (docs/models.md).",
       .stages = kDetailStage},
      {{"auto", PredictionChoice::kAuto},
       {"epsilon", PredictionChoice::kEpsilon},
       {"v", PredictionChoice::kV}},
      [](Config & c) -> auto& { return c.model.prediction; }));
  add(choice_option<Dtype>(
      {.name = "dtype",
       .aliases = {},
       .group = model,
       .placeholder = "",
       .help =
           "Arithmetic of the networks; auto takes bf16 where it is faster here. f16 is for --device cuda.",
       .stages = kDetailStage},
      {{"auto", Dtype::kAuto}, {"f32", Dtype::kF32}, {"bf16", Dtype::kBf16}, {"f16", Dtype::kF16}},
      [](Config & c) -> auto& { return c.dtype; }));
  add(choice_option<Device>(
      {.name = "device",
       .aliases = {},
       .group = model,
       .placeholder = "",
       .help = "Where the networks run; auto takes a GPU if this patina was built with CUDA and finds one.",
       .stages = kDetailStage},
      {{"auto", Device::kAuto}, {"cpu", Device::kCpu}, {"cuda", Device::kCuda}},
      [](Config & c) -> auto& { return c.device; }));
  add(flag_option(
      {.name = "low-memory",
       .aliases = {},
       .group = model,
       .placeholder = "",
       .help = "Keep only the U-Net in memory, with its weights in their smallest form, and read text "
               "encoder, ControlNets and VAE anew for each use."},
      [](Config & c) -> auto& { return c.low_memory; }));

  add(views_option());
  add(resolution_option());
  add(elevations_option());
  add(degrees_option({.name = "azimuth",
                      .aliases = {},
                      .group = views,
                      .placeholder = "DEGREES",
                      .help = "Where the orbit starts, degrees about +Y; 0 looks at the asset's front (+Z).",
                      .stages = kRenderStage},
                     -360.0f, 360.0f, [](Config& c) -> float& { return c.orbit.azimuth_start; }));
  add(degrees_option({.name = "fov",
                      .aliases = {},
                      .group = views,
                      .placeholder = "DEGREES",
                      .help = "Field of view of the cameras, degrees.",
                      .stages = kRenderStage},
                     5.0f, 120.0f, [](Config& c) -> float& { return c.orbit.fov_y; }));
  add(number_option<float>(
      {.name = "distance",
       .aliases = {},
       .group = views,
       .placeholder = "METRES",
       .help = "From the asset's centre to the cameras, metres; 0 goes as near as lets every view hold all "
               "of it.",
       .stages = kRenderStage},
      0.0f, 1e12f, [](Config & c) -> auto& { return c.orbit.distance; }));
  add(text_option(
      {.name = "cameras",
       .aliases = {},
       .group = views,
       .placeholder = "FILE.json",
       .help = "Explicit cameras in place of the orbit, as views/cameras.json of a run folder writes them.",
       .stages = kRenderStage},
      [](Config & c) -> auto& { return c.cameras; }));
  add(text_option(
      {.name = "environment",
       .aliases = {},
       .group = views,
       .placeholder = "FILE.hdr",
       .help = "Light from around: an equirectangular .hdr or .exr.",
       .default_text = "built-in studio",
       .stages = kRenderStage | kFitStage | kReportStage},
      [](Config & c) -> auto& { return c.environment; }));
  add(text_option(
      {.name = "scene",
       .aliases = {},
       .group = views,
       .placeholder = "CONTEXT.glb",
       .help = "Floor, neighbours and lights around the asset: rendered, never changed.",
       .stages = kRenderStage | kDetailStage | kFitStage | kReportStage},
      [](Config & c) -> auto& { return c.scene; }));
  add(exposure_option());
  add(number_option<int>(
      {.name = "samples",
       .aliases = {},
       .group = views,
       .placeholder = "N",
       .help = "Light paths a pixel when the views are rendered.",
       .stages = kRenderStage | kReportStage},
      1, 65536, [](Config & c) -> auto& { return c.samples_per_pixel; }));
  add(number_option<int>(
      {.name = "max-depth",
       .aliases = {},
       .group = views,
       .placeholder = "N",
       .help = "Longest light path, in bounces; 1 is direct light only.",
       .stages = kRenderStage | kFitStage | kReportStage},
      1, 64, [](Config & c) -> auto& { return c.max_depth; }));
  add(choice_option<BsdfModel>(
      {.name = "bsdf",
       .aliases = {},
       .group = views,
       .placeholder = "",
       .help = "How surfaces reflect: as glTF viewers show them, or Burley's principled model.",
       .stages = kRenderStage | kFitStage | kReportStage},
      {{"gltf", BsdfModel::kGltf}, {"principled", BsdfModel::kPrincipled}},
      [](Config & c) -> auto& { return c.bsdf; }));

  add(choice_option<NoiseMode>(
      {.name = "noise",
       .aliases = {},
       .group = priors,
       .placeholder = "",
       .help = "Initial noise: anchored on the surface (exact, or the paper's sampling) or independent in "
               "every view.",
       .stages = kDetailStage},
      {{"exact", NoiseMode::kExact}, {"paper", NoiseMode::kPaper}, {"independent", NoiseMode::kIndependent}},
      [](Config & c) -> auto& { return c.noise; }));
  add(number_option<float>(
      {.name = "bias",
       .aliases = {},
       .group = priors,
       .placeholder = "W",
       .help = "Attention bias w between latent pixels that see the same surface point; 0 switches it off, "
               "1.2 to 1.8 is usual, more makes views agree more.",
       .stages = kDetailStage},
      -20.0f, 20.0f, [](Config & c) -> auto& { return c.detail.bias_weight; }));
  add(choice_option<BiasScaling>(
      {.name = "bias-scaling",
       .aliases = {},
       .group = priors,
       .placeholder = "",
       .help = "Whether w is added to the scaled scores (additive) or before they are divided by the square "
               "root of "
               "the head dimension, as the paper's formula has it (paper), where it does six times less.",
       .stages = kDetailStage},
      {{"additive", BiasScaling::kAdditive}, {"paper", BiasScaling::kPaper}},
      [](Config & c) -> auto& { return c.detail.bias_scaling; }));
  add(flag_option(
      {.name = "bias-controlnet",
       .aliases = {},
       .group = priors,
       .placeholder = "",
       .help = "Bias the self-attention of the ControlNets too, not that of the U-Net alone.",
       .stages = kDetailStage},
      [](Config & c) -> auto& { return c.detail.bias_controlnet; }));

  add(number_option<int>(
      {.name = "fit-iterations",
       .aliases = {},
       .group = fit,
       .placeholder = "N",
       .help = "Steps of the optimiser that carries the detail into the textures.",
       .stages = kFitStage},
      1, 100000, [](Config & c) -> auto& { return c.fit.iterations; }));
  add(texture_size_option());
  add(fit_option());
  add(number_option<float>(
      {.name = "fit-rate",
       .aliases = {},
       .group = fit,
       .placeholder = "X",
       .help = "Learning rate of the optimiser (Adam).",
       .stages = kFitStage},
      1e-5f, 1.0f, [](Config & c) -> auto& { return c.fit.learning_rate; }));
  add(number_option<int>(
      {.name = "light-samples",
       .aliases = {},
       .group = fit,
       .placeholder = "N",
       .help = "Directions of incident light that are kept for every pixel.",
       .stages = kFitStage},
      4, 1024, [](Config & c) -> auto& { return c.fit.light_samples; }));
  add(number_option<int>(
      {.name = "boundary",
       .aliases = {},
       .group = fit,
       .placeholder = "PIXELS",
       .help = "Pixels beside silhouettes and depth edges that are not trusted.",
       .stages = kFitStage},
      0, 64, [](Config & c) -> auto& { return c.fit.boundary_pixels; }));
  const Names<bool> unseen = {{"keep", false}, {"fill", true}};
  add(choice_option<bool>(
      {.name = "unseen",
       .aliases = {},
       .group = fit,
       .placeholder = "",
       .help = "Surface that no view sees: keep it as it is, or fill it with the change of base colour, "
               "roughness and metallic around it, smoothly.",
       .stages = kFitStage},
      unseen, [](Config & c) -> auto& { return c.fit.fill_unseen; }));
  add(flag_option(
      {.name = "keep-in-place",
       .aliases = {},
       .group = fit,
       .placeholder = "",
       .help = "Take the edited views as they lie. Otherwise a view that disagrees with the others is moved "
               "smoothly by up to 8 pixels, so that detail stays sharp.",
       .stages = kFitStage},
      [](Config & c) -> auto& { return c.fit.keep_in_place; }));

  add(number_option<int>(
      {.name = "turntable",
       .aliases = {},
       .group = io,
       .placeholder = "FRAMES",
       .help = "Frames of the report's turntable; 0 leaves it out.",
       .stages = kReportStage},
      0, 360, [](Config & c) -> auto& { return c.turntable_frames; }));
  add(number_option<uint64_t>(
      {.name = "seed",
       .aliases = {},
       .group = machine,
       .placeholder = "N",
       .help = "Seed of all random numbers: the same seed gives the same bytes on the same machine.",
       .stages = kEveryStage},
      0, std::numeric_limits<uint64_t>::max(), [](Config & c) -> auto& { return c.seed; }));
  add(number_option<int>(
      {.name = "threads",
       .aliases = {"-j"},
       .group = machine,
       .placeholder = "N",
       .help = "Processors to use; 0 uses all."},
      0, 1024, [](Config & c) -> auto& { return c.num_threads; }));
  return list;
}

std::vector<std::string> as_strings(const json& value, const std::string& context) {
  const auto text = [&](const json& v) {
    if (v.is_string()) return v.get<std::string>();
    if (v.is_number() || v.is_boolean()) return v.dump();
    throw Error(ErrorCode::kFormat, context,
                fmt::format("expected text, a number or a truth value, found {}", v.type_name()));
  };
  std::vector<std::string> out;
  if (value.is_array())
    for (const json& v : value) out.push_back(text(v));
  else
    out.push_back(text(value));
  return out;
}

}  // namespace

const std::vector<Option>& options() {
  static const std::vector<Option> list = make_options();
  return list;
}

const Option* find_option(std::string_view name) {
  for (const Option& option : options())
    if (option.name == name) return &option;
  return nullptr;
}

json to_json(const Config& config) {
  return values_read_by(config, ~0u);
}

void apply_json(Config& config, const json& values, const std::string& context) {
  if (!values.is_object()) throw Error(ErrorCode::kFormat, context, "expected an object of options");
  for (const auto& [name, value] : values.items()) {
    if (!find_option(name))
      throw Error(ErrorCode::kFormat, context, fmt::format("unknown option '{}'", printable(name)));
  }
  // In the order of the list, not of the file: a preset comes before what it would else overwrite.
  for (const Option& option : options()) {
    if (!values.contains(option.name)) continue;
    const std::vector<std::string> texts = as_strings(values[option.name], context + ": " + option.name);
    if (!texts.empty()) option.set(config, texts);
  }
}

json values_read_by(const Config& config, unsigned stages) {
  json values = json::object();
  for (const Option& option : options())
    if (stages == ~0u || (option.stages & stages)) values[option.name] = option.get(config);
  return values;
}

}  // namespace patina::pipeline
