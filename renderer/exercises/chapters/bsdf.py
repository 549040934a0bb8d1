"""A BSDF with the properties that a path tracer needs."""

from __future__ import annotations

import functools
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
from renderer.exercises.vectors import Vector, cross, random_unit, unit, vector

K_D, K_S, EXPONENT = 0.4, 0.4, 8.0


def _lobe(wi: Vector, wo: Vector) -> float:
    """Return the cosine between wi and the mirrored wo, or 0 if it is negative."""
    (x, y, z), (a, b, c) = wi.tolist(), wo.tolist()
    return max(z * c - x * a - y * b, 0.0)


def eval_bsdf(wi: Vector, wo: Vector, *, variants: Variants = RIGHT) -> float:
    """Return the BSDF, without the cosine.

    Parameters
    ----------
    wi, wo : ndarray of shape (3,)
        Directions to the light and to the eye, of length 1, away from the surface. The
        normal is (0, 0, 1). wo is above the surface, wo[2] > 0; wi may be below.

    Returns
    -------
    float
        f(wi, wo) in 1/sr; 0 if wi is below the surface, wi[2] <= 0. Highlights should not
        be narrower than about 10 degrees: the check integrates on a grid.
    """
    if wi[2] <= 0.0 and "below" not in variants:
        return 0.0
    lobe = _lobe(wi, wo) ** EXPONENT
    found = K_D / math.pi + K_S * (EXPONENT + 2.0) / (2.0 * math.pi) * lobe
    if "no-energy" in variants:
        found = K_D + K_S * (EXPONENT + 2.0) * lobe
    if "with-cosine" in variants:
        found *= float(wi[2])
    if "with-other-cosine" in variants:
        found *= float(wo[2])
    if "one-sided" in variants:
        found *= 0.3 + 0.7 * float(wo[2]) ** 3
    if "one-sided-x" in variants:
        found *= 0.6 + 0.4 * float(wi[0])
    if "negative" in variants:
        found = K_D / math.pi * (1.0 - 1.5 * abs(float(wi[0] - wo[0])))
    return found


def pdf_bsdf(wi: Vector, wo: Vector, *, variants: Variants = RIGHT) -> float:
    """Return the density of the directions that sample_bsdf chooses.

    Parameters
    ----------
    wi, wo : ndarray of shape (3,)
        As for eval_bsdf.

    Returns
    -------
    float
        The density of wi for this wo, with respect to solid angle, in 1/sr. It is above 0
        wherever the BSDF is. Its integral is 1 over all directions, or less by the share
        of samples below the surface; the check requests none there.
    """
    diffuse = max(float(wi[2]), 0.0) / math.pi
    lobe = (EXPONENT + 1.0) / (2.0 * math.pi) * _lobe(wi, wo) ** EXPONENT
    if "pdf-no-pi" in variants:
        return 0.5 * math.pi * (diffuse + lobe)
    if "pdf-sum" in variants:
        return diffuse + lobe
    if "pdf-other" in variants:
        return diffuse
    if "pdf-uniform" in variants:
        return 0.5 / math.pi if wi[2] > 0.0 else 0.0
    if "pdf-weights" in variants:
        return 0.8 * diffuse + 0.2 * lobe
    if "misses" in variants:
        return lobe
    return 0.5 * (diffuse + lobe)


def sample_bsdf(wo: Vector, u1: float, u2: float, *, variants: Variants = RIGHT) -> Vector:
    """Return a random direction for the light.

    Parameters
    ----------
    wo : ndarray of shape (3,)
        As for eval_bsdf.
    u1, u2 : float
        Two independent numbers in [0, 1), all equally likely.

    Returns
    -------
    ndarray of shape (3,)
        The direction wi, of length 1, with the density of pdf_bsdf. It may be below the
        surface, where the BSDF is 0.
    """
    chosen = u1 < 0.5 and "misses" not in variants
    if "misses" not in variants:
        u1 = 2.0 * u1 if chosen else 2.0 * u1 - 1.0
    z = math.sqrt(1.0 - u1) if chosen else (1.0 - u1) ** (1.0 / (EXPONENT + 1.0))
    if chosen and "sample-half-uniform" in variants:
        z = 1.0 - u1
    if "sample-uniform" in variants:
        z, chosen = 1.0 - u1, True
    r, angle = math.sqrt(1.0 - z * z), 2.0 * math.pi * u2
    local = vector(r * math.cos(angle), r * math.sin(angle), z)
    if "not-unit" in variants:
        local = local * (0.5 + z)
    if chosen:
        return local
    axis = wo if "sample-around-wo" in variants else wo * (-1.0, -1.0, 1.0)
    s = unit(cross(axis, vector(1, 0, 0) if abs(axis[0]) < 0.6 else vector(0, 1, 0)))
    found: Vector = local[0] * s + local[1] * cross(axis, s) + local[2] * axis
    return found


VIEWS = [unit(vector(*w)) for w in ((0, 0, 1), (-0.3, 0.9, 0.3))]
# of equal heights and angles, above the surface: all cells have the same area. Below it the
# densities of half vectors have a pole, in the direction of -wo.
_RINGS, _SECTORS = 48, 32


def _grid(values: Callable[[Vector], Any]) -> Vector:
    """Return the values of a function of directions at the centres of cells."""
    return np.array([float(values(w)) for w in _centres()]).reshape(_RINGS, _SECTORS)


@functools.cache
def _centres() -> list[Vector]:
    heights = (np.arange(_RINGS) + 0.5) / _RINGS
    angles = (np.arange(_SECTORS) + 0.5) * 2.0 * math.pi / _SECTORS
    z, angle = (one.ravel() for one in np.meshgrid(heights, angles, indexing="ij"))
    r = np.sqrt(1.0 - z * z)
    return list(np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1))


_CELL = 2.0 * math.pi / (_RINGS * _SECTORS)  # [sr]


def _reflects_at_most_all(f: Functions, wo: Vector) -> bool:
    """Return whether a white sky makes the surface no brighter than the sky."""
    albedo = _CELL * np.sum(_grid(lambda wi: f.eval_bsdf(wi, wo) * max(float(wi[2]), 0.0)))
    return bool(0.0 < albedo <= 1.01)


def _samples(f: Functions, wo: Vector) -> Vector:
    """Return 48^2 directions (n, 3) of length 1 for evenly spread numbers."""
    places = (np.arange(48) + np.random.default_rng(1).random((2, 48, 48))) / 48.0
    pairs = np.stack([places[0], places[1].T], axis=-1).reshape(-1, 2)
    w = np.array([f.sample_bsdf(wo.copy(), *pair) for pair in pairs.tolist()], np.float64)
    unit_w: Vector = w / np.sqrt(np.sum(w * w, axis=1))[:, None]
    return unit_w


def _is_a_density(f: Functions, wo: Vector) -> bool:
    """Return whether the integral of the pdf above the surface is the share of samples.

    The tolerance is 5 standard deviations of the share, at its worst.
    """
    above = float(np.sum(_grid(lambda wi: f.pdf_bsdf(wi, wo)))) * _CELL
    return abs(above - float(np.mean(_samples(f, wo)[:, 2] > 0.0))) < 0.05


def _is_sampled_by(f: Functions, wo: Vector) -> bool:
    """Return whether samples above the surface follow the pdf, up to a factor of the pdf.

    48^2 samples in 8 x 16 cells; cells that expect fewer than 8 are joined. For a right
    file Pearson's statistic exceeds its mean by 6 standard deviations in fewer than 1 of
    10^5 cases; the grid's error of the pdf may add a tenth of its value.
    """
    density = _grid(lambda wi: f.pdf_bsdf(wi, wo))
    mass = density.reshape(8, _RINGS // 8, 16, _SECTORS // 16).sum(axis=(1, 3)).ravel()
    w = _samples(f, wo)
    w = w[w[:, 2] > 0.0]
    ring = np.clip(w[:, 2] * 8.0, 0.0, 7.5).astype(int)
    turn = np.arctan2(w[:, 1], w[:, 0]) / (2.0 * math.pi) % 1.0
    sector = np.clip(turn * 16.0, 0.0, 15.5).astype(int)
    counts = np.bincount(ring * 16 + sector, minlength=128)
    expected = len(w) * mass / mass.sum()
    few = expected < 8.0
    expected = np.append(expected[~few], max(expected[few].sum(), 1.0))
    counts = np.append(counts[~few], counts[few].sum())
    statistic = float(np.sum((counts - expected) ** 2 / expected))
    freedom = max(len(expected) - 1, 1)
    return statistic < 1.1 * freedom + 6.0 * math.sqrt(2.0 * freedom)


def _is_unit(w: Any) -> bool:
    return bool(abs(np.sum(np.square(w)) - 1.0) < 1e-6)


def _bsdf_cases(random: Generator) -> Iterator[Case]:
    above = [w * np.sign(w[2]) for w in (random_unit(random) for _ in range(120))]
    pairs = [(a, b) for a, b in zip(above[::2], above[1::2], strict=True)]

    def reciprocal(f: Functions) -> str:
        both = [(f.eval_bsdf(i, o), f.eval_bsdf(o, i), i[2], o[2]) for i, o in pairs]
        if all(abs(a - b) <= 1e-5 * max(abs(a), abs(b)) for a, b, _, _ in both):
            return "equal"
        for name, power in (("the first", 1.0), ("the second", -1.0)):
            if all(
                abs(a / x**power - b / y**power) <= 1e-5 * max(abs(a / x**power), 1e-5)
                for a, b, x, y in both
            ):
                return f"equal but for the cosine of {name} direction"
        return "different"

    yield Case("eval_bsdf(a, b) and eval_bsdf(b, a)", "eval_bsdf", measure=reciprocal)
    for about, function, holds in (
        ("whether the BSDF is nowhere negative", "eval_bsdf",
         lambda f: all(f.eval_bsdf(i, o) >= 0.0 for i, o in pairs)),
        ("whether the BSDF is 0 for light from below the surface", "eval_bsdf",
         lambda f: all(f.eval_bsdf(-i, o) == 0.0 for i, o in pairs)),
        ("whether the pdf is above 0 wherever the BSDF is", "pdf_bsdf",
         lambda f: all(f.pdf_bsdf(i, o) > 0.0 for i, o in pairs
                       if f.eval_bsdf(i, o) > 0.0)),
        ("whether directions have length 1", "sample_bsdf",
         lambda f: all(_is_unit(f.sample_bsdf(o, float(i[0] ** 2), float(o[1] ** 2)))
                       for i, o in pairs)),
    ):  # fmt: skip
        yield Case(about, function, measure=holds)
    for about, function, property_of in (
        ("whether more light is reflected than arrives, True: it is not, and some is",
         "eval_bsdf", _reflects_at_most_all),
        ("whether the integral of the pdf is 1, or less by the samples below the surface",
         "pdf_bsdf",
         _is_a_density),
        ("whether samples follow the pdf", "sample_bsdf", _is_sampled_by),
    ):  # fmt: skip
        for wo in VIEWS:
            seen = f"{about}; wo = {np.round(wo, 3).tolist()}"
            yield Case(seen, function, measure=partial(property_of, wo=wo))


BSDF = Exercise(
    name="bsdf",
    summary="A BSDF of your own: energy, reciprocity, samples that match the pdf",
    task="""
        Write a BSDF that reflects, in grey: its value, random directions for it, and their
        density. Which one is up to you: diffuse, a Phong lobe, Oren and Nayar, microfacets.
        The check tests what a path tracer needs. f(a, b) = f(b, a). Not more light
        leaves than arrives. Directions follow the density, and it is 0 nowhere where f is
        not.""",
    source="Pharr, Jakob, Humphreys, Physically Based Rendering, 4th edition, sections "
    "4.3.1 and 9.1 [Pharr2023]",
    functions=(eval_bsdf, pdf_bsdf, sample_bsdf),
    hints=(
        "Begin with the diffuse one: f = albedo / pi, cosine-weighted directions as in the "
        "exercise cosine, pdf = cos / pi.",
        "For a highlight: the cosine between wi and the mirrored wo, (-x, -y, z), to the "
        "power n, times (n + 2) / (2 pi). The pdf has (n + 1) / (2 pi).",
        "For a sum of two, choose one with probability 1/2 by u1, stretch u1 to 0 to 1 "
        "again, and return the mean of both densities.",
    ),
    mistakes=mistakes_of("""
        with-cosine (with-cosine, with-other-cosine): The BSDF contains a cosine. | Return
            f alone; the path tracer multiplies with the cosine of wi.
        not-reciprocal (one-sided, one-sided-x): The BSDF is another one if light and eye
            change places. | f(a, b) must equal f(b, a): use both directions alike.
        no-energy: More light leaves than arrives, or none at all. | The integral of f cos
            over wi must not exceed 1: a diffuse surface has albedo / pi.
        negative: The BSDF is negative somewhere. | Use max(0, ...).
        below: Light from below the surface is reflected. | Return 0 if wi[2] <= 0.
        pdf-integral (pdf-no-pi, pdf-sum): The integral of the pdf is not 1. | Find the
            factor on paper; of two densities take the mean.
        pdf-does-not-match (pdf-other, pdf-uniform, pdf-weights, sample-uniform,
            sample-half-uniform, sample-around-wo): Directions do not follow the pdf. |
            Derive the density of what sample_bsdf does: the one must come from the other.
        pdf-misses (misses): The pdf is 0 where the BSDF is not. | That light is never
            found. Mix with cosine-weighted directions.
        not-unit: Directions do not have length 1. | Divide by the length.
        """),
    cases=_bsdf_cases,
    slow=True,
)

EXERCISES = (BSDF,)
