"""The peer of bench_grid: a whole view grid in eager diffusers, with FlexAttention carrying the same bias.

    python3 bench/unet/diffusers_grid_peer.py --grid 2 --view 64 [--steps 4] [--device cuda] [--dtype bf16]

Stable Diffusion 1.5's networks with random weights: views encoded one by one, guided steps of the U-Net (its self-attention
biased) and two ControlNets, views decoded one by one. Prints the same JSON as bench_grid. grid_table.py runs both.
"""

import argparse
import json
import math
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parent))

STEPS, GUIDANCE, WEIGHT = 20, 7.5, 1.8  # as in grid.cpp
RADII = (4, 2, 1, 0)  # of the bias's windows at the U-Net's four resolutions


def levels(grid, view):
    """The U-Net's resolutions for grid x grid views of view x view latent pixels, finest first."""
    from flex_attention import Grid

    return [Grid(grid, view >> level, radius) for level, radius in enumerate(RADII)]


def biased_processor(biases):
    """An attention processor of diffusers: self-attention with the bias of its resolution."""

    def process(attention, hidden_states, encoder_hidden_states=None, attention_mask=None, temb=None, **_):
        batch, tokens, _ = hidden_states.shape
        query, key, value = (
            projection(hidden_states).view(batch, tokens, attention.heads, -1).transpose(1, 2)
            for projection in (attention.to_q, attention.to_k, attention.to_v)
        )
        out = biases[tokens](query, key, value, attention.scale)
        return attention.to_out[0](out.transpose(1, 2).reshape(batch, tokens, -1))

    return process


def add_bias(unet, grid, view, device):
    """Biases the self-attention of every layer of `unet`; their resolution is told by the number of tokens."""
    from flex_attention import FlexBias, landings

    processor = biased_processor(
        {level.pixels: FlexBias(level, landings(level).to(device), WEIGHT) for level in levels(grid, view)}
    )
    unet.set_attn_processor(
        {
            name: processor if name.removesuffix(".processor").endswith("attn1") else original
            for name, original in unet.attn_processors.items()
        }
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--grid", type=int, required=True, help="views a side")
    parser.add_argument("--view", type=int, required=True, help="latent pixels a side of one view")
    parser.add_argument("--steps", type=int, default=4, help="how many to measure, after the first")
    parser.add_argument("--device", default="cuda", choices=("cuda", "cpu"))
    parser.add_argument("--dtype", default="bf16", choices=("bf16", "f16", "f32"))
    arguments = parser.parse_args()
    import resource

    import torch
    from diffusers import AutoencoderKL, ControlNetModel, UNet2DConditionModel, UniPCMultistepScheduler

    from diffusers_peer import UNET, VAE

    grid, view, device = arguments.grid, arguments.view, arguments.device
    dtype = dict(bf16=torch.bfloat16, f16=torch.float16, f32=torch.float32)[arguments.dtype]
    on_device = dict(device=device, dtype=dtype)
    synchronize = torch.cuda.synchronize if device == "cuda" else lambda: None

    def seconds_of(work):
        synchronize()
        start = time.perf_counter()
        work()
        synchronize()
        return time.perf_counter() - start

    controlnet = {key: UNET[key] for key in UNET if key not in ("sample_size", "out_channels", "up_block_types")}
    result = {}
    with torch.inference_mode():
        torch.manual_seed(1)
        networks = [UNet2DConditionModel(**UNET), AutoencoderKL(**VAE)]
        networks += [ControlNetModel(**controlnet) for _ in range(2)]
        unet, vae, tile, normal = (n.to(**on_device).to(memory_format=torch.channels_last).eval() for n in networks)
        add_bias(unet, grid, view, device)

        image = torch.rand(1, 3, 8 * view, 8 * view, **on_device)
        encode = lambda: [vae.encode(image).latent_dist.mean.cpu() for _ in range(grid * grid)]
        encode()
        result["encode_seconds"] = seconds_of(encode)

        side = grid * view
        latents = torch.randn(1, 4, side, side, **on_device)
        hint = torch.rand(2, 3, 8 * side, 8 * side, **on_device)
        text = torch.randn(2, 77, 768, **on_device)
        scheduler = UniPCMultistepScheduler(beta_start=0.00085, beta_end=0.012, beta_schedule="scaled_linear")
        scheduler.set_timesteps(STEPS, device=device)

        def step(latents, when):
            both = latents.expand(2, -1, -1, -1)
            kept = None
            for network in (tile, normal):
                down, mid = network(both, when, text, hint, return_dict=False)
                kept = (down, mid) if kept is None else ([a + b for a, b in zip(kept[0], down)], kept[1] + mid)
            out = unet(both, when, text, down_block_additional_residuals=kept[0],
                       mid_block_additional_residual=kept[1]).sample  # fmt: skip
            negative, positive = out.chunk(2)
            return scheduler.step(negative + GUIDANCE * (positive - negative), when, latents).prev_sample

        times = []
        for when in scheduler.timesteps[: 1 + arguments.steps]:
            synchronize()
            start = time.perf_counter()
            latents = step(latents, when)
            synchronize()
            times.append(time.perf_counter() - start)
        result["first_step_seconds"] = times[0]  # compiles
        result["step_seconds"] = sum(times[1:]) / arguments.steps

        small = torch.randn(1, 4, view, view, **on_device)
        decode = lambda: [vae.decode(small).sample.cpu() for _ in range(grid * grid)]
        decode()
        result["decode_seconds"] = seconds_of(decode)
    if device == "cuda":
        result["peak_gb"] = torch.cuda.max_memory_allocated() * 1e-9
    else:
        result["peak_gb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024e-9
    if not all(math.isfinite(value) for value in result.values()):
        raise SystemExit(f"diffusers_grid_peer: figures that are no numbers: {result}")
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
