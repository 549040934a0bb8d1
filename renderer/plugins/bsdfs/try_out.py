"""Test calls of a BSDF's kernels with a few directions and random numbers, to find NaN."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import entry_kernel, pack
from renderer.kernels.lanes.memory import load_row, store_row
from renderer.kernels.lanes.vectors import load3, store3
from renderer.plugins.bsdfs.kind import (
    BsdfKind,
    BsdfMethods,
    Numbers,
    eval_pdf_bsdf,
    sample_bsdf,
)
from renderer.plugins.bsdfs.parameters import parameters_at
from renderer.plugins.sampling.numbers_and_warps import Plain

COUNT = 64


class Points(NamedTuple):
    """The fields that `parameters_at` reads."""

    parameters: NDArray[np.float32]  # (rows, n)
    bsdf: NDArray[np.int32]  # (n,)


@entry_kernel
def _try_sample(bsdf, points, wo, numbers, values):
    for i in range(0, COUNT, 16):
        drawn = Numbers(
            load_row(numbers, 0, i),
            load_row(numbers, 1, i),
            load_row(numbers, 2, i),
            bsdf.arithmetic,
        )
        s = sample_bsdf(parameters_at(bsdf.form, points, i), load3(wo, i), drawn)
        store3(values, i, s.weight)
        store_row(values, 3, i, s.pdf)
        store_row(values, 4, i, s.wi.x + s.wi.y + s.wi.z + s.eta)


@entry_kernel
def _try_eval_pdf(bsdf, points, wo, wi, values):
    for i in range(0, COUNT, 16):
        parameters = parameters_at(bsdf.form, points, i)
        f_cos, pdf = eval_pdf_bsdf(parameters, load3(wo, i), load3(wi, i))
        store3(values, i, f_cos)
        store_row(values, 3, i, pdf)


def kernel_with_nan(kind: BsdfKind, parameters: NDArray[np.float32]) -> str:
    """Return the name of a kernel that returns NaN; "" if none does.

    Samples with pdf 0 are ignored: they end their path.

    Parameters
    ----------
    parameters
        (rows,) values of the kind's parameters, in the order of its layout.
    """
    rng = np.random.default_rng(0)
    azimuth, height = rng.uniform(0.0, 2.0 * np.pi, (2, COUNT)), rng.random((2, COUNT))
    z = (0.1 + 0.85 * height).astype(np.float32)  # neither normal nor grazing directions
    if kind.transmits:
        z[:, 1::2] *= -1.0
        z[1, 2::4] *= -1.0
    sine = np.sqrt(1.0 - z * z)
    wo, wi = np.stack((sine * np.cos(azimuth), sine * np.sin(azimuth), z), axis=1)
    wo, wi = wo.astype(np.float32), wi.astype(np.float32)
    rows = np.repeat(np.asarray(parameters, np.float32)[:, None], COUNT, axis=1)
    points = pack(Points(rows, np.zeros(COUNT, np.int32)))
    sides = True if kind.both_sides else None
    bsdf: Any = pack(BsdfMethods(kind.form(), Plain(), sides), kind.source)
    values = np.zeros((5, COUNT), np.float32)
    if kind.smooth:
        _try_eval_pdf(bsdf, points, wo, wi, values)
        if np.isnan(values).any():
            return "eval_pdf"
    _try_sample(bsdf, points, wo, rng.random((3, COUNT), np.float32), values)
    counts = values[3] != 0.0
    return "sample" if np.isnan(values[:, counts]).any() else ""
