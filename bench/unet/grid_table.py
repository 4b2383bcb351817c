"""The paper's table [Hadadan2025, Tab. 1]: seconds and peak memory of 4, 9 and 16 views of 512² and 1024², patina beside eager
diffusers with FlexAttention carrying the same bias. Prints it and writes `grids` into build/bench/unet.json.

    cmake --preset cuda -DCMAKE_PREFIX_PATH=$(python3 -c 'import torch; print(torch.utils.cmake_prefix_path)')
    cmake --build build/cuda --target bench_grid
    python3 bench/unet/grid_table.py                                                # needs torch, diffusers, safetensors
    python3 bench/unet/grid_table.py --device cpu --views 4 --sizes 64 --steps 1    # how it goes, without a GPU

Each cell is a process of its own. `seconds` are those of encoding, 20 guided steps and decoding, of which --steps are measured
after a first one that is not (it compiles and takes memory). A cell that fails (no memory, say) keeps the reason.
"""

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(HERE.parent))
sys.path.insert(0, str(HERE))
STEPS = 20  # of a whole run


def write_bias(path, grid, view):
    """What bench_grid reads: keys by the cell they land on, for every resolution of the U-Net."""
    from diffusers_grid_peer import levels
    from flex_attention import key_buckets, landings
    from safetensors.torch import save_file

    tensors, metadata = {}, {"grid": str(grid)}
    for number, level in enumerate(levels(grid, view)):
        tensors[f"offsets_{number}"], tensors[f"keys_{number}"] = key_buckets(level, landings(level))
        metadata |= {f"view_{number}": str(level.view), f"radius_{number}": str(level.radius)}
    save_file(tensors, path, metadata)


def measured(command):
    """The JSON that `command` prints, with the seconds of a whole run, or {"failed": last line of its errors}."""
    # LibTorch's waiting threads sleep: spinning ones take the processors from the attention kernels.
    environment = {"OMP_WAIT_POLICY": "passive"} | os.environ
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, env=environment)
    if done.returncode:
        lines = done.stderr.strip().splitlines()
        return {"failed": lines[-1][:300] if lines else f"exit status {done.returncode}"}
    cell = json.loads(done.stdout[done.stdout.index("{") :])
    cell["seconds"] = cell["encode_seconds"] + STEPS * cell["step_seconds"] + cell["decode_seconds"]
    return cell


def cell_text(cell):
    return f"{cell['seconds']:9.1f} s {cell['peak_gb']:6.1f} GB" if "seconds" in cell else f"{'failed':>20}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--report", type=Path, default=ROOT / "build/bench/unet.json")
    parser.add_argument("--bench", type=Path, default=ROOT / "build/cuda/bench_grid")
    parser.add_argument("--views", type=int, nargs="+", default=[4, 9, 16])
    parser.add_argument("--sizes", type=int, nargs="+", default=[512, 1024], help="pixels a side of a view")
    parser.add_argument("--steps", type=int, default=4, help="how many steps are measured")
    parser.add_argument("--device", default="cuda", choices=("cuda", "cpu"))
    parser.add_argument("--dtype", default="bf16", choices=("bf16", "f16", "f32"))
    parser.add_argument("--no-peer", action="store_true", help="patina alone")
    arguments = parser.parse_args()
    if not arguments.bench.exists():
        raise SystemExit(f"grid_table: {arguments.bench} is not there; --help says how to build it")
    for views in arguments.views:
        if math.isqrt(views) ** 2 != views:
            raise SystemExit(f"grid_table: {views} views make no square grid")
    for size in arguments.sizes:
        if size % 64:
            raise SystemExit(f"grid_table: views of {size} pixels; expected multiples of 64, which the U-Net halves")

    report = json.loads(arguments.report.read_text()) if arguments.report.exists() else {}
    report["grids"] = table = {"device": arguments.device, "dtype": arguments.dtype, "steps_measured": arguments.steps}
    common = ["--steps", arguments.steps, "--device", arguments.device, "--dtype", arguments.dtype]
    print(f"{'views':>12}  {'patina':>20}  {'diffusers, FlexAttention':>24}")
    for size in arguments.sizes:
        for views in arguments.views:
            grid, view = math.isqrt(views), size // 8
            with tempfile.TemporaryDirectory() as folder:
                bias = Path(folder) / "bias.safetensors"
                write_bias(bias, grid, view)
                cell = {"patina": measured([arguments.bench, bias, *common])}
            if not arguments.no_peer:
                peer = [sys.executable, HERE / "diffusers_grid_peer.py", "--grid", grid, "--view", view]
                cell["diffusers"] = measured([*peer, *common])
            table[f"{views}x{size}"] = cell
            print(f"{views:>5} x {size:>4}  " + "  ".join(cell_text(each) for each in cell.values()), flush=True)
            for name, each in cell.items():
                if "failed" in each:
                    print(f"{'':>12}  {name}: {each['failed']}")
            arguments.report.parent.mkdir(parents=True, exist_ok=True)
            arguments.report.write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    main()
