// Options of the edit: what the asset should look like, and what keeps the views consistent.
#include "patina/pipeline/option_groups.h"
#include "patina/pipeline/option_kinds.h"

namespace patina::pipeline {

using namespace option_kinds;
using correspond::NoiseMode;
using diffusion::BiasScaling;
using diffusion::Scheduler;

namespace {

const Place<EditSettings> kEditPlace{"Edit", &Config::edit, kEdit};
const Place<EditSettings> kPriorPlace{"Consistency between views", &Config::edit, kEdit};

Kind<Scheduler> scheduler() {
  return choice<Scheduler>({{"ddim", Scheduler::kDdim},
                            {"pndm", Scheduler::kPndm},
                            {"euler", Scheduler::kEuler},
                            {"euler-a", Scheduler::kEulerAncestral},
                            {"dpm++2m", Scheduler::kDpmSolverPp2m},
                            {"dpm++2m-karras", Scheduler::kDpmSolverPp2mKarras},
                            {"unipc", Scheduler::kUniPc}});
}

// What a preset sets.
struct Effort {
  int num_views, num_steps, samples_per_pixel, fit_iterations, turntable_frames;
};
constexpr Effort kDraft{4, 8, 16, 8, 0}, kFast{4, 12, 32, 8, 0}, kQuality{16, 30, 128, 32, 36};

const Effort& effort_of(Preset preset) {
  return preset == Preset::kDraft ? kDraft : preset == Preset::kFast ? kFast : kQuality;
}

}  // namespace

// Sets several options at once. Those that are given themselves win: they come later in the list.
Option preset_option() {
  const auto presets = choice<Preset>({{"usual", Preset::kUsual},
                                       {"draft", Preset::kDraft},
                                       {"fast", Preset::kFast},
                                       {"quality", Preset::kQuality}});
  const About about{
      .name = "preset",
      .help =
          "draft: 4 views, 8 steps, and it ends with the edited views, in seconds; to try prompts. fast: 4 "
          "views, 12 steps, 8 iterations of the fit, no turntable. quality: 16 views, 30 steps, 32 "
          "iterations of the fit, smoother renders. Options given beside it win."};
  Option option = described(about, "Edit", kEverything, presets);
  option.default_text = "usual";
  option.set = [named = option, presets](Config& c, const json& value) {
    const std::optional<Preset> preset = presets.decode(value);
    if (!preset) refuse(named, value);
    c.preset = *preset;
    if (c.preset == Preset::kUsual) return;
    const Effort& effort = effort_of(c.preset);
    c.inputs.orbit.num_views = effort.num_views;
    c.edit.options.num_steps = effort.num_steps;
    c.render.samples_per_pixel = c.report.samples_per_pixel = effort.samples_per_pixel;
    c.fit.options.iterations = effort.fit_iterations;
    c.report.turntable_frames = effort.turntable_frames;
  };
  option.get = [presets](const Config& c) { return presets.encode(c.preset); };
  return option;
}

std::vector<Option> edit_options() {
  const auto& at = kEditPlace;
  return {
      option(
          at,
          {.name = "prompt",
           .aliases = {"-p"},
           .placeholder = "TEXT",
           .help = "What the asset should look like, e.g. \"a rusty old kettle\"."},
          text(), [](auto& s) -> auto& { return s.options.prompt; }),
      option(
          at,
          {.name = "negative-prompt",
           .aliases = {"-n"},
           .placeholder = "auto|TEXT",
           .help = "What it should not look like. auto takes the model's own words (patina-mini: "
                   "\"a clean new object\", so that only what the prompt says beyond that acts), or none.",
           .default_text = "auto"},
          optional_or_word("auto", text()), [](auto& s) -> auto& { return s.options.negative_prompt; }),
      list_option(
          at,
          {.name = "prompt-for",
           .placeholder = "MATERIAL=TEXT",
           .help = "Words for one material, which act on its pixels in place of the --prompt, e.g. "
                   "\"handle=cracked leather\". `patina info ASSET --prompts FILE` writes a file with all "
                   "materials to fill in.",
           .default_text = "none"},
          text(), [](auto& s) -> auto& { return s.prompt_for; }),
      list_option(
          at,
          {.name = "negative-prompt-for",
           .placeholder = "MATERIAL=TEXT",
           .help = "What one material should not look like, in place of the --negative-prompt.",
           .default_text = "none"},
          text(), [](auto& s) -> auto& { return s.negative_prompt_for; }),
      list_option(
          at,
          {.name = "exemplar",
           .placeholder = "[MATERIAL=]FILE[:W]",
           .help = "Pictures that the edit shall be like, for all of the asset or for one material: "
                   "photographs, textures, or another asset, whose base colour is taken. The weight, above 0 "
                   "up to 100, says how much the views look at it: 1, the usual, as much as at all views "
                   "together.",
           .default_text = "none"},
          text(), [](auto& s) -> auto& { return s.exemplars; }),
      option(
          at,
          {.name = "strength",
           .placeholder = "S",
           .help = "How much the views may change: the share of the steps that is run, "
                   "0.01 to 1."},
          number(0.01f, 1.0f), [](auto& s) -> auto& { return s.options.strength; }),
      option(
          at,
          {.name = "guidance-scale",
           .aliases = {"--cfg-scale"},
           .placeholder = "auto|G",
           .help = "How strongly the prompt acts (classifier-free guidance), 1 to 50. 1 switches guidance "
                   "off and halves the time. auto takes the scale that the model brings (patina-mini: 2), "
                   "or 7.5."},
          or_word("auto", diffusion::kAutoGuidanceScale, number(1.0f, 50.0f)),
          [](auto& s) -> auto& { return s.options.guidance_scale; }),
      option(
          at,
          {.name = "steps",
           .aliases = {"-s"},
           .placeholder = "N",
           .help = "Steps of the scheduler. Steps × strength of them are run."},
          integer(1, 1000), [](auto& s) -> auto& { return s.options.num_steps; }),
      option(
          at, {.name = "scheduler", .aliases = {"--sampler"}, .help = "How noise is removed step by step."},
          scheduler(), [](auto& s) -> auto& { return s.options.scheduler; }),
      option(
          at,
          {.name = "tile-scale",
           .placeholder = "X",
           .help = "Weight of ControlNet tile, which keeps the look of the render, 0 to 4."},
          number(0.0f, 4.0f), [](auto& s) -> auto& { return s.options.tile_scale; }),
      option(
          at,
          {.name = "normal-scale",
           .placeholder = "X",
           .help = "Weight of ControlNet normal, which keeps the shape, 0 to 4."},
          number(0.0f, 4.0f), [](auto& s) -> auto& { return s.options.normal_scale; }),
      option(
          at,
          {.name = "fine-detail",
           .placeholder = "SHARE",
           .help = "How much of what the VAE blurs in the renders (lettering, thin lines, edges) the "
                   "edited views get back, 0 to 1. A --tile-scale below 1 lowers it as well."},
          number(0.0f, 1.0f), [](auto& s) -> auto& { return s.options.fine_detail; }),
  };
}

std::vector<Option> prior_options() {
  const auto& at = kPriorPlace;
  return {
      option(
          at,
          {.name = "noise",
           .help = "The initial noise: anchored on the surface (exact, or as the paper samples it) or "
                   "independent in every view."},
          choice<NoiseMode>({{"exact", NoiseMode::kExact},
                             {"paper", NoiseMode::kPaper},
                             {"independent", NoiseMode::kIndependent}}),
          [](auto& s) -> auto& { return s.noise; }),
      option(
          at,
          {.name = "bias",
           .placeholder = "W",
           .help = "Attention bias w between latent pixels that see the same surface point. 0 switches it "
                   "off, 1.2 to 1.8 is usual, more makes the views agree more."},
          number(-20.0f, 20.0f), [](auto& s) -> auto& { return s.options.bias_weight; }),
      option(
          at,
          {.name = "bias-scaling",
           .help = "additive adds w to the scaled scores. paper adds it before they are divided by the "
                   "square root of the head dimension, as the paper's formula does; its effect is about "
                   "six times smaller then."},
          choice<BiasScaling>({{"additive", BiasScaling::kAdditive}, {"paper", BiasScaling::kPaper}}),
          [](auto& s) -> auto& { return s.options.bias_scaling; }),
      option(
          at,
          {.name = "bias-controlnet",
           .help = "Bias the self-attention of the ControlNets too, not only that of the U-Net."},
          truth(), [](auto& s) -> auto& { return s.options.bias_controlnet; }),
  };
}

}  // namespace patina::pipeline
