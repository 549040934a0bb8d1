"""Phase functions: what is sampled has the density that is said, which integrates to 1."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.stats import kstest

import renderer
from renderer.kernels.jit import entry_kernel
from renderer.kernels.lanes.functions import splat_i32, splat_mask
from renderer.kernels.lanes.memory import load_row, store_row
from renderer.plugins.media.phase_functions import eval_phase, sample_phase
from renderer.scene.media_tables import media_tables

DRAWN = 1 << 16  # cosines
PHASES: dict[str, Any] = {
    "isotropic": {"type": "isotropic"},
    "hg": {"type": "hg", "g": 0.9},
    "backward": {"type": "hg", "g": -0.35},
    "almost isotropic": {"type": "hg", "g": 1e-6},
    "a peak": {"type": "hg", "g": 0.99},
    "rayleigh": {"type": "rayleigh"},
    "tabphase": {"type": "tabphase", "values": ".2 .1 .4 1.5 6"},
    "a table of zeros and a peak": {"type": "tabphase", "values": "0,0,1,0,0,0"},
    "blendphase": {
        "type": "blendphase",
        "weight": 0.25,
        "a": {"type": "hg", "g": 0.6},
        "b": {
            "type": "blendphase",
            "weight": 0.5,
            "a": {"type": "rayleigh"},
            "b": {"type": "tabphase", "values": "3 1"},
        },
    },
}


def tables(phase):
    medium = {"type": "homogeneous", "phase": phase}
    scene = {"type": "scene", "sensor": {"type": "perspective"}}
    shape = {"type": "sphere", "bsdf": {"type": "null"}, "interior": medium}
    return media_tables(renderer.load_dict(scene | {"shape": shape}).description)


@entry_kernel
def run(media, given, found, sampled):
    every, first = splat_mask(True), splat_i32(0)
    for i in range(0, given.shape[1] - 16, 16):
        x = load_row(given, 0, i)
        if sampled:
            x = sample_phase(media, first, x, load_row(given, 1, i), every)
        store_row(found, 0, i, x)
        store_row(found, 1, i, eval_phase(media, first, x, every))


def found_for(phase, given, sampled):
    padded = np.pad(given, [(0, 0), (0, 32)], mode="edge").astype(np.float32)
    found = np.zeros_like(padded)
    run(tables(PHASES[phase]), padded, found, sampled)
    return found[:, : given.shape[1]].astype(np.float64)


def drawn_as_stated(phase):
    """Return p of a test of Kolmogorov and Smirnov of cosines against their density.

    The integral of the density is by the trapezoid rule; it has to be 1.
    """
    nodes = np.float32(1.0 - np.logspace(-7, np.log10(2.0), 400001)[::-1])
    nodes = np.unique(np.append(nodes, np.float32([-1.0, 1.0]))).astype(np.float64)
    density = 2.0 * np.pi * found_for(phase, np.array([nodes, nodes]), False)[1]
    pieces = 0.5 * (density[1:] + density[:-1]) * np.diff(nodes)
    integral = np.concatenate(([0.0], np.cumsum(pieces)))
    assert integral[-1] == pytest.approx(1.0, abs=3e-3)
    cosines = found_for(phase, np.random.default_rng(5).random((2, DRAWN)), True)[0]
    assert (np.abs(cosines) <= 1.0).all()
    return kstest(cosines, lambda c: np.interp(c, nodes, integral)).pvalue


@pytest.mark.parametrize("phase", PHASES)
def test_what_is_sampled_has_the_density_that_is_said(phase):
    """False alarms 1e-5 each."""
    assert drawn_as_stated(phase) > 1e-5


@pytest.mark.parametrize("phase", ["hg", "backward"])
def test_g_is_the_mean_cosine(phase):
    x = (np.arange(1 << 16) + 0.5) / (1 << 16)
    cosines = found_for(phase, np.array([x, x]), True)[0]
    assert cosines.mean() == pytest.approx(PHASES[phase]["g"], abs=1e-4)


def test_a_table_ends_forward():
    """Values of Mitsuba 3.9.1."""
    _, pdf = found_for("tabphase", np.array([[1.0, -1.0]] * 2), False)
    np.testing.assert_allclose(pdf, [0.3744822, 0.0124827], rtol=1e-5)


def test_the_weight_is_the_share_of_the_second():
    """0.75 of Henyey and Greenstein; of the rest half Rayleigh, half (2 - c) / (8 pi)."""
    c = np.linspace(-1.0, 1.0, 64)
    _, pdf = found_for("blendphase", np.array([c, c]), False)
    hg = (1 - 0.36) / (4 * np.pi * (1.36 - 1.2 * c) ** 1.5)
    rayleigh = 3 / (16 * np.pi) * (1 + c * c)
    expected = 0.75 * hg + 0.125 * rayleigh + 0.125 * (2 - c) / (8 * np.pi)
    np.testing.assert_allclose(pdf, expected, rtol=2e-5)
