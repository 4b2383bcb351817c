// The golden cases that go step by step: scheduler trajectories with given network outputs, and whole runs.
#include <array>
#include <cmath>
#include <sstream>

#include <nlohmann/json.hpp>

#include <ATen/ATen.h>

#include "dev/golden/golden_compare.h"
#include "patina/base/error.h"
#include "patina/base/files.h"
#include "patina/diffusion/sampler.h"

namespace patina::diffusion::golden {
namespace {

using Json = nlohmann::json;
namespace fs = std::filesystem;

std::vector<float> floats(const at::Tensor& tensor) {
  const at::Tensor values = tensor.to(at::kFloat).contiguous();
  return {values.data_ptr<float>(), values.data_ptr<float>() + values.numel()};
}
at::Tensor tensor_of(const std::vector<float>& values, at::IntArrayRef shape) {
  return at::from_blob(const_cast<float*>(values.data()), shape, at::kFloat).clone();
}
at::Tensor tensor_of(const std::vector<double>& values, size_t first = 0) {
  return at::tensor(std::vector<double>(values.begin() + static_cast<std::ptrdiff_t>(first), values.end()),
                    at::kDouble);
}

/// diffusers 0.27's UniPC has no final_sigmas_type and ends at sigma_min; a configuration that names it says
/// which.
SchedulerConfig config_of(const Json& json, const std::string& context) {
  SchedulerConfig config = parse_scheduler_config(json.dump(), context);
  if (config.solver == Solver::kUniPc && !json.contains("final_sigmas_type"))
    config.final_sigma = FinalSigma::kSigmaMin;
  return config;
}

/// The model's scheduler under the class and settings that a run's metadata names.
SchedulerConfig config_of_run(const Stored& stored, const Parts& parts) {
  const fs::path file = parts.folder() / "scheduler" / "scheduler_config.json";
  Json json = Json::parse(read_text_file(file));
  std::istringstream words(stored.metadata("scheduler"));
  std::string word;
  words >> word;
  // Either a class name, or the name of a scheduler followed by settings.
  json["_class_name"] = word.ends_with("Scheduler") ? word : word + "Scheduler";
  while (words >> word) {
    const size_t equals = word.find('=');
    if (equals == std::string::npos) {
      json["timestep_spacing"] = word;
    } else {
      json[word.substr(0, equals)] = Json::parse(word.substr(equals + 1));
    }
  }
  if (stored.has_metadata("overrides")) json.update(Json::parse(stored.metadata("overrides")));
  return config_of(json, file.string());
}

/// What both kinds of run have in common, from the noisy start to the decoded image.
void check_run(const Stored& stored, Parts& parts, const SchedulePlan& plan, int start,
               const std::vector<Control>& controls, const at::Tensor& noisy, Comparison& comparison) {
  comparison.add("timesteps", tensor_of(plan.timesteps, static_cast<size_t>(start)), stored["timesteps"],
                 kModuleLimit);
  const auto encode = [&](const std::string& which, const std::string& text) {
    const TextConditioning embedding = encode_prompts(parts.tokenizer(), parts.text_encoder(), {}, {{text}});
    if (stored.has("input_ids_" + which)) {
      const at::Tensor ids = stored["input_ids_" + which];
      const std::vector<int64_t> found =
          parts.tokenizer().encode_padded(text, static_cast<size_t>(ids.size(1)));
      comparison.add("input_ids_" + which, at::tensor(found, at::kLong).unsqueeze(0), ids, {0, 0});
    }
    const std::string name = "encoder_hidden_states_" + which;
    if (stored.has(name)) comparison.add(name, embedding.tokens, stored[name], kModuleLimit);
    return embedding;
  };
  const float guidance_scale = std::stof(stored.metadata("guidance_scale"));
  TextConditioning text = encode("prompt", stored.metadata("prompt"));
  const TextConditioning negative = encode("negative", stored.metadata("negative_prompt"));
  if (guidance_scale != 1) text = stack_prompts(std::array{negative, text});

  const at::Tensor latents = stored["latents"];
  const int64_t num_calls = plan.num_calls() - start;
  const int64_t has_start = latents.size(0) - num_calls;  // 1 where the stored latents begin with the start
  if (has_start != 0 && has_start != 1) return comparison.fail("latents are not one a step");
  if (has_start) comparison.add("latents[0]", noisy, latents[0], kEndToEndLimit);

  const Denoiser denoiser{&parts.unet(), controls, text, guidance_scale, /*one_batch=*/true};
  const SamplerCallbacks callbacks{
      [&](int index, size_t) { return floats(stored["step_noises"][index - start]); },
      [&](const SamplerState& state, const Guided& prediction) {
        const int64_t call = state.next_call - 1 - start;
        const std::string number = "[" + std::to_string(call) + "]";
        for (const auto& [name, value] :
             {std::pair<std::string, at::Tensor>("noise_pred_uncond", prediction.unconditional),
              {"noise_pred_text", prediction.conditional},
              {"noise_pred_guided", prediction.guided}}) {
          if (stored.has(name)) comparison.add(name + number, value, stored[name][call], kEndToEndLimit);
        }
        comparison.add("latents" + number, tensor_of(state.latents, noisy.sizes()), latents[call + has_start],
                       kEndToEndLimit);
      }};
  const at::Tensor last =
      tensor_of(sample(denoiser, plan, {start, floats(noisy), {}}, noisy.sizes(), callbacks), noisy.sizes());
  comparison.add("final_latents", last, stored["final_latents"], kEndToEndLimit);

  const at::Tensor image = parts.vae().decode(last / parts.vae().config().scaling_factor);
  comparison.add("decoded", image, stored["decoded"], kEndToEndLimit);
  const at::Tensor image_01 = at::clamp(image * 0.5 + 0.5, 0, 1);
  if (stored.has("decoded_01")) comparison.add("decoded_01", image_01, stored["decoded_01"], kEndToEndLimit);
  if (stored.has("decoded_u8")) {
    // A value near a half may round either way, so a difference of one counts as none.
    const at::Tensor found = at::round(image_01 * 255), expected = stored["decoded_u8"].to(at::kFloat);
    comparison.add("decoded_u8", at::where((found - expected).abs() <= 1, expected, found), expected, {0, 0});
  }
}

}  // namespace

void check_scheduler(const fs::path& file, Comparison& comparison) {
  const fs::path folder = file.parent_path();
  const Json index = Json::parse(read_text_file(folder / "index.json"));
  const Json* variant = nullptr;
  for (const auto& [name, entry] : index.items()) {
    if (entry.value("file", name + ".safetensors") == file.filename().string()) variant = &entry;
  }
  if (!variant) return comparison.fail("index.json does not name this file");
  const Stored stored(file), inputs(folder / "inputs.safetensors");
  const std::vector<float> init_noise = floats(inputs["init_noise"]), x0 = floats(inputs["x0"]);
  const at::Tensor outputs = inputs["model_outputs"], noises = inputs["step_noises"];
  const std::vector<int64_t> shape = inputs["x0"].sizes().vec();

  Json json = variant->at("config");
  json["_class_name"] = variant->at("class");
  SchedulerConfig config = config_of(json, (folder / "index.json").string());
  config.eta = variant->at("overrides").value("_eta", 0.0);

  // Runs are named "steps20" or "img2img20_strength0.6".
  for (const auto& [run, facts] : variant->at("runs").items()) {
    const bool from_image = run.starts_with("img2img");
    const SchedulePlan plan = make_schedule(config, std::stoi(run.substr(from_image ? 7 : 5)));
    const int start = from_image ? start_index(plan, std::stod(run.substr(run.find("strength") + 8))) : 0;
    comparison.add(run + "/timesteps", tensor_of(plan.timesteps, static_cast<size_t>(start)),
                   stored[run + "/timesteps"], kModuleLimit);
    if (stored.has(run + "/sigmas"))
      comparison.add(run + "/sigmas", tensor_of(plan.sigmas), stored[run + "/sigmas"], kModuleLimit);

    std::vector<float> x;
    if (from_image) {
      x = add_noise(plan, start, x0, init_noise);
      comparison.add(run + "/noisy", tensor_of(x, shape), stored[run + "/noisy"], kModuleLimit);
    } else {
      for (const float value : init_noise) x.push_back(static_cast<float>(value * plan.init_noise_sigma));
    }
    if (!stored.has(run + "/latents")) continue;
    const at::Tensor latents = stored[run + "/latents"];
    SchedulerState state;
    for (int i = start; i < plan.num_calls(); ++i) {
      const int64_t call = i - start;
      const std::string number = "[" + std::to_string(call) + "]";
      if (stored.has(run + "/scaled_input")) {
        comparison.add(run + "/scaled_input" + number, tensor_of(scale_model_input(plan, i, x), shape),
                       stored[run + "/scaled_input"][call], kModuleLimit);
      }
      const std::vector<float> noise = needs_noise(plan, i) ? floats(noises[call]) : std::vector<float>{};
      x = step(plan, state, i, floats(outputs[call]), x, noise);
      comparison.add(run + "/latents" + number, tensor_of(x, shape), latents[call + 1], kModuleLimit);
    }
  }
}

void check_text_to_image(const Stored& stored, Parts& parts, Comparison& comparison) {
  const SchedulePlan plan = make_schedule(config_of_run(stored, parts), std::stoi(stored.metadata("steps")));
  check_run(stored, parts, plan, 0, {}, stored["noise"] * plan.init_noise_sigma, comparison);
}

void check_image_to_image(const Stored& stored, Parts& parts, Comparison& comparison) {
  const SchedulePlan plan = make_schedule(config_of_run(stored, parts), std::stoi(stored.metadata("steps")));
  const int start = start_index(plan, std::stod(stored.metadata("strength")));

  const at::Tensor mean = parts.vae().encode(2 * stored["init_image_01"] - 1).mean;
  const at::Tensor scaled = mean * parts.vae().config().scaling_factor;
  if (stored.has("init_latent_mean"))
    comparison.add("init_latent_mean", mean, stored["init_latent_mean"], kModuleLimit);
  if (stored.has("init_latent_scaled"))
    comparison.add("init_latent_scaled", scaled, stored["init_latent_scaled"], kModuleLimit);
  const at::Tensor noisy =
      tensor_of(add_noise(plan, start, floats(scaled), floats(stored["noise"])), scaled.sizes());
  if (stored.has("noisy_start")) comparison.add("noisy_start", noisy, stored["noisy_start"], kModuleLimit);

  std::vector<Control> controls;
  std::istringstream scales(stored.metadata("controlnet_scales"));
  for (const std::string name : {"tile", "normal"}) {
    std::string scale;
    std::getline(scales, scale, ',');
    const Held<ControlNet>& network = parts.controlnet(name);
    controls.push_back({&network, network.use()->hint(stored["cond_" + name + "_01"]), std::stof(scale)});
  }
  check_run(stored, parts, plan, start, controls, noisy, comparison);
}

}  // namespace patina::diffusion::golden
