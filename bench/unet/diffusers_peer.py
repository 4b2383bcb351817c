"""Stable Diffusion 1.5's U-Net and VAE of random weights in diffusers, on this machine's processor, beside patina's figures.

    python3 -m venv peers && peers/bin/pip install torch diffusers transformers
    peers/bin/python bench/unet/diffusers_peer.py --report build/bench/unet.json

bf16, channels last, both eager and compiled; the faster counts. Adds diffusers_* to the report that bench_unet wrote in the same run.
"""

import argparse
import json
import time

UNET = dict(
    sample_size=64,
    in_channels=4,
    out_channels=4,
    block_out_channels=(320, 640, 1280, 1280),
    layers_per_block=2,
    cross_attention_dim=768,
    attention_head_dim=8,
    down_block_types=("CrossAttnDownBlock2D",) * 3 + ("DownBlock2D",),
    up_block_types=("UpBlock2D",) + ("CrossAttnUpBlock2D",) * 3,
)
VAE = dict(
    block_out_channels=(128, 256, 512, 512),
    layers_per_block=2,
    latent_channels=4,
    down_block_types=("DownEncoderBlock2D",) * 4,
    up_block_types=("UpDecoderBlock2D",) * 4,
)


def best_seconds(repeat, work):
    best = float("inf")
    for _ in range(repeat):
        start = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - start)
    return best


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--report", required=True)
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--no-compile", action="store_true")
    arguments = parser.parse_args()
    import torch  # here, so that --help works without them
    from diffusers import AutoencoderKL, UNet2DConditionModel

    if arguments.threads:
        torch.set_num_threads(arguments.threads)
    with open(arguments.report) as file:
        report = json.load(file)

    dtype = torch.bfloat16
    with torch.inference_mode():
        unet = UNet2DConditionModel(**UNET).to(dtype).to(memory_format=torch.channels_last).eval()
        sample = torch.randn(1, 4, 64, 64, dtype=dtype).to(memory_format=torch.channels_last)
        text, when = torch.randn(1, 77, 768, dtype=dtype), torch.tensor([500])
        networks = {"eager": unet} if arguments.no_compile else {"eager": unet, "compiled": torch.compile(unet)}
        for name, network in networks.items():
            network(sample, when, encoder_hidden_states=text)  # compiles
            seconds = best_seconds(arguments.repeat, lambda: network(sample, when, encoder_hidden_states=text))
            report[f"diffusers_unet_{name}_seconds"] = seconds
        del unet, networks
        vae = AutoencoderKL(**VAE).to(dtype).to(memory_format=torch.channels_last).eval()
        vae.decode(sample)
        report["diffusers_vae_decode_seconds"] = best_seconds(2, lambda: vae.decode(sample))
    fastest = min(value for key, value in report.items() if key.startswith("diffusers_unet_"))
    report["diffusers_torch"] = torch.__version__
    report["diffusers_over_patina"] = fastest / report["unet_512_seconds"]
    with open(arguments.report, "w") as file:
        json.dump(report, file, indent=1)
    print(json.dumps({key: value for key, value in report.items() if key.startswith("diffusers")}, indent=1))


if __name__ == "__main__":
    main()
