#!/usr/bin/env python3
"""Renders two real assets under one HDR with patina and with Blender's Cycles and says how they differ.

    python3 bench/compare_cycles.py --build build/release --shared ../shared [--out build/bench] [--samples 512] [--size 320]

Needs Debian's `blender` and `python3-numpy` and the program bench_render_view. Writes OUT/cycles_<asset>.png (patina, Cycles, half grey plus four
times their difference), the EXR files, and OUT/cycles.json with the numbers that docs/cycles.md explains.
"""
import argparse
import json
import os
import pathlib
import subprocess
import sys

# Path below assets/, eye and target in glTF's axes, metres.
VIEWS = {
    "bottle": ("WaterBottle/WaterBottle.gltf", (0.18, 0.15, 0.40), (0.0, 0.0, 0.0)),
    "shoe": ("MaterialsVariantsShoe/MaterialsVariantsShoe.gltf", (0.30, 0.25, 0.42), (0.0, 0.05, 0.0)),
}
FOV_DEGREES = "35"
EXPOSURE_EV = "2"  # of the pictures
DEPTH = "9"  # segments after the camera ray: Cycles counts bounces (8), the last of which may still reach a light


def run(command):
    # Debian's Blender looks for its Python along PATH: one of the user's own, without numpy, must not come first.
    environment = {**os.environ, "PATH": "/usr/bin:/bin:" + os.environ.get("PATH", "")}
    result = subprocess.run([str(c) for c in command], capture_output=True, text=True, env=environment)
    if result.returncode != 0:
        sys.exit(f"{command[0]} failed:\n{result.stdout[-2000:]}\n{result.stderr[-2000:]}")
    return result.stdout


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--build", type=pathlib.Path, default="build/release", help="folder that holds bench_render_view")
    parser.add_argument("--shared", type=pathlib.Path, default="../shared", help="folder that holds assets/ and assets/hdri/")
    parser.add_argument("--out", type=pathlib.Path, default="build/bench", help="folder to write to")
    parser.add_argument("--environment", default="adams_place_bridge_1k.hdr", help="file of assets/hdri/")
    parser.add_argument("--samples", type=int, default=512, help="paths a pixel, of both")
    parser.add_argument("--size", type=int, default=320, help="pixels a side")
    arguments = parser.parse_args()

    out = arguments.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    assets = (arguments.shared / "assets").resolve()
    hdr = assets / "hdri" / arguments.environment
    report = {"environment": arguments.environment, "samples": arguments.samples, "size": arguments.size}
    for name, (path, eye, target) in VIEWS.items():
        cycles = out / f"cycles_{name}_cycles.exr"
        script = pathlib.Path(__file__).with_name("cycles_view.py")
        log = run(["blender", "-b", "--factory-startup", "--python-exit-code", "1", "-P", script, "--", assets / path, hdr, cycles, arguments.size,
             arguments.samples, FOV_DEGREES, *eye, *target])
        if not cycles.exists():
            sys.exit(f"Blender wrote no {cycles}:\n{log[-2000:]}")
        measured = json.loads(next(line for line in log.splitlines() if line.startswith("measured "))[len("measured "):])
        for model in ("gltf", "principled"):
            picture = [] if model != "gltf" else ["--picture", out / f"cycles_{name}.png"]
            numbers = out / f"cycles_{name}_{model}.json"
            run([arguments.build / "bench_render_view", assets / path, out / f"cycles_{name}_{model}.exr", "--environment", hdr,
                 "--eye", *eye, "--target", *target, "--fov", FOV_DEGREES, "--size", arguments.size, "--samples",
                 arguments.samples, "--depth", DEPTH, "--exposure", EXPOSURE_EV, "--reference", cycles, "--report", numbers, *picture,
                 *(["--principled"] if model == "principled" else [])])
            found = json.loads(numbers.read_text()) | measured
            # Noise falls with the root of the samples, so time times variance is what equal noise costs.
            found["cycles_over_patina"] = (found["seconds_of_cycles"] * found["relative_noise_of_cycles"] ** 2
                                           / (found["seconds"] * found["relative_noise_of_patina"] ** 2))
            report[f"{name}_{model}"] = found
            numbers.unlink()
    (out / "cycles.json").write_text(json.dumps(report, indent=2) + "\n")
    print(json.dumps(report, indent=2))


if __name__ == "__main__":
    main()
