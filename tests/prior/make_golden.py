# Writes tests/data/prior/: a material network of random weights and what it makes of a random view, computed by NumPy
# alone, in f64 and straight from the description in docs/material-prior.md. Run: python3 tests/prior/make_golden.py
# Needs NumPy.
import json
import pathlib
import struct

import numpy as np

CHANNELS, GROUPS = [8, 16], 4
HEIGHT, WIDTH = 8, 12
random = np.random.default_rng(20)
weights = {}


def weight(name, *shape):
    if name not in weights:
        scale = 1 / np.sqrt(np.prod(shape[1:])) if len(shape) > 1 else 0.3
        value = scale * random.standard_normal(shape) + (1.0 if "norm" in name and "weight" in name else 0.0)
        weights[name] = value.astype(np.float16)  # what the file can hold exactly
    return weights[name].astype(np.float64)


def conv(x, name, channels, kernel, stride=1):
    w, b = weight(name + ".weight", channels, x.shape[0], kernel, kernel), weight(name + ".bias", channels)
    pad = kernel // 2
    padded = np.pad(x, ((0, 0), (pad, pad), (pad, pad)))
    rows, columns = (x.shape[1] - 1) // stride + 1, (x.shape[2] - 1) // stride + 1
    out = np.zeros((channels, rows, columns))
    for i in range(rows):
        for j in range(columns):
            cut = padded[:, i * stride:i * stride + kernel, j * stride:j * stride + kernel]
            out[:, i, j] = (w * cut).sum(axis=(1, 2, 3)) + b
    return out


def norm(x, name):
    grouped = x.reshape(GROUPS, -1)
    mean, variance = grouped.mean(axis=1, keepdims=True), grouped.var(axis=1, keepdims=True)
    flat = ((grouped - mean) / np.sqrt(variance + 1e-5)).reshape(x.shape)
    gain, bias = weight(name + ".weight", x.shape[0]), weight(name + ".bias", x.shape[0])
    return flat * gain[:, None, None] + bias[:, None, None]


def silu(x):
    return x / (1 + np.exp(-x))


def block(x, name):
    h = conv(silu(norm(x, name + ".norm1")), name + ".conv1", x.shape[0], 3)
    return x + conv(silu(norm(h, name + ".norm2")), name + ".conv2", x.shape[0], 3)


def pack(x):  # [C,H,W] -> [4C,H/2,W/2]; channel 4 c + 2 dy + dx is pixel (dy, dx) of each pair of pairs
    return np.stack([x[c, dy::2, dx::2] for c in range(x.shape[0]) for dy in (0, 1) for dx in (0, 1)])


def unpack(x):
    out = np.zeros((x.shape[0] // 4, 2 * x.shape[1], 2 * x.shape[2]))
    for c in range(x.shape[0]):
        out[c // 4, c // 2 % 2::2, c % 2::2] = x[c]
    return out


def linear(s):
    return np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4)


def srgb(l):
    return np.where(l <= 0.0031308, 12.92 * l, 1.055 * np.maximum(l, 1e-6) ** (1 / 2.4) - 0.055)


def light(picture):
    mapped = np.minimum(linear(picture), 0.985)
    return mapped / (1 - mapped)


edited, render = random.random((3, HEIGHT, WIDTH)), random.random((3, HEIGHT, WIDTH))
base = random.random((3, HEIGHT, WIDTH))
roughness, metallic = random.random((1, HEIGHT, WIDTH)), random.random((1, HEIGHT, WIDTH))
mask = (random.random((1, HEIGHT, WIDTH)) < 0.8).astype(np.float64)
normal = random.standard_normal((3, HEIGHT, WIDTH))
normal[2] = np.abs(normal[2]) + 0.3
normal /= np.linalg.norm(normal, axis=0)
inputs = dict(edited=edited, render=render, normal=normal, base_color=base, roughness=roughness, metallic=metallic,
              mask=mask)
inputs = {name: value.astype(np.float32) for name, value in inputs.items()}
edited, render, normal, base, roughness, metallic, mask = [v.astype(np.float64) for v in inputs.values()]

divided = srgb(np.clip(linear(base) * (light(edited) + 0.002) / (light(render) + 0.002), 0, 1))
x = np.concatenate([edited - 0.5, render - 0.5, normal * mask, (base - 0.5) * mask, (divided - 0.5) * mask,
                    (roughness - 0.5) * mask, (metallic - 0.5) * mask, mask])
fine = block(conv(pack(x), "conv_in", CHANNELS[0], 3), "levels.0.down")
coarse = block(conv(fine, "levels.0.downsample", CHANNELS[1], 3, stride=2), "levels.1.down")
coarse = block(coarse, "levels.1.up")
up = conv(coarse, "levels.0.upsample", CHANNELS[0], 1).repeat(2, axis=1).repeat(2, axis=2)
h = block(up + fine, "levels.0.up")
y = unpack(conv(silu(norm(h, "norm_out")), "conv_out", 40, 3))
error = np.exp(np.clip(y[7:] + np.log(0.1), -6, 1))
outputs = dict(base_color=divided + y[0:3], roughness=roughness + y[3:4], metallic_logit=3 * (2 * metallic - 1) + y[4:5],
               slope=y[5:7], base_color_error=error[0:1], roughness_error=error[1:2], slope_error=error[2:3])


def write_safetensors(path, tensors):
    kinds = {"float16": "F16", "float32": "F32"}
    header, offset = {}, 0
    for name, value in tensors.items():
        header[name] = {"dtype": kinds[str(value.dtype)], "shape": list(value.shape),
                        "data_offsets": [offset, offset + value.nbytes]}
        offset += value.nbytes
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    path.write_bytes(struct.pack("<Q", len(text)) + text + b"".join(v.tobytes() for v in tensors.values()))


folder = pathlib.Path(__file__).parent.parent / "data" / "prior"
folder.mkdir(parents=True, exist_ok=True)
(folder / "config.json").write_text(json.dumps({"channels": CHANNELS, "norm_groups": GROUPS}) + "\n")
write_safetensors(folder / "material.safetensors", weights)
write_safetensors(folder / "golden.safetensors",
                  {"in." + name: value for name, value in inputs.items()} |
                  {"out." + name: value.astype(np.float32) for name, value in outputs.items()})
