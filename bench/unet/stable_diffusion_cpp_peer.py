"""Stable Diffusion 1.5 of random weights in stable-diffusion.cpp (ggml), on this machine's processor, beside patina's figures.

    python3 -m venv peers && peers/bin/pip install stable-diffusion-cpp-python pillow
    peers/bin/python bench/unet/stable_diffusion_cpp_peer.py --report build/bench/unet.json --make build/release/make_checkpoint

One image of 512² without guidance, so that a step is one evaluation of the U-Net; the best step counts, and what is left after the last
one is the VAE. --direct takes flash attention and direct convolutions, which may be the faster. Adds stable_diffusion_cpp_* to the report that
bench_unet wrote in the same run.
"""

import argparse
import json
import os
import subprocess
import tempfile
import time
from importlib.metadata import version


def seconds_of(checkpoint, threads, steps, direct):
    """Seconds of the best step and of the VAE's decoding."""
    from stable_diffusion_cpp import StableDiffusion  # here, so that --help works without it

    engine = StableDiffusion(
        model_path=checkpoint,
        n_threads=threads,
        diffusion_flash_attn=direct,
        diffusion_conv_direct=direct,
        vae_conv_direct=direct,
        verbose=True,  # it calls back only then
    )
    ends = []

    def on_progress(step, of, seconds):
        if of == steps and len(ends) <= steps:
            ends.append(time.perf_counter())

    engine.generate_image(
        prompt="a kettle",
        cfg_scale=1.0,
        width=512,
        height=512,
        sample_steps=steps,
        sample_method="euler",
        progress_callback=on_progress,
    )
    done = time.perf_counter()
    return min(after - before for before, after in zip(ends, ends[1:])), done - ends[-1]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--report", required=True)
    parser.add_argument("--make", required=True, help="the program make_checkpoint")
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--steps", type=int, default=3)
    parser.add_argument("--direct", action="store_true", help="flash attention and direct convolutions")
    arguments = parser.parse_args()
    with open(arguments.report) as file:
        report = json.load(file)

    with tempfile.TemporaryDirectory() as folder:
        checkpoint = os.path.join(folder, "sd15.safetensors")
        subprocess.run([arguments.make, "--layout", "single", checkpoint], check=True)
        step, decode = seconds_of(checkpoint, arguments.threads, arguments.steps, arguments.direct)
    report["stable_diffusion_cpp_version"] = version("stable-diffusion-cpp-python")
    report["stable_diffusion_cpp_unet_seconds"] = step
    report["stable_diffusion_cpp_vae_decode_seconds"] = decode
    report["stable_diffusion_cpp_over_patina"] = report["stable_diffusion_cpp_unet_seconds"] / report["unet_512_seconds"]
    with open(arguments.report, "w") as file:
        json.dump(report, file, indent=1)
    print(json.dumps({key: value for key, value in report.items() if key.startswith("stable_diffusion_cpp")}, indent=1))


if __name__ == "__main__":
    main()
