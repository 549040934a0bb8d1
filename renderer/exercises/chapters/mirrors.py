"""Mirrors and glass: reflection, refraction, and how much goes which way."""

from __future__ import annotations

import math
from collections.abc import Iterator

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
from renderer.exercises.pictures import scan, through
from renderer.exercises.vectors import Vector, random_unit, unit, vector


def reflect(d: Vector, n: Vector, *, variants: Variants = RIGHT) -> Vector:
    """Return the direction of a ray after a mirror.

    Parameters
    ----------
    d : ndarray of shape (3,)
        Direction of the ray that arrives, towards the surface, of length 1.
    n : ndarray of shape (3,)
        Normal of the surface, of length 1, on the side from which the ray arrives.

    Returns
    -------
    ndarray of shape (3,)
        Direction of the mirrored ray, away from the surface, of length 1.
    """
    found: Vector = d - (1.0 if "no-two" in variants else 2.0) * float(d @ n) * n
    if "plus" in variants:
        found = d + 2.0 * float(d @ n) * n
    return -found if "backwards" in variants else found


def refract(
    d: Vector, n: Vector, eta: float, *, variants: Variants = RIGHT
) -> Vector | None:
    """Return the direction of a ray after it has passed a surface of glass or water.

    Parameters
    ----------
    d : ndarray of shape (3,)
        Direction of the ray that arrives, towards the surface, of length 1.
    n : ndarray of shape (3,)
        Normal of the surface, of length 1, on the side from which the ray arrives.
    eta : float
        Index of refraction of the side from which the ray arrives, over that of the other
        side: 1 / 1.5 from air into glass.

    Returns
    -------
    ndarray of shape (3,) or None
        Direction of the refracted ray, of length 1. None if all light is reflected.
    """
    if "eta-inverted" in variants:
        eta = 1.0 / eta
    cos_i = -float(d @ n)
    if "cosine-sign" in variants:
        cos_i = -cos_i
    squared = 1.0 - eta * eta * (1.0 - cos_i * cos_i)
    if "eta-not-squared" in variants:
        squared = 1.0 - eta * (1.0 - cos_i * cos_i)
    if squared < 0.0:
        if "reflects-instead" in variants:
            return reflect(d, n)
        if "along-surface" in variants:
            return unit(d + cos_i * n)
        if not variants & {"nan", "clamped"}:
            return None
    if "clamped" in variants:
        squared = max(squared, 0.0)
    cos_t = float(np.sqrt(squared))
    if "normal-not-scaled" in variants:
        return eta * d - cos_t * n
    found: Vector = eta * d + (eta * cos_i - cos_t) * n
    if "straight-on" in variants:
        found = d
    if "wrong-side" in variants:
        found = eta * d + (eta * cos_i + cos_t) * n
    return found


def _cases(random: Generator) -> Iterator[Case]:
    n = vector(0, 0, 1)
    for about, d in (
        ("a ray straight onto the mirror", -n),
        ("a ray at 45 degrees", unit(vector(1, 0, -1))),
        ("a grazing ray", unit(vector(1, 0, -1e-3))),
    ):
        yield Case(about, "reflect", (d, n))
    for about, d, eta in (
        ("a ray straight into glass", -n, 1.0 / 1.5),
        ("a ray into glass at 45 degrees", unit(vector(1, 0, -1)), 1.0 / 1.5),
        ("a ray out of glass at 30 degrees", vector(0.5, 0, -math.sqrt(0.75)), 1.5),
        ("a ray out of glass beyond the critical angle", unit(vector(1, 0, -1)), 1.5),
        ("a grazing ray into glass", unit(vector(1, 0, -1e-3)), 1.0 / 1.5),
        ("equal indices of refraction", unit(vector(1, 0, -1)), 1.0),
    ):
        yield Case(about, "refract", (d, n, eta))
    for _ in range(60):
        n, d = random_unit(random), random_unit(random)
        d = -d if d @ n > 0.0 else d
        yield Case("a random mirror", "reflect", (d, n))
        eta = random.uniform(0.5, 2.0)
        if abs(1.0 - eta**2 * (1.0 - (d @ n) ** 2)) > 1e-3:
            yield Case("a random surface", "refract", (d, n, eta))


def _picture(f: Functions) -> Vector:
    """Draw a ball of glass, whose upper part is a mirror, before a checkerboard."""

    def board(origin: Vector, d: Vector) -> Vector:
        if d[2] >= -1e-6:
            return vector(0.5, 0.7, 1)
        x = origin + (-3.0 - origin[2]) / d[2] * d
        odd = (math.floor(2.0 * x[0]) + math.floor(2.0 * x[1])) % 2
        return vector(0.9, 0.8, 0.2) if odd else vector(0.2, 0.3, 0.5)

    def colour(x: float, y: float) -> Vector:
        origin, d = through(x, y)
        b = float(origin @ d)
        discriminant = b * b - float(origin @ origin) + 1.0
        if discriminant < 0.0:
            return board(origin, d)
        x1 = origin + (-b - math.sqrt(discriminant)) * d
        if x1[1] > 0.45:
            return board(x1, np.asarray(f.reflect(d, x1)))
        inside = f.refract(d, x1, 1.0 / 1.5)
        x2 = x1 - 2.0 * float(x1 @ inside) * inside
        out = f.refract(inside, -x2, 1.5)
        return np.zeros(3) if out is None else board(x2, np.asarray(out))

    return scan(colour)


REFRACTION = Exercise(
    name="refraction",
    summary="Reflection and refraction: where rays go at mirrors and glass",
    task="""
        Two functions. A mirror turns the part of the direction along the normal. Glass
        divides the part across the normal by Snell's law, sin_t = eta sin_i; the part along
        the normal follows from the length 1. If the sine would be above 1, all light is
        reflected, and there is no refracted ray.""",
    source="the lecture's recursive ray tracing; Whitted, An Improved Illumination Model "
    "for Shaded Display, 1980 [Whitted1980]",
    functions=(reflect, refract),
    hints=(
        "The part of d along n is dot(d, n) n, and the rest is the part across.",
        "The mirrored direction is d - 2 dot(d, n) n.",
        "With cos_i = -dot(d, n) and cos_t^2 = 1 - eta^2 (1 - cos_i^2) the refracted "
        "direction is eta d + (eta cos_i - cos_t) n.",
    ),
    mistakes=mistakes_of("""
        mirror-factor (no-two): The mirrored ray lies in the surface: the factor 2 is
            missing. | d - 2 dot(d, n) n.
        mirror-sign (plus): The mirrored ray goes into the surface. | d - 2 dot(d, n) n; d
            points towards the surface.
        mirror-backwards (backwards): The mirrored ray goes the opposite way. | The
            formula with 2 dot(d, n) n - d is for a vector that points away from the
            surface.
        eta-inverted: eta is used upside down. | Here it is the index before the surface
            over that behind it; Snell's law is sin_t = eta sin_i.
        total-reflection (nan, clamped, along-surface, reflects-instead): Beyond the
            critical angle something is returned. | Return None if 1 - eta^2 (1 - cos_i^2)
            is negative.
        eta-not-squared: eta is not squared under the root. | cos_t^2 = 1 - sin_t^2 = 1 -
            eta^2 sin_i^2.
        cosine-sign: The cosine of the ray that arrives has the wrong sign. | d points
            towards the surface: cos_i = -dot(d, n).
        normal-not-scaled: A part of the direction along the normal is missing. | eta d
            has a part along n too: add eta cos_i n.
        wrong-side: The refracted ray stays before the surface. | Subtract cos_t n.
        straight-on: The ray goes straight on. | Bend it by Snell's law.
        """),
    cases=_cases,
    picture=_picture,
)


# ------------------------------------------------------------------------------ Fresnel


def fresnel(cos_i: float, eta: float, *, variants: Variants = RIGHT) -> float:
    """Return how much light a smooth surface of glass or water reflects.

    Parameters
    ----------
    cos_i : float
        Cosine between the ray that arrives and the normal, in [0, 1].
    eta : float
        Index of refraction of the side from which the ray arrives, over that of the other
        side: 1 / 1.5 from air into glass. It is above 0.

    Returns
    -------
    float
        The reflected part of unpolarized light, in [0, 1].
    """
    if "eta-inverted" in variants:
        eta = 1.0 / eta
    squared = 1.0 - eta * eta * (1.0 - cos_i * cos_i)
    if squared <= 0.0:
        if "total-is-zero" in variants:
            return 0.0
        if "no-total-reflection" not in variants and "schlick" not in variants:
            return 1.0
    cos_t = float(np.sqrt(squared))
    if "schlick" in variants:
        r0 = ((1.0 - eta) / (1.0 + eta)) ** 2
        return r0 + (1.0 - r0) * (1.0 - cos_i) ** 5
    s = (eta * cos_i - cos_t) / (eta * cos_i + cos_t)
    p = (cos_i - eta * cos_t) / (cos_i + eta * cos_t)
    if "not-squared" in variants:
        return (abs(s) + abs(p)) / 2.0
    if "only-s" in variants:
        return s * s
    if "only-p" in variants:
        return p * p
    if "not-halved" in variants:
        return s * s + p * p
    if "square-of-mean" in variants:
        return ((s + p) / 2.0) ** 2
    found = (s * s + p * p) / 2.0
    return 1.0 - found if "transmitted" in variants else found


def _fresnel_cases(random: Generator) -> Iterator[Case]:
    for about, cos_i, eta in (
        ("straight into glass", 1.0, 1.0 / 1.5),
        ("into glass at 60 degrees", 0.5, 1.0 / 1.5),
        ("out of glass at 30 degrees", math.sqrt(0.75), 1.5),
        ("out of glass beyond the critical angle", 0.5, 1.5),
        ("along the surface", 0.0, 1.0 / 1.5),
        ("at Brewster's angle", 1.0 / math.sqrt(1.0 + 1.5**2), 1.0 / 1.5),
        ("equal indices of refraction", 0.5, 1.0),
    ):
        yield Case(about, "fresnel", (cos_i, eta))
    for _ in range(100):
        cos_i, eta = random.random(), random.uniform(0.4, 2.5)
        if abs(1.0 - eta**2 * (1.0 - cos_i**2)) > 1e-3:
            yield Case("a random surface", "fresnel", (cos_i, eta))


FRESNEL = Exercise(
    name="fresnel",
    summary="How much light glass reflects, and how much it lets through",
    task="""
        The two polarizations of light are reflected differently. Compute the amplitude of
        each, square both, and return their mean. Beyond the critical angle all light is
        reflected.

        The picture to reach has cos_i from 0 to 1 to the right, and eta from 0.4 to 2.5
        upwards.""",
    source="the lecture's k_r and k_t; Pharr, Jakob, Humphreys, Physically Based "
    "Rendering, 4th edition, section 9.3.5 [Pharr2023]",
    functions=(fresnel,),
    hints=(
        "Snell's law gives cos_t^2 = 1 - eta^2 (1 - cos_i^2). If it is not positive, the "
        "result is 1.",
        "With n_i and n_t before and behind the surface, the amplitude of the "
        "perpendicular polarization is (n_i cos_i - n_t cos_t) / (n_i cos_i + n_t cos_t).",
        "For the parallel one exchange the cosines: (n_t cos_i - n_i cos_t) / "
        "(n_t cos_i + n_i cos_t). Divide both fractions by n_t: only eta is left.",
    ),
    mistakes=mistakes_of("""
        eta-inverted: eta is used upside down. | Here it is the index before the surface
            over that behind it.
        no-total-reflection (no-total-reflection, total-is-zero): Beyond the critical
            angle not all light is reflected. | Return 1 if sin_t would be above 1.
        not-squared: The amplitudes are not squared. | Light is the square of an
            amplitude.
        one-polarization (only-s, only-p): Only one polarization counts. | Return the mean
            of both squares.
        not-halved: The polarizations are added. | Return their mean: half of the sum.
        square-of-mean: The mean of the amplitudes is squared. | Square first, then take
            the mean.
        schlick: This is Schlick's approximation. | Compute both polarizations.
        transmitted: This is the light that goes through. | Return the reflected part.
        """),
    cases=_fresnel_cases,
    picture=lambda f: scan(
        lambda x, y: np.full(3, math.sqrt(f.fresnel(0.5 * x + 0.5, 1.45 + 1.05 * y)))
    ),
)

EXERCISES = (REFRACTION, FRESNEL)
