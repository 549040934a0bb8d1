"""Random numbers of the samplers, drawn by the kernels."""

from __future__ import annotations

import numpy as np
from kernel_probes import key_of

from renderer.kernels.jit import entry_kernel
from renderer.kernels.lanes.memory import load_row, store_row
from renderer.plugins.sampling.numbers_and_warps import Independent, Stratified, draw4
from renderer.plugins.sampling.sobol import Sobol


@entry_kernel
def run_draw4(sampler, pixels, sample, block, out):
    for i in range(0, pixels.size, 16):
        row = 0
        for number in draw4(sampler, key_of(load_row(pixels, 0, i)), sample, block):
            store_row(out, row, i, number)
            row += 1


def draw(sampler, pixels, sample, block):
    """Four rows of float64 numbers, one column a pixel."""
    pixels = np.ascontiguousarray(pixels, np.uint32)
    padded = np.pad(pixels, (0, -pixels.size % 16))
    out = np.empty((4, padded.size), np.float32)
    run_draw4(sampler, padded, sample, block, out)
    return out[:, : pixels.size].astype(float)


def multijitter(seed, columns, rows):
    return Stratified(seed, columns, rows, 1.0, 1)


def samplers(columns, rows, seed=7):
    """Plain strata, and correlated multi-jittering."""
    return Stratified(seed, columns, rows, 1.0, None), multijitter(seed, columns, rows)


def label(sampler):
    if isinstance(sampler, Independent):
        return "independent"
    if isinstance(sampler, Sobol):
        return f"sobol of 2^{sampler.bits}, {'net' if sampler.plain else 'sequence'}"
    name = "stratified" if sampler.multi is None else "multijitter"
    return f"{name} {sampler.columns} x {sampler.rows}"


def whole_grid(sampler, count, pixels, block=1, first=0):
    """All samples of a grid: (count, 4, pixels)."""
    return np.array([draw(sampler, pixels, first + s, block) for s in range(count)])
