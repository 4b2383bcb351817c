"""Golden data: inputs and outputs of diffusers' and transformers' networks for a model folder.

    python3 tools/dev/golden/make_golden.py MODEL OUT [--prompts tests/data/golden/tokenizer_cases.json]

MODEL is a diffusers folder with controlnet_tile/ and controlnet_normal/ in it, such as tests/data/tiny-sd.
OUT gets the files that golden_check and the tests read; README.md beside this script says what each holds.
Random numbers have fixed seeds, so that two runs of one version give the same files.
"""

import argparse
import json
import math
from pathlib import Path

import diffusers
import torch
import transformers
from diffusers.models.attention_processor import Attention
from diffusers.models.embeddings import get_timestep_embedding
from safetensors.torch import save_file

PROMPTS = [
    "a rusty kettle, highly detailed photo",
    "a mossy stone statue",
    "blurry, low quality, watermark",
    "",
    "red, green, blue, " * 40,
    "It's 3 old robots & a café 🔥",
]
BIAS_WEIGHT = 1.8
CONTROLNETS = {"tile": 0.8, "normal": 0.7}
BETAS = dict(beta_start=0.00085, beta_end=0.012, beta_schedule="scaled_linear", num_train_timesteps=1000)
# name -> (class, settings); `_eta` is an argument of the step. A file a row.
SCHEDULERS = {
    "ddim_leading": ("DDIM", dict(timestep_spacing="leading", steps_offset=1, clip_sample=False, set_alpha_to_one=False)),
    "ddim_leading_eta0.5": ("DDIM", dict(timestep_spacing="leading", steps_offset=1, clip_sample=False, set_alpha_to_one=False, _eta=0.5)),
    "ddim_trailing": ("DDIM", dict(timestep_spacing="trailing", clip_sample=False, set_alpha_to_one=False)),
    "pndm_plms_leading": ("PNDM", dict(timestep_spacing="leading", steps_offset=1, skip_prk_steps=True, set_alpha_to_one=False)),
    "euler_linspace": ("EulerDiscrete", dict(timestep_spacing="linspace")),
    "euler_karras": ("EulerDiscrete", dict(timestep_spacing="linspace", use_karras_sigmas=True)),
    "euler_a_trailing": ("EulerAncestralDiscrete", dict(timestep_spacing="trailing")),
    "dpmpp_2m_linspace": ("DPMSolverMultistep", dict(timestep_spacing="linspace")),
    "dpmpp_2m_karras": ("DPMSolverMultistep", dict(timestep_spacing="linspace", use_karras_sigmas=True)),
    "dpmpp_2m_leading_vpred": ("DPMSolverMultistep", dict(timestep_spacing="leading", steps_offset=1, prediction_type="v_prediction")),
    "dpmpp_2m_sde_karras": ("DPMSolverMultistep", dict(timestep_spacing="linspace", use_karras_sigmas=True, algorithm_type="sde-dpmsolver++")),
    "unipc_bh2_linspace_final_zero": ("UniPCMultistep", dict(timestep_spacing="linspace", final_sigmas_type="zero")),
    "unipc_bh2_karras_final_zero": ("UniPCMultistep", dict(timestep_spacing="linspace", use_karras_sigmas=True, final_sigmas_type="zero")),
    "unipc_bh1_linspace_final_zero": ("UniPCMultistep", dict(timestep_spacing="linspace", solver_type="bh1", final_sigmas_type="zero")),
}


def randn(seed, *shape):
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed))


def rand(seed, *shape):
    return torch.rand(*shape, generator=torch.Generator().manual_seed(seed))


class Writer:
    """Writes safetensors files and remembers what stands in them, for INDEX.json."""

    def __init__(self, folder):
        self.folder, self.index = folder, {}
        (folder / "schedulers").mkdir(parents=True, exist_ok=True)

    def __call__(self, name, tensors, **metadata):
        tensors = {key: value.detach().clone().contiguous() for key, value in tensors.items()}
        save_file(tensors, str(self.folder / (name + ".safetensors")), metadata=metadata or None)
        self.index[name] = {
            "tensors": {key: [str(value.dtype).removeprefix("torch."), list(value.shape)] for key, value in tensors.items()},
            "metadata": metadata,
        }
        print(name, flush=True)


class Activations:
    """The outputs of modules under "act/<path>"; the hidden state alone where a module returns a tuple."""

    def __init__(self, network, wanted):
        self.found, self.hooks = {}, []
        for path, module in network.named_modules():
            if wanted(path):
                self.hooks.append(module.register_forward_hook(self.hook(path)))

    def hook(self, path):
        def keep(_module, _inputs, output):
            output = output[0] if isinstance(output, tuple) else output
            self.found["act/" + path] = getattr(output, "sample", output)
        return keep

    def close(self):
        for hook in self.hooks:
            hook.remove()
        return self.found


class BiasedAttention:
    """softmax((QK^T + B) / sqrt(d)) V with one B for all heads and samples: 0 but `weight` at the pairs (query, key)."""

    def __init__(self, pairs, weight):
        self.pairs, self.weight = pairs, weight

    def __call__(self, attn: Attention, hidden_states, encoder_hidden_states=None, attention_mask=None, **_):
        keys = hidden_states if encoder_hidden_states is None else encoder_hidden_states
        q, k, v = (attn.head_to_batch_dim(x) for x in (attn.to_q(hidden_states), attn.to_k(keys), attn.to_v(keys)))
        scores = q @ k.transpose(1, 2)
        if encoder_hidden_states is None:
            rows, columns = self.pairs[scores.shape[1]].long().unbind(1)
            scores[:, rows, columns] += self.weight
        out = attn.batch_to_head_dim(torch.softmax(scores / math.sqrt(q.shape[-1]), -1) @ v)
        return attn.to_out[1](attn.to_out[0](out))


def make_tokenizer_cases(write, model, prompts):
    slow = transformers.CLIPTokenizer.from_pretrained(model / "tokenizer")
    fast = transformers.CLIPTokenizerFast.from_pretrained(model / "tokenizer")
    cases = []
    for number, (name, prompt) in enumerate(prompts):
        ids = slow(prompt).input_ids
        case = {"name": name or str(number), "prompt": prompt, "agree": fast(prompt).input_ids == ids, "ids": ids,
                "ids_77": slow(prompt, padding="max_length", max_length=77, truncation=True).input_ids}
        if not case["agree"]:
            case["ids_fast"] = fast(prompt).input_ids
        cases.append(case)
    text = {"vocab_size": slow.vocab_size, "notes": ["agree: the slow and the fast tokenizer give the same ids"], "cases": cases}
    (write.folder / "tokenizer_cases.json").write_text(json.dumps(text, ensure_ascii=False, indent=1))
    return slow


def ids_of(tokenizer, prompts):
    return tokenizer(prompts, padding="max_length", max_length=77, truncation=True, return_tensors="pt").input_ids


def make_text(write, encoder, tokenizer):
    ids = ids_of(tokenizer, PROMPTS)
    out = encoder(ids, output_hidden_states=True)
    skipped = encoder.text_model.final_layer_norm(out.hidden_states[-2])
    write("text_encoder", {"input_ids": ids, "last_hidden_state": out.last_hidden_state, "pooler_output": out.pooler_output,
                           "clip_skip_2": skipped}, prompts=json.dumps(PROMPTS))
    acts = Activations(encoder, lambda path: path in ("text_model.embeddings", "text_model.final_layer_norm")
                       or path.startswith("text_model.encoder.layers.") and not path.endswith("activation_fn"))
    out = encoder(ids[:1])
    write("text_encoder_acts", {"input_ids": ids[:1], "last_hidden_state": out.last_hidden_state, **acts.close()})
    return out.last_hidden_state


def make_vae(write, vae):
    for height, width, batch in ((64, 64, 1), (40, 56, 1), (96, 64, 2)):
        image = 2 * rand(1, batch, 3, height, width) - 1
        posterior = vae.encode(image).latent_dist
        write(f"vae_encode_{height}x{width}" + (f"_b{batch}" if batch > 1 else ""),
              {"image": image, "moments": posterior.parameters, "mean": posterior.mean, "logvar": posterior.logvar, "std": posterior.std})
    for height, width, batch in ((8, 8, 1), (5, 7, 1), (12, 8, 2)):
        scaled = randn(2, batch, vae.config.latent_channels, height, width)
        latent = scaled / vae.config.scaling_factor
        write(f"vae_decode_{height}x{width}" + (f"_b{batch}" if batch > 1 else ""),
              {"latent_scaled": scaled, "latent": latent, "image": vae.decode(latent).sample})


def inputs_of(unet, seed, height, width, batch=1, timesteps=(500,), tokens=77):
    dtype = torch.float32 if any(isinstance(t, float) for t in timesteps) else torch.int64
    return {"sample": randn(seed, batch, unet.config.in_channels, height, width), "timestep": torch.tensor(timesteps, dtype=dtype),
            "encoder_hidden_states": randn(seed + 1, batch, tokens, unet.config.cross_attention_dim)}


def call(network, inputs, **more):
    return network(inputs["sample"], inputs["timestep"], inputs["encoder_hidden_states"], **more)


def make_unet(write, unet):
    cases = {"8x8_b1_t0": dict(height=8, width=8, timesteps=(0,)), "8x8_b1_t999": dict(height=8, width=8, timesteps=(999,)),
             "8x8_b1_t946.4211": dict(height=8, width=8, timesteps=(946.4211,)),
             "10x13_b1_t500_odd": dict(height=10, width=13), "8x16_b1_t500_ctx154": dict(height=8, width=16, tokens=154),
             "16x24_b2_t1_t999": dict(height=16, width=24, batch=2, timesteps=(1, 999))}
    for number, (name, case) in enumerate(cases.items()):
        inputs = inputs_of(unet, 10 * number + 3, **case)
        write("unet_" + name, {**inputs, "out": call(unet, inputs).sample})
    inputs = inputs_of(unet, 200, 8, 16)
    blocks = ("down_blocks.", "up_blocks.", "mid_block.")
    acts = Activations(unet, lambda path: path.startswith(blocks) and path.count(".") == 3
                       and path.split(".")[2] in ("resnets", "attentions"))
    out = call(unet, inputs).sample
    write("unet_8x16_b1_t500_acts", {**inputs, "out": out, **acts.close()})


def make_biased(write, unet):
    height, width, batch = 8, 8, 2
    inputs = inputs_of(unet, 300, height, width, batch)
    pairs = {}
    for level in range(len(unet.config.block_out_channels)):
        side = (height >> level) * (width >> level)
        chosen = rand(310 + level, side, side) < 0.4
        chosen[0, -1] = True
        pairs[side] = chosen.nonzero().to(torch.int32)
    plain, processors = call(unet, inputs).sample, unet.attn_processors
    unet.set_attn_processor(BiasedAttention(pairs, BIAS_WEIGHT))
    acts = Activations(unet, lambda path: path.endswith("attn1") and not path.startswith("up_blocks."))
    out = call(unet, inputs).sample
    write(f"unet_attn_bias_{height}x{width}_b{batch}",
          {**inputs, "weight": torch.tensor([BIAS_WEIGHT]), "out": out, "out_without_bias": plain,
           **{f"pairs_{size}": value for size, value in pairs.items()}, **acts.close()})
    unet.set_attn_processor(processors)


def residuals_of(controlnet, inputs, image, scale):
    down, mid = call(controlnet, inputs, controlnet_cond=image, conditioning_scale=scale, return_dict=False)
    return {**{f"down_{i}": tensor for i, tensor in enumerate(down)}, "mid": mid}


def make_controlnets(write, unet, controlnets, scale_of_pixels):
    for number, (name, controlnet) in enumerate(controlnets.items()):
        for scale in (1.0, 0.8):
            inputs = inputs_of(unet, 400 + number, 8, 8)
            image = rand(410 + number, 1, 3, 8 * scale_of_pixels, 8 * scale_of_pixels)
            write(f"controlnet_{name}_8x8_b1_t500_scale{scale}",
                  {**inputs, "controlnet_cond": image, "conditioning_scale": torch.tensor([scale]),
                   **residuals_of(controlnet, inputs, image, scale)})
    inputs = inputs_of(unet, 500, 8, 8, timesteps=(1,))
    images = {name: rand(510 + i, 1, 3, 8 * scale_of_pixels, 8 * scale_of_pixels) for i, name in enumerate(controlnets)}
    parts = [residuals_of(controlnets[name], inputs, images[name], CONTROLNETS[name]) for name in controlnets]
    total = {key: sum(part[key] for part in parts) for key in parts[0]}
    out = call(unet, inputs, down_block_additional_residuals=[total[f"down_{i}"] for i in range(len(total) - 1)],
               mid_block_additional_residual=total["mid"]).sample
    write("unet_two_controlnets_8x8_b1_t1",
          {**inputs, **{"cond_" + name: image for name, image in images.items()}, "scales": torch.tensor(list(CONTROLNETS.values())),
           **{"sum_" + key: tensor for key, tensor in total.items()}, "out_without_control": call(unet, inputs).sample, "out": out})


def step_with(scheduler, output, timestep, latent, noise, eta):
    """One step in which fresh noise is `noise`, whatever the scheduler calls to draw it."""
    names = ("ddim", "ddpm", "euler_ancestral_discrete", "dpmsolver_multistep")
    modules = [getattr(diffusers.schedulers, "scheduling_" + name, None) for name in names]
    drawn = [(module, module.randn_tensor) for module in modules if hasattr(module, "randn_tensor")]
    for module, _ in drawn:
        module.randn_tensor = lambda *_args, **_kwargs: noise
    try:
        more = {"eta": eta} if eta else {}
        return scheduler.step(output, timestep, latent, **more).prev_sample
    finally:
        for module, original in drawn:
            module.randn_tensor = original


def trajectory(scheduler, timesteps, latent, outputs, noises, eta):
    latents, scaled = [latent], []
    for i, timestep in enumerate(timesteps):
        scaled.append(scheduler.scale_model_input(latent, timestep))
        latent = step_with(scheduler, outputs[i], timestep, latent, noises[i], eta)
        latents.append(latent)
    return torch.stack(latents), torch.stack(scaled)


def make_schedulers(write):
    shape, index = (1, 4, 8, 8), {}
    inputs = {"x0": randn(600, *shape), "init_noise": randn(601, *shape), "model_outputs": randn(602, 51, *shape),
              "step_noises": randn(603, 51, *shape)}
    write("schedulers/inputs", inputs)
    for name, (kind, settings) in SCHEDULERS.items():
        eta = settings.get("_eta", 0.0)
        kind = kind + "Scheduler"
        make = lambda: getattr(diffusers, kind)(**BETAS, **{key: value for key, value in settings.items() if key != "_eta"})
        tensors, runs = {}, {}
        for steps in (6, 20):
            scheduler = make()
            scheduler.set_timesteps(steps)
            run = f"steps{steps}"
            start = inputs["init_noise"] * scheduler.init_noise_sigma
            latents, scaled = trajectory(scheduler, scheduler.timesteps, start, inputs["model_outputs"], inputs["step_noises"], eta)
            tensors |= {run + "/timesteps": scheduler.timesteps.double(), run + "/latents": latents}
            if kind.startswith("Euler"):
                tensors[run + "/scaled_input"] = scaled
            if hasattr(scheduler, "sigmas"):
                tensors[run + "/sigmas"] = scheduler.sigmas.double()
            runs[run] = {"num_timesteps": len(scheduler.timesteps)}
        steps, strength = 20, 0.6
        scheduler = make()
        scheduler.set_timesteps(steps)
        first = steps - int(steps * strength)
        timesteps = scheduler.timesteps[first * scheduler.order:]
        if hasattr(scheduler, "set_begin_index"):
            scheduler.set_begin_index(first * scheduler.order)
        noisy = scheduler.add_noise(inputs["x0"], inputs["init_noise"], timesteps[:1])
        latents, _ = trajectory(scheduler, timesteps, noisy, inputs["model_outputs"], inputs["step_noises"], eta)
        run = f"img2img{steps}_strength{strength}"
        tensors |= {run + "/timesteps": timesteps.double(), run + "/noisy": noisy, run + "/latents": latents}
        runs[run] = {"t_start": first, "num_timesteps": len(timesteps)}
        write("schedulers/" + name, tensors)
        # lambda_min_clipped is -inf, which JSON does not know.
        config = {key: value for key, value in scheduler.config.items() if not key.startswith("_") and value != -math.inf}
        index[name] = {"class": kind, "config": config, "overrides": settings, "runs": runs, "file": name + ".safetensors"}
    (write.folder / "schedulers" / "index.json").write_text(json.dumps(index, indent=1, default=str))


def make_run(write, model, versions, tokenizer, encoder, unet, vae, controlnets):
    """Image to image with both ControlNets, classifier-free guidance and DDIM, as StableDiffusionControlNetImg2ImgPipeline does."""
    steps, strength, guidance, prompt, negative = 6, 0.8, 7.5, PROMPTS[0], PROMPTS[2]
    config = json.loads((model / "scheduler" / "scheduler_config.json").read_text())
    scheduler = diffusers.DDIMScheduler.from_config({**config, "_class_name": "DDIMScheduler", "timestep_spacing": "leading", "steps_offset": 1})
    scheduler.set_timesteps(steps)
    image = rand(700, 1, 3, 128, 96)
    conditions = {name: rand(701 + i, 1, 3, 128, 96) for i, name in enumerate(controlnets)}
    ids = {which: ids_of(tokenizer, [text]) for which, text in (("negative", negative), ("prompt", prompt))}
    states = {which: encoder(value).last_hidden_state for which, value in ids.items()}
    text = torch.cat([states["negative"], states["prompt"]])
    mean = vae.encode(2 * image - 1).latent_dist.mean
    scaled = mean * vae.config.scaling_factor
    noise = randn(710, *scaled.shape)
    timesteps = scheduler.timesteps[steps - int(steps * strength):]
    latent = noisy = scheduler.add_noise(scaled, noise, timesteps[:1])
    latents, predictions = [latent], {"uncond": [], "text": [], "guided": []}
    for timestep in timesteps:
        inputs = {"sample": torch.cat([latent] * 2), "timestep": timestep, "encoder_hidden_states": text}
        residuals = [residuals_of(controlnets[name], inputs, conditions[name].expand(2, -1, -1, -1), CONTROLNETS[name]) for name in controlnets]
        total = {key: sum(part[key] for part in residuals) for key in residuals[0]}
        out = call(unet, inputs, down_block_additional_residuals=[total[f"down_{i}"] for i in range(len(total) - 1)],
                   mid_block_additional_residual=total["mid"]).sample
        uncond, conditional = out.chunk(2)
        guided = uncond + guidance * (conditional - uncond)
        for key, value in zip(predictions, (uncond, conditional, guided)):
            predictions[key].append(value)
        latent = scheduler.step(guided, timestep, latent).prev_sample
        latents.append(latent)
    decoded = vae.decode(latent / vae.config.scaling_factor).sample
    decoded_01 = (decoded / 2 + 0.5).clamp(0, 1)
    write("e2e_img2img_ddim6",
          {"init_image_01": image, "init_latent_mean": mean, "init_latent_scaled": scaled, "noise": noise, "noisy_start": noisy,
           **{f"cond_{name}_01": value for name, value in conditions.items()}, **{"input_ids_" + which: value for which, value in ids.items()},
           **{"encoder_hidden_states_" + which: value for which, value in states.items()}, "timesteps": timesteps,
           **{"noise_pred_" + key: torch.stack(value) for key, value in predictions.items()}, "latents": torch.stack(latents),
           "final_latents": latent, "decoded": decoded, "decoded_01": decoded_01, "decoded_u8": (decoded_01 * 255).round().to(torch.uint8)},
          prompt=prompt, negative_prompt=negative, guidance_scale=str(guidance), steps=str(steps), strength=str(strength),
          controlnet_scales=",".join(str(scale) for scale in CONTROLNETS.values()), scheduler="DDIM leading steps_offset=1", made_by=versions)


@torch.no_grad()
def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("model", type=Path)
    arguments.add_argument("out", type=Path)
    arguments.add_argument("--prompts", type=Path, help="prompts of the tokenizer's cases, from an earlier tokenizer_cases.json")
    options = arguments.parse_args()
    torch.set_num_threads(1)
    write, model = Writer(options.out), options.model
    cases = [(c["name"], c["prompt"]) for c in json.loads(options.prompts.read_text())["cases"]] if options.prompts else [("", p) for p in PROMPTS]
    tokenizer = make_tokenizer_cases(write, model, cases)
    encoder = transformers.CLIPTextModel.from_pretrained(model / "text_encoder").eval()
    unet = diffusers.UNet2DConditionModel.from_pretrained(model / "unet").eval()
    vae = diffusers.AutoencoderKL.from_pretrained(model / "vae").eval()
    controlnets = {name: diffusers.ControlNetModel.from_pretrained(model / ("controlnet_" + name)).eval() for name in CONTROLNETS}
    versions = f"diffusers {diffusers.__version__}, transformers {transformers.__version__}, torch {torch.__version__}"

    make_text(write, encoder, tokenizer)
    make_vae(write, vae)
    timesteps = torch.tensor([0, 1, 10, 250, 500, 750.5, 946.4211, 999])
    write("timestep_embedding_320", {"timesteps": timesteps, "embedding": get_timestep_embedding(timesteps, 320, flip_sin_to_cos=True, downscale_freq_shift=0)})
    make_unet(write, unet)
    make_biased(write, unet)
    make_controlnets(write, unet, controlnets, 2 ** (len(vae.config.block_out_channels) - 1))
    make_schedulers(write)
    make_run(write, model, versions, tokenizer, encoder, unet, vae, controlnets)
    (options.out / "INDEX.json").write_text(json.dumps({"made_by": versions, "files": write.index}, indent=1))


if __name__ == "__main__":
    main()
