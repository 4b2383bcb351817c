"""The peer of bench_attention_cuda.py: the same bias through PyTorch's FlexAttention, as the paper computes it
[Hadadan2025, Sec. 5; Dong2024]: every score is looked at, and beta is added where the key's surface point lands in the
query's window. It needs no N x N memory either, but the test runs N^2 times a head.

The correspondences are those of views of a cylinder at equal steps of azimuth, as in bench_attention.cpp: the
object covers the middle 80 % of each view, and a key lands in another view where its surface point faces it.
"""

import math
from dataclasses import dataclass

import torch
from torch.nn.attention.flex_attention import flex_attention

NOWHERE = 0x3FFF  # a coordinate further from every pixel than any window reaches


@dataclass(frozen=True)
class Grid:
    """Views of `view` x `view` latent pixels, `side` x `side` of them; a window is (2 radius + 1)^2 cells."""

    side: int
    view: int
    radius: int = 4

    @property
    def width(self) -> int:
        return self.side * self.view

    @property
    def pixels(self) -> int:
        return self.width * self.width


def landings(grid: Grid) -> torch.Tensor:
    """[views, N] i32: where key j lands in each view, as y << 16 | x over the whole grid; NOWHERE for both if it
    does not, or lies in that view itself."""
    views, size = grid.side * grid.side, grid.view
    key = torch.arange(grid.pixels)
    x, y = key % grid.width, key // grid.width
    u = ((x % size) + 0.5) / size * 2 - 1
    v = ((y % size) + 0.5) / size * 2 - 1
    on_object = (u.abs() <= 0.8) & (v.abs() <= 0.8)
    own = torch.div(y, size, rounding_mode="floor") * grid.side + torch.div(x, size, rounding_mode="floor")
    azimuth = torch.asin((u / 0.8).clamp(-1, 1))
    table = torch.full((views, grid.pixels), NOWHERE << 16 | NOWHERE, dtype=torch.int32)
    for view in range(views):
        angle = azimuth + 2 * math.pi * (own - view) / views
        column = ((0.8 * torch.sin(angle) + 1) / 2 * size).long()
        lands = on_object & (own != view) & (torch.cos(angle) >= 0.1)
        at_x, at_y = view % grid.side * size + column, view // grid.side * size + y % size
        table[view] = torch.where(lands, at_y << 16 | at_x, NOWHERE << 16 | NOWHERE).int()
    return table


def key_buckets(grid: Grid, table: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """offsets [N+1] and keys, both i32, of attention::KeyBuckets: keys by the cell on which they land."""
    view, key = torch.nonzero(table != (NOWHERE << 16 | NOWHERE), as_tuple=True)
    landing = table[view, key].long()
    cell = (landing >> 16) * grid.width + (landing & 0xFFFF)
    order = torch.argsort(cell * grid.pixels + key)
    offsets = torch.zeros(grid.pixels + 1, dtype=torch.int64)
    offsets[1:] = torch.cumsum(torch.bincount(cell, minlength=grid.pixels), 0)
    return offsets.int(), key[order].int()


def biased_mask(grid: Grid, table: torch.Tensor, queries: torch.Tensor) -> torch.Tensor:
    """[len(queries), N] bool: the definition of S_i, for checks."""
    x, y = queries % grid.width, torch.div(queries, grid.width, rounding_mode="floor")
    view = torch.div(y, grid.view, rounding_mode="floor") * grid.side
    view = view + torch.div(x, grid.view, rounding_mode="floor")
    landing = table[view]
    near_x = ((landing & 0xFFFF) - x[:, None]).abs() <= grid.radius
    near_y = ((landing >> 16) - y[:, None]).abs() <= grid.radius
    return near_x & near_y


class FlexBias:
    """Biased attention of q, k, v [B,heads,N,d] through a compiled FlexAttention."""

    def __init__(self, grid: Grid, table: torch.Tensor, beta: float):
        device = table.device
        query = torch.arange(grid.pixels, device=device)
        x, y = query % grid.width, torch.div(query, grid.width, rounding_mode="floor")
        view = torch.div(y, grid.view, rounding_mode="floor") * grid.side
        view = view + torch.div(x, grid.view, rounding_mode="floor")
        # What depends on the query alone is looked up once a row: its view's part of the table and its place.
        row = (view * grid.pixels).int()
        x, y = x.int(), y.int()
        flat = table.reshape(-1).contiguous()
        radius = grid.radius

        def add_bias(score, _batch, _head, q, k):
            landing = flat[row[q] + k]
            near = (((landing & 0xFFFF) - x[q]).abs() <= radius) & (((landing >> 16) - y[q]).abs() <= radius)
            return torch.where(near, score + beta, score)

        self._score_mod = add_bias
        # Past some recompilations of one function, torch.compile would run it uncompiled, with all scores in memory.
        torch.compiler.reset()
        self._compiled = torch.compile(flex_attention, dynamic=False)
        self._padded = False  # a head dimension that FlexAttention refuses is padded to a power of two

    def __call__(self, q, k, v, scale: float):
        dim = q.shape[-1]
        if not self._padded:
            try:
                return self._compiled(q, k, v, score_mod=self._score_mod, scale=scale)
            except Exception:  # torch.compile wraps what the kernel's template says in types of its own
                if dim & (dim - 1) == 0:
                    raise
                self._padded = True
        pad = (0, (1 << (dim - 1).bit_length()) - dim)
        q, k, v = (torch.nn.functional.pad(t, pad) for t in (q, k, v))
        return self._compiled(q, k, v, score_mod=self._score_mod, scale=scale)[..., :dim]
