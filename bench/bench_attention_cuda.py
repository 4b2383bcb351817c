#!/usr/bin/env python3
"""patina's biased attention on a CUDA device against the framework's fastest unbiased attention and against
FlexAttention computing the same bias, all in one process.

    python3 bench/bench_attention_cuda.py                 # builds, checks, measures; some minutes
    python3 bench/bench_attention_cuda.py --rehearse      # without a GPU: builds, checks on an emulated one

Needs torch 2.x with CUDA, nvcc, ninja and a C++20 compiler; nothing else of patina's dependencies. Compiles
src/patina/{attention,nn} as it is (bench_attention_cuda.cpp) into build/bench_cuda. Writes `biased_over_sdpa` and
`flex_over_biased`, by head dimension and number of tokens, into build/bench/attention.json and leaves its other
keys as they are; the times behind them stand under `cuda`.

biased_over_sdpa = time of nn::attend with the bias / time of the fastest unbiased attention that the framework
has (flash, cuDNN, memory-efficient; without returning its log-sum-exp). flex_over_biased = time of
FlexAttention / time of nn::attend. Times are medians of device events over rounds in which every contestant runs
once; the first runs, with their compilations and uploads, are not counted.
"""

import argparse
import json
import math
import os
import shutil
import statistics
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
EXIT_NO_DEVICE = 3
BETA = 1.8
DEVICE = "cuda"

SOURCES = [
    "bench/bench_attention_cuda.cpp",
    "src/patina/attention/attention.cpp",
    "src/patina/attention/query_blocks.cpp",
    "src/patina/attention/cuda/bias_tiles.cpp",
    "src/patina/attention/cuda/sparse_merge.cpp",
    "src/patina/attention/cuda/sparse_merge_bf16.cu",
    "src/patina/attention/cuda/sparse_merge_f16.cu",
    "src/patina/base/error.cpp",
    "src/patina/nn/attend_cuda.cpp",
    "tools/emulated_gpu/emulated_gpu.cpp",
]


def fail(message: str, code: int = 2):
    print(f"bench_attention_cuda: {message}", file=sys.stderr)
    sys.exit(code)


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--report", type=Path, default=ROOT / "build/bench/attention.json")
    parser.add_argument("--build-dir", type=Path, default=ROOT / "build/bench_cuda")
    parser.add_argument("--head-dims", default="40,80,160", help="comma-separated (40,80,160)")
    parser.add_argument("--grids", default="3x64,3x128,4x128",
                        help="views a side x latent pixels of a view (3x64,3x128,4x128: 36,864, 147,456 and 262,144 tokens)")
    parser.add_argument("--heads", type=int, default=8)
    parser.add_argument("--batch", type=int, default=1)
    parser.add_argument("--dtype", choices=["bf16", "fp16"], default="bf16")
    parser.add_argument("--seconds", type=float, default=2.0, help="of measuring a shape, about (2)")
    parser.add_argument("--no-flex", action="store_true", help="leave FlexAttention out")
    parser.add_argument("--rehearse", action="store_true", help="without a GPU: build, load, check on the CPU")
    arguments = parser.parse_args()
    try:
        arguments.head_dims = [int(d) for d in arguments.head_dims.split(",")]
        arguments.grids = [tuple(int(n) for n in g.split("x")) for g in arguments.grids.split(",")]
    except ValueError:
        parser.error("--head-dims takes numbers such as 40,80, --grids pairs such as 3x64,4x128")
    if any(d % 8 or not 8 <= d <= 256 for d in arguments.head_dims):
        parser.error("--head-dims: expected multiples of 8 up to 256")
    if any(len(g) != 2 or min(g) < 1 for g in arguments.grids):
        parser.error("--grids: expected pairs such as 3x64")
    return arguments


def load_operators(build_dir: Path, capability: str):
    """Compiles patina's sources for `capability` and registers torch.ops.patina_bench."""
    for tool in ("nvcc", "ninja", os.environ.get("CXX", "c++")):
        if not shutil.which(tool):
            fail(f"{tool} is not on the PATH")
    os.environ["TORCH_CUDA_ARCH_LIST"] = capability
    from torch.utils import cpp_extension

    build_dir.mkdir(parents=True, exist_ok=True)
    start = time.time()
    cpp_extension.load(
        "patina_bench",
        [str(ROOT / source) for source in SOURCES],
        extra_include_paths=[str(ROOT / "src"), str(ROOT / "tools")],
        extra_cflags=["-O3", "-std=c++20"],
        extra_cuda_cflags=["-O3", "-std=c++20", "--expt-relaxed-constexpr"],
        build_directory=str(build_dir),
        is_python_module=False,
    )
    print(f"compiled and loaded in {time.time() - start:.0f} s")


def make_bias(grid, table):
    offsets, keys = flex.key_buckets(grid, table)
    return torch.classes.patina_bench.Bias(grid.side, grid.view, grid.view, grid.radius, offsets, keys)


def random_heads(batch, heads, tokens, dim, dtype, device, seed):
    """q, k, v [B,heads,N,d], as a network gives them: views of [B,N,heads·d]."""
    generator = torch.Generator(device).manual_seed(seed)
    return [
        torch.randn(batch, tokens, heads * dim, device=device, dtype=dtype, generator=generator)
        .unflatten(2, (heads, dim)).transpose(1, 2)
        for _ in range(3)
    ]


def merge_heads(x):
    return x.transpose(1, 2).flatten(2)


def exact_rows(q, k, v, scale, mask, beta, rows):
    """float64 attention of some rows: q[..., rows, :] -> [B,heads,len(rows),d] and their log-sum-exp. mask
    [len(rows), N] bool."""
    outs, sums = [], []
    for b in range(q.shape[0]):
        for h in range(q.shape[1]):  # a head at a time: float64 scores of all keys
            scores = q[b, h, rows].double() @ k[b, h].double().T * scale + beta * mask
            sums.append(torch.logsumexp(scores, -1))
            outs.append(torch.softmax(scores, -1) @ v[b, h].double())
    shape = (q.shape[0], q.shape[1], len(rows))
    return torch.stack(outs).reshape(*shape, -1), torch.stack(sums).reshape(shape)


def relative_error(found, exact):
    return ((found.double() - exact).norm() / exact.norm()).item()


# A 16-bit output alone is off by 2^-9 (bf16) or 2^-12 (fp16) at most; probabilities, dense and final rounding add up.
TOLERANCE = {"bf16": 6e-3, "fp16": 8e-4}


class Checks:
    def __init__(self):
        self.failed = 0

    def expect(self, condition: bool, what: str):
        if not condition:
            self.failed += 1
            print(f"  FAILED: {what}")


# ------------------------------------------------------------------------------------------------ rehearsal


def rehearse(arguments):
    """Everything but the device: build, operators, lists, FlexAttention's arithmetic, the kernel emulated."""
    load_operators(arguments.build_dir, "9.0")
    checks, ops = Checks(), torch.ops.patina_bench
    for side, view in arguments.grids:  # the lists of the real sizes
        grid = flex.Grid(side, view)
        table = flex.landings(grid)
        bias = make_bias(grid, table)
        start = time.time()
        blocks, tiles, size = bias.tile_counts()
        print(f"{grid.pixels:7d} tokens: {blocks} of {((view + 7) // 8 * side) ** 2} query blocks have biased "
              f"keys, {tiles} tiles, {size / 2**20:.1f} MiB, made in {time.time() - start:.2f} s")
        for query in torch.randint(grid.pixels, (16,)).tolist():
            mask = flex.biased_mask(grid, table, torch.tensor([query]))[0]
            checks.expect(torch.equal(bias.biased_keys(query), mask.nonzero().flatten()),
                          f"biased keys of query {query} in both forms, {grid}")

    grid = flex.Grid(2, 12, radius=2)  # views that are no multiple of 8
    table = flex.landings(grid)
    bias, rows = make_bias(grid, table), torch.arange(grid.pixels)
    mask = flex.biased_mask(grid, table, rows)
    for dim in arguments.head_dims:
        scale = 1 / math.sqrt(dim)
        for name, dtype in (("bf16", torch.bfloat16), ("fp16", torch.float16)):
            q, k, v = (t.contiguous() for t in random_heads(1, 2, grid.pixels, dim, dtype, "cpu", dim))
            out, log_sum_exp = exact_rows(q, k, v, scale, torch.zeros_like(mask), 0, rows)
            out, log_sum_exp = out.to(dtype), log_sum_exp.float()
            conflicts = ops.emulate_add_bias(out, log_sum_exp, q, k, v, scale, bias, BETA)
            exact, exact_sum = exact_rows(q, k, v, scale, mask, BETA, rows)
            error, sum_error = relative_error(out, exact), (log_sum_exp - exact_sum).abs().max().item()
            print(f"head_dim {dim:3d} {name}: emulated kernel off by {error:.1e}, its log-sum-exp by {sum_error:.0e}, "
                  f"{conflicts} bank conflicts")
            checks.expect(error < TOLERANCE[name] and sum_error < 1e-5 and conflicts == 0, f"kernel, {dim} {name}")
        if not arguments.no_flex:
            q, k, v = (t.float() for t in random_heads(1, 2, grid.pixels, dim, torch.float32, "cpu", dim))
            found = flex.FlexBias(grid, table, BETA)(q, k, v, scale)
            error = relative_error(found, exact_rows(q, k, v, scale, mask, BETA, rows)[0])
            print(f"head_dim {dim:3d} f32: FlexAttention off by {error:.1e}")
            checks.expect(error < 1e-5, f"FlexAttention, {dim}")
    entries = {"40": {"36864": 1.0}}
    scratch = arguments.build_dir / "rehearsal.json"
    scratch.write_text(json.dumps({"matrix_peak_gflops": 1, "flex_over_biased": {"40": {"1": 2.0}}}))
    merge_report(scratch, {"flex_over_biased": entries})
    checks.expect(json.loads(scratch.read_text()) == {"matrix_peak_gflops": 1,
                                                      "flex_over_biased": {"40": {"1": 2.0, "36864": 1.0}}},
                  "merging the report")
    print("rehearsal " + ("failed" if checks.failed else "passed: nothing was measured, nothing reported"))
    return 1 if checks.failed else 0


# -------------------------------------------------------------------------------------------------- device


def check_on_device(arguments, checks):
    """nn::attend against float64 over shapes, layouts, types and biases."""
    ops = torch.ops.patina_bench
    cases = [(dim, 3, 12, 2, 1.8) for dim in (8, 24, 40, 64, 72, 80, 96, 104, 128, 160, 192, 200, 256)]
    cases += [(40, side, view, radius, 1.8) for side, view, radius in
              ((1, 8, 1), (2, 8, 4), (2, 9, 2), (3, 17, 1), (4, 16, 0), (2, 33, 4), (3, 20, 30))]
    cases += [(dim, 3, 12, 2, beta) for dim in (40, 160) for beta in (1e-3, 0.3, 3.5, 8.0, 20.0, 100.0, -0.3, -1.0)]
    worst = {"bf16": 0.0, "fp16": 0.0}
    for name, dtype in (("bf16", torch.bfloat16), ("fp16", torch.float16)):
        for dim, side, view, radius, beta in cases:
            grid = flex.Grid(side, view, radius)
            table = flex.landings(grid)
            bias, rows = make_bias(grid, table), torch.arange(grid.pixels, device=DEVICE)
            mask = flex.biased_mask(grid, table.to(DEVICE), rows)
            scale, heads = 1 / math.sqrt(dim), 3
            q, k, v = random_heads(2, heads, grid.pixels, dim, dtype, DEVICE, dim)
            found = ops.attend(*map(merge_heads, (q, k, v)), heads, bias, beta)
            exact, exact_sum = exact_rows(q, k, v, scale, mask, beta, rows)
            plain_sum = exact_rows(q, k, v, scale, mask, 0, rows)[1]
            error = relative_error(found, merge_heads(exact))
            worst[name] = max(worst[name], error) if error == error else error
            # For beta < 0 the dense result's rounding grows by up to e^-beta.
            allowed = TOLERANCE[name] * max(1.0, math.exp(-beta))
            checks.expect(error < allowed, f"head_dim {dim} {name} {grid} beta {beta}: off by {error:.1e}")
            for kernel in ("cudnn", "flash", "efficient"):
                if not ops.takes(kernel, q):
                    continue
                out, log_sum_exp = ops.dense(kernel, q, k, v, scale)
                off = (log_sum_exp - plain_sum).abs().max().item()
                checks.expect(off < 2e-3, f"log-sum-exp of {kernel}, head_dim {dim} {name}: off by {off:.1e}")
                ops.add_bias(out, log_sum_exp, q, k, v, scale, bias, beta)
                off = (log_sum_exp - exact_sum).abs().max().item()
                checks.expect(off < 2e-3 * max(1.0, math.exp(-beta)),
                              f"biased log-sum-exp after {kernel}, head_dim {dim} {name} beta {beta}: off by {off:.1e}")
    print(f"{2 * len(cases)} cases of nn::attend against float64, worst relative error "
          f"{worst['bf16']:.1e} in bf16, {worst['fp16']:.1e} in fp16")

    # beta 0 is bit-equal to no bias; slices of a fused projection give what copies give; runs repeat.
    grid = flex.Grid(3, 20)
    bias, n = make_bias(grid, flex.landings(grid)), grid.pixels
    fused = torch.randn(2, n, 3 * 320, device=DEVICE, dtype=torch.bfloat16)
    q, k, v = fused.chunk(3, -1)
    checks.expect(torch.equal(ops.attend(q, k, v, 8, bias, 0.0), ops.attend(q, k, v, 8, None, 0.0)),
                  "beta 0 is not bit-equal to no bias")
    found = ops.attend(q, k, v, 8, bias, BETA)
    checks.expect(torch.equal(found, ops.attend(q, k, v, 8, bias, BETA)), "two runs differ")
    copies = ops.attend(q.contiguous(), k.contiguous(), v.contiguous(), 8, bias, BETA)
    checks.expect((found - copies).abs().max().item() < 1e-2, "slices of a fused projection differ from copies")
    odd = torch.randn(2, n, 3 * 320 + 4, device=DEVICE, dtype=torch.bfloat16)  # rows not on 16 bytes
    odd[..., 4:] = fused
    again = ops.attend(*odd[..., 4:].chunk(3, -1), 8, bias, BETA)
    checks.expect((found - again).abs().max().item() < 1e-2, "tensors off 16 bytes differ from copies")
    for beta in (-1.5, float("nan"), 2e4):
        try:
            ops.attend(q, k, v, 8, bias, beta)
            checks.expect(False, f"beta {beta} was not refused")
        except RuntimeError:
            pass
    torch.cuda.synchronize()


def measure(contestants, seconds):
    """Median milliseconds of each callable, by name. Every round runs each once, in order."""
    rounds = []
    begin = time.time()
    while len(rounds) < 3 or (time.time() - begin < seconds and len(rounds) < 100):
        events = {}
        for name, run in contestants.items():
            start, end = (torch.cuda.Event(enable_timing=True) for _ in range(2))
            start.record()
            run()
            end.record()
            events[name] = (start, end)
        torch.cuda.synchronize()
        rounds.append({name: start.elapsed_time(end) for name, (start, end) in events.items()})
    return {name: statistics.median(r[name] for r in rounds) for name in contestants}, len(rounds)


def sdpa(backend):
    from torch.nn.attention import sdpa_kernel

    def run(q, k, v, scale):
        with sdpa_kernel([backend]):
            return torch.nn.functional.scaled_dot_product_attention(q, k, v, scale=scale)

    return run


def measure_shape(arguments, checks, side, view, dim):
    from torch.nn.attention import SDPBackend

    ops, dtype = torch.ops.patina_bench, {"bf16": torch.bfloat16, "fp16": torch.float16}[arguments.dtype]
    grid = flex.Grid(side, view)
    table = flex.landings(grid)
    bias = make_bias(grid, table)
    table = table.to(DEVICE)
    scale, heads, n = 1 / math.sqrt(dim), arguments.heads, grid.pixels
    q, k, v = random_heads(arguments.batch, heads, n, dim, dtype, DEVICE, dim)
    flat = [merge_heads(t) for t in (q, k, v)]

    contestants = {}
    for kernel, backend in (("cudnn", SDPBackend.CUDNN_ATTENTION), ("flash", SDPBackend.FLASH_ATTENTION),
                            ("efficient", SDPBackend.EFFICIENT_ATTENTION)):
        if ops.takes(kernel, q):
            contestants[f"sdpa {kernel}"] = lambda run=sdpa(backend): run(q, k, v, scale)
            contestants[f"dense {kernel}"] = lambda kernel=kernel: ops.dense(kernel, q, k, v, scale)
    out, log_sum_exp = ops.dense(ops.rule(q), q, k, v, scale)
    contestants["merge"] = lambda: ops.add_bias(out, log_sum_exp, q, k, v, scale, bias, BETA)
    contestants["unbiased"] = lambda: ops.attend(*flat, heads, None, 0.0)
    contestants["biased"] = lambda: ops.attend(*flat, heads, bias, BETA)
    flex_bias = None if arguments.no_flex else flex.FlexBias(grid, table, BETA)
    if flex_bias:
        contestants["flex"] = lambda: flex_bias(q, k, v, scale)

    # The first run of each: compiles, uploads, and says what does not run here.
    results = {}
    for name in list(contestants):
        try:
            results[name] = contestants[name]()
            torch.cuda.synchronize()
        except torch.cuda.OutOfMemoryError:
            raise
        except Exception as error:  # whatever the framework says of a shape it does not take
            checks.expect(name != "biased" and name != "flex", f"{name} at {n} tokens, head_dim {dim} does not run")
            print(f"  {name} does not run at {n} tokens, head_dim {dim}: {str(error).splitlines()[0][:160]}")
            del contestants[name]
    rows = torch.randint(n, (64,), device=DEVICE)
    exact = exact_rows(q, k, v, scale, flex.biased_mask(grid, table, rows), BETA, rows)[0]
    biased = results["biased"].unflatten(2, (heads, dim)).transpose(1, 2)
    errors = {"biased": relative_error(biased[:, :, rows], exact)}
    if "flex" in results:
        errors["flex"] = relative_error(results["flex"][:, :, rows], exact)
        errors["flex against biased"] = relative_error(results["flex"], biased.double())
    for name, error in errors.items():
        checks.expect(error < 2 * TOLERANCE[arguments.dtype], f"{name} at {n} tokens, head_dim {dim}: off by {error:.1e}")
    del results, biased

    # Memory beyond the inputs: outputs, a copy at most, log-sum-exp, lists. N² bits alone would be n * n / 8 bytes a head.
    torch.cuda.synchronize()
    before = torch.cuda.memory_allocated()
    torch.cuda.reset_peak_memory_stats()
    contestants["biased"]()
    torch.cuda.synchronize()
    peak = torch.cuda.max_memory_allocated() - before
    inputs = 3 * q.numel() * q.element_size()
    checks.expect(peak < 2 * inputs + (64 << 20), f"{peak / 2**20:.0f} MiB beyond the inputs at {n} tokens")

    times, rounds = measure(contestants, arguments.seconds)
    sdpas = {name: t for name, t in times.items() if name.startswith("sdpa ")}
    fastest = min(sdpas, key=sdpas.get)
    entry = {
        "milliseconds": {name: round(t, 4) for name, t in times.items()},
        "rounds": rounds,
        "fastest_unbiased": fastest,
        "dense_kernel_of_attend": ops.rule(q),
        "errors": errors,
        "peak_bytes_beyond_inputs": peak,
        "dense_tflops": round(4 * n * n * dim * heads * arguments.batch / sdpas[fastest] * 1e-9, 1),
        "tiles": bias.tile_counts()[1],
        "biased_over_sdpa": times["biased"] / sdpas[fastest],
    }
    if "flex" in times:
        entry["flex_over_biased"] = times["flex"] / times["biased"]
    print(f"{n:7d} tokens, head_dim {dim:3d}: {fastest} {sdpas[fastest]:.3f} ms ({entry['dense_tflops']:.0f} TFLOP/s), "
          f"dense {entry['dense_kernel_of_attend']} with log-sum-exp {times['unbiased']:.3f}, merge {times['merge']:.3f}, "
          f"biased {times['biased']:.3f} = {entry['biased_over_sdpa']:.3f} x"
          + (f", flex {times['flex']:.3f} = {entry['flex_over_biased']:.2f} x biased" if "flex" in times else ""))
    return entry


def merge_report(path: Path, updates: dict):
    """Updates the report's keys, one level deep, and leaves the others."""
    report = json.loads(path.read_text()) if path.exists() else {}
    for key, value in updates.items():
        merged = report.setdefault(key, {})
        for name, entry in value.items():
            if isinstance(entry, dict) and isinstance(merged.get(name), dict):
                merged[name].update(entry)
            else:
                merged[name] = entry
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_suffix(".json.new")
    beside.write_text(json.dumps(report, indent=1))
    beside.replace(path)


def run(arguments):
    major, minor = torch.cuda.get_device_capability()
    name = torch.cuda.get_device_name()
    print(f"{name}, compute capability {major}.{minor}, torch {torch.__version__}, "
          f"cuDNN {torch.backends.cudnn.version()}")
    if major < 8:
        fail(f"{name} has compute capability {major}.{minor}; the kernel needs 8.0 or newer", EXIT_NO_DEVICE)
    load_operators(arguments.build_dir, f"{major}.{minor}")
    checks = Checks()
    check_on_device(arguments, checks)
    ratios = {"biased_over_sdpa": {}, "flex_over_biased": {}}
    shapes = {}
    for side, view in arguments.grids:
        for dim in arguments.head_dims:
            entry = measure_shape(arguments, checks, side, view, dim)
            tokens = str((side * view) ** 2)
            shapes[f"head_dim {dim}, {tokens} tokens"] = entry
            for key, by_dim in ratios.items():
                if key in entry:
                    by_dim.setdefault(str(dim), {})[tokens] = round(entry[key], 4)
            # After every shape, so that a run that is cut short leaves what it has.
            merge_report(arguments.report, ratios | {"cuda": {
                "device": name, "torch": torch.__version__, "cudnn": torch.backends.cudnn.version(),
                "dtype": arguments.dtype, "batch": arguments.batch, "heads": arguments.heads, "beta": BETA,
                "checks_failed": checks.failed, "shapes": shapes}})
    print(f"wrote {arguments.report}")
    for key, aim, over in (("biased_over_sdpa", 1.05, True), ("flex_over_biased", 2.0, False)):
        for dim, by_tokens in ratios[key].items():
            for tokens, value in by_tokens.items():
                if (value > aim) == over and value != aim:
                    print(f"  {key} of head_dim {dim} at {tokens} tokens is {value:.3f}; the aim is {'<=' if over else '>='} {aim}")
    if checks.failed:
        fail(f"{checks.failed} checks failed", 1)
    return 0


if __name__ == "__main__":
    arguments = parse_arguments()
    try:
        import torch

        sys.path.insert(0, str(HERE))
        import flex_attention as flex
    except ImportError as missing:
        fail(f"{missing}; a Python with torch 2.x is needed")
    if arguments.rehearse:
        sys.exit(rehearse(arguments))
    if not torch.cuda.is_available():
        fail("no CUDA device here: nothing was measured (--rehearse checks what can be checked without one)",
             EXIT_NO_DEVICE)
    with torch.no_grad():
        sys.exit(run(arguments))
