#include "patina/pipeline/options.h"

#include <limits>

#include <fmt/format.h>

#include "patina/base/error.h"
#include "patina/pipeline/bundled_model.h"
#include "patina/pipeline/option_kinds.h"

namespace patina::pipeline {
namespace {

using correspond::NoiseMode;
using diffusion::BiasScaling;
using diffusion::Dtype;
using diffusion::PredictionChoice;
using diffusion::Scheduler;
using render::BsdfModel;
using namespace option_kinds;
using nlohmann::json;
namespace fs = std::filesystem;

Option elevations_option() {
  Option option{
      .name = "elevation",
      .aliases = {},
      .group = "Views",
      .placeholder = "DEGREES",
      .help = "Height of the cameras over the horizon, degrees; several are used in turn around the orbit.",
      .default_text = "20",
      .stages = kRenderStage,
      .is_list = true};
  const Option named = option;
  option.set = [named](Config& c, Values v) {
    c.orbit.elevations.clear();
    for (const std::string& text : v)
      c.orbit.elevations.push_back(glm::radians(parse_number(named, text, -89.0f, 89.0f)));
  };
  option.get = [](const Config& c) {
    json list = json::array();
    for (const float e : c.orbit.elevations)
      list.push_back(shortest(std::round(glm::degrees(e) * 1e4f) / 1e4f));
    return list;
  };
  return option;
}

Option views_option() {
  Option option{.name = "views",
                .aliases = {},
                .group = "Views",
                .placeholder = "4|9|16",
                .help = "Number of views around the asset; they are edited together as a square grid.",
                .default_text = "9",
                .stages = kRenderStage};
  const Option named = option;
  option.set = [named](Config& c, Values v) {
    const int n = parse_number(named, v.front(), 1, 16);
    if (n != 1 && n != 4 && n != 9 && n != 16)
      refuse(named, "4, 9 or 16 (or 1 for a single view)", v.front());
    c.orbit.num_views = n;
  };
  option.get = [](const Config& c) { return json(c.orbit.num_views); };
  return option;
}

Option resolution_option() {
  Option option{
      .name = "resolution",
      .aliases = {},
      .group = "Views",
      .placeholder = "auto|PIXELS",
      .help =
          "Width and height of one view, pixels; a multiple of 64 (with --bias 0: of 8). auto takes "
          "what the model was trained at: 256 for patina-mini, 512 for Stable Diffusion 1.5.",
      .default_text = "auto",
      .stages = kRenderStage};
  const Option named = option;
  option.set = [named](Config& c, Values v) {
    c.orbit.resolution = v.front() == "auto" ? 0 : parse_number(named, v.front(), 64, 4096);
  };
  option.get = [](const Config& c) {
    return c.orbit.resolution == 0 ? json("auto") : json(c.orbit.resolution);
  };
  return option;
}

/// Sets several options at once. Those that are given themselves win: they come later in the list.
Option preset_option() {
  const Names<Preset> presets = {
      {"usual", Preset::kUsual}, {"fast", Preset::kFast}, {"quality", Preset::kQuality}};
  Option option = choice_option<Preset>(
      {.name = "preset",
       .aliases = {},
       .group = "Edit",
       .placeholder = "",
       .help = "fast: 4 views, 12 steps, 80 iterations of the fit, to try prompts. quality: 16 views, 30 "
               "steps, 400 "
               "iterations, smoother renders. Options given beside it win."},
      presets, [](Config & c) -> auto& { return c.preset; });
  option.set = [choose = option.set](Config& c, Values v) {
    choose(c, v);
    if (c.preset == Preset::kUsual) return;
    const bool fast = c.preset == Preset::kFast;
    c.orbit.num_views = fast ? 4 : 16;
    c.detail.num_steps = fast ? 12 : 30;
    c.samples_per_pixel = fast ? 32 : 256;
    c.fit.iterations = fast ? 80 : 400;
    c.turntable_frames = fast ? 0 : 36;
  };
  return option;
}

Option exposure_option() {
  Option option{.name = "exposure",
                .aliases = {},
                .group = "Views",
                .placeholder = "auto|EV",
                .help =
                    "Exposure of all views, in stops; auto meters the light that falls on the asset, so that "
                    "white comes out white.",
                .default_text = "auto",
                .stages = kRenderStage};
  const Option named = option;
  option.set = [named](Config& c, Values v) {
    if (v.front() == "auto")
      c.exposure_ev.reset();
    else
      c.exposure_ev = parse_number(named, v.front(), -20.0f, 20.0f);
  };
  option.get = [](const Config& c) { return c.exposure_ev ? shortest(*c.exposure_ev) : json("auto"); };
  return option;
}

Option materials_option() {
  Option option{.name = "material",
                .aliases = {},
                .group = "Input and output",
                .placeholder = "NAME",
                .help = "Only these materials may change, by the names that `patina info` shows.",
                .default_text = "all with usable UVs",
                .stages = kFitStage | kReportStage,
                .is_list = true};
  option.set = [](Config& c, Values v) { c.materials.assign(v.begin(), v.end()); };
  option.get = [](const Config& c) { return json(c.materials); };
  return option;
}

Option fit_option() {
  Option option{
      .name = "fit",
      .aliases = {},
      .group = "Inverse rendering",
      .placeholder = "MAP",
      .help =
          "Which maps may change: base_color, roughness, normal, metallic (separated by spaces or commas).",
      .default_text = "base_color roughness normal",
      .stages = kFitStage,
      .is_list = true};
  const Option named = option;
  option.set = [named](Config& c, Values v) {
    inverse::FitOptions& fit = c.fit;
    fit.fit_base_color = fit.fit_roughness = fit.fit_normal = fit.fit_metallic = false;
    for (const std::string& list : v)
      for (size_t begin = 0, end; begin <= list.size(); begin = end + 1) {
        end = std::min(list.find(',', begin), list.size());
        const std::string name = list.substr(begin, end - begin);
        if (name == "base_color")
          fit.fit_base_color = true;
        else if (name == "roughness")
          fit.fit_roughness = true;
        else if (name == "normal")
          fit.fit_normal = true;
        else if (name == "metallic")
          fit.fit_metallic = true;
        else
          refuse(named, "base_color, roughness, normal or metallic", name);
      }
  };
  option.get = [](const Config& c) {
    json list = json::array();
    if (c.fit.fit_base_color) list.push_back("base_color");
    if (c.fit.fit_roughness) list.push_back("roughness");
    if (c.fit.fit_normal) list.push_back("normal");
    if (c.fit.fit_metallic) list.push_back("metallic");
    return list;
  };
  return option;
}

/// FILE or FILE:WEIGHT; a file's name may hold colons itself.
diffusion::LoraChoice parse_lora(const Option& option, const std::string& text) {
  const size_t colon = text.rfind(':');
  if (colon == std::string::npos || fs::exists(text)) return {text, 1.0f};
  const std::string number = text.substr(colon + 1);
  if (colon == 0 || number.empty()) refuse(option, "FILE or FILE:WEIGHT", text);
  return {text.substr(0, colon), parse_number(option, number, -10.0f, 10.0f)};
}

Option loras_option(const std::string& group) {
  Option option{.name = "lora",
                .aliases = {},
                .group = group,
                .placeholder = "FILE:WEIGHT",
                .help = "LoRA to merge into the model, and how much of it; may be given several times.",
                .default_text = "none",
                .stages = kDetailStage,
                .is_list = true};
  const Option named = option;
  option.set = [named](Config& c, Values v) {
    c.model.loras.clear();
    for (const std::string& text : v) c.model.loras.push_back(parse_lora(named, text));
  };
  option.get = [](const Config& c) {
    json list = json::array();
    for (const diffusion::LoraChoice& lora : c.model.loras)
      list.push_back(fmt::format("{}:{}", lora.file.string(), lora.weight));
    return list;
  };
  return option;
}

Option paths_option(Option option, std::vector<fs::path>& (*member)(Config&)) {
  option.is_list = true;
  option.set = [member](Config& c, Values v) { member(c).assign(v.begin(), v.end()); };
  option.get = [member](const Config& c) {
    json list = json::array();
    for (const fs::path& path : member(const_cast<Config&>(c))) list.push_back(path.string());
    return list;
  };
  return option;
}

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
  add(text_option(
      {.name = "negative-prompt",
       .aliases = {"-n"},
       .group = edit,
       .placeholder = "TEXT",
       .help = "What it shall not look like.",
       .stages = kDetailStage},
      [](Config & c) -> auto& { return c.detail.negative_prompt; }));
  add(number_option<float>(
      {.name = "strength",
       .aliases = {},
       .group = edit,
       .placeholder = "S",
       .help = "How far the views may move away from the renders: share of the steps that is run, 0.01 to 1.",
       .stages = kDetailStage},
      0.01f, 1.0f, [](Config & c) -> auto& { return c.detail.strength; }));
  add(number_option<float>(
      {.name = "guidance-scale",
       .aliases = {"--cfg-scale"},
       .group = edit,
       .placeholder = "G",
       .help = "How strongly the prompt acts (classifier-free guidance); 1 switches guidance off and halves "
               "the time.",
       .stages = kDetailStage},
      1.0f, 50.0f, [](Config & c) -> auto& { return c.detail.guidance_scale; }));
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
       .help = "Arithmetic of the networks; auto takes bf16 where it is faster here.",
       .stages = kDetailStage},
      {{"auto", Dtype::kAuto}, {"f32", Dtype::kF32}, {"bf16", Dtype::kBf16}},
      [](Config & c) -> auto& { return c.dtype; }));

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
       .help = "From the asset's centre to the cameras, metres; 0 makes the bounding sphere just fit.",
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
               "1.2 to 1.8 is usual.",
       .stages = kDetailStage},
      -20.0f, 20.0f, [](Config & c) -> auto& { return c.detail.bias_weight; }));
  add(choice_option<BiasScaling>(
      {.name = "bias-scaling",
       .aliases = {},
       .group = priors,
       .placeholder = "",
       .help = "Whether w is divided by the square root of the head dimension (paper) or added after it.",
       .stages = kDetailStage},
      {{"paper", BiasScaling::kPaper}, {"additive", BiasScaling::kAdditive}},
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
  add(number_option<int>(
      {.name = "texture-size",
       .aliases = {},
       .group = fit,
       .placeholder = "TEXELS",
       .help = "Width and height of the new textures, texels; 0 keeps the asset's own sizes.",
       .stages = kFitStage},
      0, 8192, [](Config & c) -> auto& { return c.fit.texture_size; }));
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
