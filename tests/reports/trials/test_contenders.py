"""Contenders: ours and Mitsuba loaded alike, and the comparison of their image means."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import numpy as np
import pytest

import renderer
from mitsuba_ref.reference.errors import MitsubaError
from reports.errors import ReportError
from reports.trials import contenders
from reports.trials.contenders import (
    OURS,
    REFERENCE,
    Render,
    compare_means,
    load_all,
    mean_of,
    of_ours,
)
from reports.trials.scene_files import scene_file, scene_names


def noisy(level: float, spread: float) -> Callable[[int, int], Render]:
    """A contender whose image means scatter around `level`."""

    def render(seed: int, spp: int) -> Render:
        red, green, blue = np.random.default_rng(seed).normal(level, spread, 3)
        return Render(0.1, (float(red), float(green), float(blue)))

    return render


def test_equal_means_pass_and_a_shift_of_ten_errors_does_not() -> None:
    """Standard error of a difference of two means of 8: spread x sqrt(2 / 8) = 0.005."""
    seeds = range(8)
    same = compare_means(noisy(0.5, 0.01), noisy(0.5, 0.01), seeds, 1)
    assert same.passed
    shifted = compare_means(noisy(0.5, 0.01), noisy(0.55, 0.01), seeds, 1)
    assert not shifted.passed
    assert shifted.z[0] == pytest.approx(-10.0, rel=0.6)
    assert 6.0 < shifted.limit < 8.0  # 14 degrees of freedom


def test_equal_means_are_stopped_as_often_as_is_said(monkeypatch) -> None:
    """Where one side is much noisier, with alpha 1 %: 20 of 2000 pairs of 8 seeds, +- 13.

    13 are three standard errors. By the limits of normal noise it would be 130.
    """
    monkeypatch.setattr(contenders, "ALPHA", 0.01)
    pairs = np.random.default_rng(1).normal(0.5, 0.01, (2000, 16, 3))
    pairs[:, 8:] = 0.5 + (pairs[:, 8:] - 0.5) / 100.0
    stopped = 0
    for means in pairs:

        def drawn(seed: int, spp: int, means: Any = means) -> Render:
            return Render(0.1, tuple(means[seed]))

        stopped += not compare_means(drawn, drawn, range(8), 1).passed
    assert 7 <= stopped <= 33


def test_means_without_noise_are_compared_up_to_rounding() -> None:
    """No spread at all gives no division by zero, and a real difference still shows."""
    assert compare_means(noisy(0.5, 0.0), noisy(0.5, 0.0), range(2), 1).passed
    assert compare_means(noisy(0.5, 0.0), noisy(0.500001, 0.0), range(2), 1).passed
    assert not compare_means(noisy(0.5, 0.0), noisy(0.51, 0.0), range(2), 1).passed
    assert compare_means(noisy(0.0, 0.0), noisy(0.0, 0.0), range(2), 1).passed


def test_means_that_are_no_numbers_do_not_pass() -> None:
    """In whatever channel: `max` of numbers and a NaN depends on their order."""
    for channel in range(3):

        def broken(seed: int, spp: int, channel: int = channel) -> Render:
            mean = list(noisy(0.5, 0.01)(seed, spp).mean)
            mean[channel] = math.nan
            return Render(0.1, tuple(mean))  # type: ignore[arg-type]

        assert not compare_means(broken, noisy(0.5, 0.01), range(8), 1).passed


def load(stack: ExitStack, told: list[str], **given: Any) -> Any:
    size = {"width": "12", "height": "9", "spp": "4"}
    return load_all(stack, scene_file("cornell-box"), size, 2, told.append, **given)


def test_all_renderers_are_loaded_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    """A variant that is not there is named with the reason; the reference must be."""
    peers = {REFERENCE: "scalar_rgb", "mitsuba nonsense": "nonsense"}
    monkeypatch.setattr(contenders, "PEERS", peers)
    told: list[str] = []
    with ExitStack() as stack:
        found, absent = load(stack, told, sampler="independent", ray_offset="mitsuba")
        assert list(found) == [OURS, REFERENCE]
        first, again = (found[REFERENCE](seed, 4) for seed in (1, 1))
        assert first.mean == again.mean and first.seconds > 0.0
        assert compare_means(found[OURS], found[REFERENCE], range(4), 4).passed
    assert "nonsense: " in absent["mitsuba nonsense"]
    assert told == [f"loading {name}" for name in (OURS, *peers)]
    monkeypatch.setattr(contenders, "PEERS", {REFERENCE: "nonsense"})
    with ExitStack() as stack, pytest.raises(MitsubaError, match="nonsense: "):
        load(stack, told)


def test_our_picture_comes_with_its_mean() -> None:
    scene = renderer.load_file(scene_file("cornell-box"), width=8, height=6)
    render = of_ours(scene, 1, sampler="independent")
    _, picture = render(3, 4)
    assert picture.shape == (6, 8, 3)
    assert mean_of(render)(3, 4).mean == pytest.approx(picture.mean(axis=(0, 1)))


def test_apart_is_said_with_both_names() -> None:
    means = compare_means(noisy(0.5, 0.0), noisy(0.51, 0.0), range(2), 1)
    assert "of a (0.5, 0.5, 0.5) and of b (0.51," in means.sentence("a", "b")


def test_scenes_are_found_by_name_folder_and_path() -> None:
    path = scene_file("metals")
    assert path.name == "scene.xml" and "metals" in scene_names()
    assert scene_file(str(path)) == scene_file(str(path.parent)) == path
    with pytest.raises(ReportError, match="scene 'nothing': no such file"):
        scene_file("nothing")
