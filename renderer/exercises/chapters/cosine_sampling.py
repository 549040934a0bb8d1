"""Random directions around a normal."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.random import Generator

from renderer.exercises.exercise import (
    RIGHT,
    Case,
    Exercise,
    Functions,
    Variants,
    mistakes_of,
)
from renderer.exercises.vectors import Vector


def sample_cosine(
    u1: float, u2: float, *, variants: Variants = RIGHT
) -> tuple[Vector, float]:
    """Return a random direction above a surface, with a density in proportion to cosines.

    Parameters
    ----------
    u1, u2 : float
        Two independent numbers in [0, 1), all equally likely.

    Returns
    -------
    tuple (wi, pdf)
        wi is an ndarray of shape (3,) of length 1 with wi[2] >= 0; the normal is (0, 0, 1).
        pdf is the density of wi with respect to solid angle, in 1/sr.
    """
    r2 = u1
    if "no-root" in variants:
        r2 = u1 * u1
    z = math.sqrt(1.0 - r2)
    if variants & {"uniform", "uniform-cosine-pdf"}:
        z = 1.0 - u1
    if "uniform-angle" in variants:
        z = math.cos(0.5 * math.pi * u1)
    if "whole-sphere" in variants:
        z = 1.0 - 2.0 * u1
    r = math.sqrt(1.0 - z * z)
    if "z-not-rooted" in variants:
        z = 1.0 - r2
    if "flat" in variants:
        z = 1.0
    turn = math.pi if "half-turn" in variants else 2.0 * math.pi
    if "quarter-turn" in variants:
        turn = math.pi / 2.0
    pdf = abs(z) / math.pi
    if variants & {"uniform", "pdf-uniform"}:
        pdf = 0.5 / math.pi
    if "pdf-no-pi" in variants:
        pdf = z
    if "pdf-of-disk" in variants:
        pdf = 1.0 / math.pi
    if "pdf-half" in variants:
        pdf = 0.5 * z / math.pi
    angle = turn * u2
    return np.array([r * math.cos(angle), r * math.sin(angle), z]), pdf


def _directions(functions: Functions, side: int) -> tuple[Vector, Vector]:
    """Return directions (side^2, 3) and their densities, for evenly spread numbers."""
    places = (np.arange(side) + 0.5) / side
    found = [functions.sample_cosine(float(a), float(b)) for a in places for b in places]
    return (
        np.array([wi for wi, _ in found], np.float64),
        np.array([pdf for _, pdf in found], np.float64),
    )


def _means(*powers: tuple[int, int, int]) -> Callable[[Functions], list[float]]:
    """Return what measures the means of x^i y^j z^k."""

    def measure(functions: Functions) -> list[float]:
        w, _ = _directions(functions, 48)
        return [float(np.mean(np.prod(w ** np.array(p), axis=1))) for p in powers]

    return measure


def _fits(functions: Functions) -> bool:
    """Return whether cells of equal probability receive equal numbers of directions.

    Pearson's statistic of 64^2 directions in 8 x 16 cells has the mean 127 and the standard
    deviation 16 if they are independent. Evenly spread numbers give less. 230 is exceeded
    by independent ones in 1 of 10^7 cases.
    """
    w, _ = _directions(functions, 64)
    rings = np.clip((w[:, 0] ** 2 + w[:, 1] ** 2) * 8.0, 0.0, 7.5).astype(int)
    sectors = np.floor((np.arctan2(w[:, 1], w[:, 0]) / math.pi + 1.0) * 8.0).astype(int)
    counts = np.bincount(rings * 16 + np.clip(sectors, 0, 15), minlength=128)
    expected = len(w) / 128.0
    return bool(np.sum((counts - expected) ** 2) / expected < 230.0)


def _of_one(read: Callable[[Vector, float], Any], answer: Any) -> Any:
    """Apply `read` to a sample; anything that is none, as it is."""
    try:
        wi, pdf = answer
        w = np.asarray(wi, np.float64)
        if w.shape != (3,) or np.ndim(pdf) != 0:
            return answer
    except (TypeError, ValueError):
        return answer
    return read(w, float(pdf))


def _pdf_mean(functions: Functions, power: int) -> float:
    """Return the mean of pi pdf cos^power, which does not depend on the map."""
    w, pdf = _directions(functions, 48)
    return float(np.mean(math.pi * pdf * w[:, 2] ** power))


def _cosine_cases(random: Generator) -> Iterator[Case]:
    numbers = [(0.5, 0.5), (0.25, 0.75), (0.0, 0.0), (0.9, 0.1), (1.0 - 2.0**-53, 0.3)]
    numbers += [tuple(pair) for pair in random.random((20, 2)).tolist()]
    for about, read in (
        (
            "whether the direction has length 1",
            lambda w, pdf: abs(float(w @ w) - 1.0) < 1e-6,
        ),
        ("whether the direction is above the surface", lambda w, pdf: bool(w[2] >= 0.0)),
        (
            "whether pdf is cos / pi",
            lambda w, pdf: abs(pdf - float(w[2]) / math.pi) < 1e-6,
        ),
    ):
        # at the edges of the square a wrong pdf may be right, depending on the map
        for pair in numbers[5:8] if about.startswith("whether pdf") else numbers:
            one = partial(_of_one, read)
            yield Case(about, "sample_cosine", pair, read=one, tolerance=1e-4)
    for about, powers in (
        ("the means of z, z^2 and z^4", [(0, 0, 1), (0, 0, 2), (0, 0, 4)]),
        (
            "the means of x, y, x y, x z and y z",
            [(1, 0, 0), (0, 1, 0), (1, 1, 0), (1, 0, 1), (0, 1, 1)],
        ),
        ("the means of x^2, y^2 and x^4", [(2, 0, 0), (0, 2, 0), (4, 0, 0)]),
    ):
        about = f"{about} over 48^2 evenly spread pairs (u1, u2)"
        yield Case(about, "sample_cosine", measure=_means(*powers), tolerance=0.03)
    for power in range(4):
        about = f"the mean of pi pdf cos^{power} over 48^2 evenly spread pairs (u1, u2)"
        measure = partial(_pdf_mean, power=power)
        yield Case(about, "sample_cosine", measure=measure, tolerance=0.03)
    about = "whether 128 cells of equal probability receive equal numbers of directions"
    yield Case(about, "sample_cosine", measure=_fits)


def _cosine_picture(f: Functions) -> Vector:
    """Draw the directions from above: how many fall on each part of the disk."""
    edges = np.linspace(-1.0, 1.0, 21)
    try:
        w, _ = _directions(f, 96)
        counts, _, _ = np.histogram2d(-w[:, 1], w[:, 0], bins=(edges, edges))
    except Exception:  # the answers to the cases tell what is wrong
        counts = np.full((20, 20), np.nan)
    shade = np.repeat(np.repeat(counts / 60.0, 2, axis=0), 2, axis=1)
    return np.stack([shade] * 3, axis=2)


COSINE = Exercise(
    name="cosine",
    summary="Random directions that favour the normal: cosine-weighted sampling",
    task="""
        A diffuse surface reflects the light of a direction in proportion to its cosine. So
        directions are chosen with that density. Any right map from the two numbers to
        directions is accepted.

        The picture to reach shows the directions from above: the disk is filled evenly.""",
    source="Malley's method: Pharr, Jakob, Humphreys, Physically Based Rendering, 4th "
    "edition, section A.5.3 [Pharr2023]",
    functions=(sample_cosine,),
    hints=(
        "The density is c cos, and its integral over the half sphere is 1: c = 1 / pi.",
        "Points that fill the unit disk evenly, lifted to the half sphere, have this "
        "density.",
        "r = sqrt(u1) and angle = 2 pi u2 fill the disk evenly; z = sqrt(1 - r^2).",
    ),
    mistakes=mistakes_of("""
        uniform (uniform, uniform-cosine-pdf): All directions are equally likely. | z must
            be the square root of an even number: z = sqrt(1 - u1).
        uniform-angle: All angles to the normal are equally likely. | The angle has a
            density sin cos: z = sqrt(1 - u1).
        no-root: The disk is not filled evenly: more points are near its centre. | The
            radius is sqrt(u1).
        whole-sphere: Directions are below the surface too. | z is in 0 to 1.
        turn (half-turn, quarter-turn): The directions do not go all around the normal. |
            The angle around the normal is 2 pi u2.
        not-unit (z-not-rooted, flat): The direction does not have length 1. | z = sqrt(1
            - x^2 - y^2).
        pdf-no-pi: The pdf is pi times too large. | Its integral over the half sphere must
            be 1: pdf = cos / pi.
        pdf-uniform: The pdf is that of directions that are all equally likely. | pdf =
            cos / pi.
        pdf-of-disk: The pdf is that of the point on the disk. | The disk is seen at an
            angle: pdf = cos / pi.
        pdf-half: The pdf is half of what it should be. | pdf = cos / pi.
        """),
    cases=_cosine_cases,
    picture=_cosine_picture,
)

EXERCISES = (COSINE,)
