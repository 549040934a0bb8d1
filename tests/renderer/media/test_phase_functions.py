"""Phase functions: what is sampled has the density that is said, which integrates to 1."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import kstest

import renderer
from renderer.kernels.jit import entry_kernel
from renderer.kernels.lanes.functions import splat_i32, splat_mask
from renderer.kernels.lanes.memory import load_row, store_row
from renderer.kernels.lanes.vectors import load3
from renderer.plugins.media.phase_functions import eval_phase, sample_phase
from renderer.scene.media_tables import media_tables
from renderer.scene_file.media_description import (
    BlendedPhase,
    ConstantVolume,
    GridVolume,
    IsotropicPhase,
    Medium,
)

DRAWN = 1 << 16  # cosines
PLACE = (0.3, 0.6, 0.8)  # in the unit cube, as are the grids
SMOKE = Path(__file__).parents[2] / "plugins" / "grids" / "smoke.vol"
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
    "a blend by a grid": {
        "type": "blendphase",
        "weight": {"type": "gridvolume", "filename": str(SMOKE)},
        "a": {"type": "hg", "g": 0.6},
        "b": {"type": "hg", "g": -0.4},
    },
}


def tables(phase):
    medium = {"type": "homogeneous", "phase": phase}
    scene = {"type": "scene", "sensor": {"type": "perspective"}}
    shape = {"type": "sphere", "bsdf": {"type": "null"}, "interior": medium}
    return media_tables(renderer.load_dict(scene | {"shape": shape}).description)


@entry_kernel
def run(media, place, given, found, sampled):
    every, first = splat_mask(True), splat_i32(0)
    for i in range(0, given.shape[1] - 16, 16):
        x, at = load_row(given, 0, i), load3(place, i)
        if sampled:
            x = sample_phase(media, first, at, x, load_row(given, 1, i), every)
        store_row(found, 0, i, x)
        store_row(found, 1, i, eval_phase(media, first, at, x, every))


def found_for(name, given, sampled):
    return found_at(PLACE, PHASES[name], given, sampled)


def found_at(place, phase, given, sampled):
    """Return cosines and densities, (2, n), at places of shape (3,) or (3, n)."""
    place = np.broadcast_to(np.reshape(place, (3, -1)), (3, given.shape[1]))
    place, given = (
        np.pad(rows, [(0, 0), (0, 32)], mode="edge").astype(np.float32)
        for rows in (place, given)
    )
    found = np.zeros_like(given)
    run(tables(phase), place, given, found, sampled)
    return found[:, :-32].astype(np.float64)


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


# ------------------------------------------------------------------ weights that vary


def blend(values, **more):
    """Return forward and backward scattering by weights (z, y, x, channels)."""
    return {
        "type": "blendphase",
        "weight": {"type": "gridvolume", "grid": np.float32(values), **more},
        "a": {"type": "hg", "g": 0.6},
        "b": {"type": "hg", "g": -0.4},
    }


def hg(g, cosine):
    return (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * cosine) ** 1.5)


def test_a_weight_is_interpolated_and_then_clamped():
    """Between 0.2 at a quarter of the cube's width and 1.8 at three quarters."""
    rng = np.random.default_rng(2)
    x, c = rng.random(256), rng.uniform(-1.0, 1.0, 256)
    weight = np.minimum(np.interp(x, [0.25, 0.75], [0.2, 1.8]), 1.0)
    phase = blend(np.reshape([0.2, 1.8], (1, 1, 2, 1)))
    _, pdf = found_at((x, 0 * x, 0 * x), phase, np.array([c, c]), False)
    expected = (1.0 - weight) * hg(0.6, c) + weight * hg(-0.4, c)
    np.testing.assert_allclose(pdf, expected, rtol=2e-5)


def test_a_weight_of_colours_is_their_luminance():
    c = np.linspace(-1.0, 1.0, 64)
    phase = blend(np.reshape([0.9, 0.3, 0.5], (1, 1, 1, 3)))
    _, pdf = found_at(PLACE, phase, np.array([c, c]), False)
    weight = 0.9 * 0.212671 + 0.3 * 0.715160 + 0.5 * 0.072169
    expected = (1.0 - weight) * hg(0.6, c) + weight * hg(-0.4, c)
    np.testing.assert_allclose(pdf, expected, rtol=2e-5)


def test_a_grid_that_many_blends_share_is_stored_once():
    """Eight nested blends by one grid of colours: else it would be copied 255 times."""
    weight = GridVolume(np.full((2, 2, 2, 3), 0.5, np.float32), np.eye(4))
    phase = IsotropicPhase()
    for _ in range(8):
        phase = BlendedPhase(weight, phase, phase)
    one = ConstantVolume((1.0, 1.0, 1.0))
    camera = SimpleNamespace(medium=Medium("homogeneous", one, one, phase=phase))
    tables = media_tables(SimpleNamespace(camera=camera, every_shape=()))
    assert tables.weights.shape[1] == 8 * 256 and np.ptp(tables.weights[0]) == 0


def test_mean_cosines_are_those_of_the_weights_at_their_places():
    """Four cells, two blends inside of each other; false alarms 1e-5 together.

    The outer weight is 1/3 everywhere, so that 2/3 of g = 0.9 belong to each mean.
    """
    weights = np.array([0.0, 0.25, 0.6, 1.0])
    inner = blend(np.reshape(weights, (1, 1, 4, 1)), filter_type="nearest")
    outer = blend(np.full((1, 1, 1, 1), 1.0 / 3.0))
    outer |= {"a": {"type": "hg", "g": 0.9}, "b": inner}
    rng = np.random.default_rng(3)
    cell = rng.integers(0, 4, DRAWN)
    place = (cell + 0.5) / 4.0, 0.0 * cell, 0.0 * cell
    cosines, _ = found_at(place, outer, rng.random((2, DRAWN)), True)
    for k, weight in enumerate(weights):
        mine = cosines[cell == k]
        expected = 0.6 + (0.6 * (1.0 - weight) - 0.4 * weight) / 3.0
        assert abs(mine.mean() - expected) < 4.8 * mine.std() / np.sqrt(mine.size)
