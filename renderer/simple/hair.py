"""Hair and fur [Chiang2016], in angles: theta to the plane across the fibre, phi in it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from renderer.simple.bsdfs import (
    BLACK,
    NOTHING,
    Bsdf,
    BsdfSample,
    color,
    number,
    reflectance_of_glass,
)
from renderer.simple.camera import Vector
from renderer.simple.shapes import Hit
from renderer.simple.textures import LUMINANCE

Lobe = tuple[Vector, float, float, float]  # attenuation, theta_o, variance, azimuth


class Hair(Bsdf):
    """A fibre along y: three lobes by the number of internal segments, and all the rest."""

    oriented = True

    def __init__(self, bsdf: Any, hit: Hit) -> None:
        self.v, self.s = float(bsdf.variance), float(bsdf.spread)
        self.tilt, self.eta = math.asin(bsdf.sin_tilt), float(bsdf.eta)
        self.absorption = number(bsdf.scale, hit) * color(bsdf.sigma_a, hit)

    def _lobes(self, wo: Vector) -> list[Lobe]:
        theta, gamma = math.asin(np.clip(wo[1], -1.0, 1.0)), -math.atan2(wo[0], wo[2])
        h, across = math.sin(gamma), math.cos(theta)
        # [Chiang2016]; the index across the fibre is from [Marschner2003]
        index = math.sqrt(max(self.eta**2 - math.sin(theta) ** 2, 0.0)) / across
        # in a denser medium the index is 0 where all is reflected: NaN, so black, as there
        sin_gamma_t = h / index if index > 0.0 else math.nan
        gamma_t = math.asin(np.clip(sin_gamma_t, -1.0, 1.0))
        cos_t = math.sqrt(max(1.0 - (math.sin(theta) / self.eta) ** 2, 0.0))
        with np.errstate(divide="ignore", invalid="ignore"):
            passed = np.exp(-self.absorption * 2.0 * math.cos(gamma_t) / np.float64(cos_t))
            f = reflectance_of_glass(across * abs(math.cos(gamma)), self.eta)
            more = (1.0 - f) ** 2 * f**2 * passed**3 / (1.0 - f * passed)
        once = (1.0 - f) ** 2 * passed
        turn = math.pi + 2.0 * gamma_t
        return [
            (np.full(3, f), theta - 2.0 * self.tilt, self.v, -2.0 * gamma),
            (once, theta + self.tilt, self.v / 4.0, turn - 2.0 * gamma),
            (
                once * f * passed,
                theta + 4.0 * self.tilt,
                4.0 * self.v,
                2.0 * (turn - gamma),
            ),
            (more, theta, 4.0 * self.v, 0.0),
        ]

    def _around(self, angle: float) -> float:
        """Return the logistic distribution on the circle, 1 / rad."""
        x = math.remainder(angle, 2.0 * math.pi) / (2.0 * self.s)
        fallen = math.exp(-abs(x))
        return (fallen / (1.0 + fallen**2)) ** 2 / self.s / math.tanh(math.pi / 2 / self.s)

    def eval_pdf(self, wo: Vector, wi: Vector) -> tuple[Vector, float]:
        """Return f |cos| and the density."""
        if self.v == 0.0 or self.s == 0.0:
            return BLACK, 0.0  # as Mitsuba's quotients of 0
        turn = math.atan2(wi[2], wi[0]) - math.atan2(wo[2], wo[0])
        theta_i = math.asin(np.clip(wi[1], -1.0, 1.0))
        lobes = self._lobes(wo)
        shares = _shares(lobes)
        f, pdf = np.zeros(3), 0.0
        for k, (attenuation, theta_o, v, azimuth) in enumerate(lobes):
            density = _along(theta_o, theta_i, v)
            density *= self._around(turn - azimuth) if k < 3 else 0.5 / math.pi
            f, pdf = f + density * attenuation, pdf + density * shares[k]
        return (f, float(pdf)) if np.isfinite(pdf) else (BLACK, 0.0)

    def sample(self, wo: Vector, numbers: tuple[float, float, float]) -> BsdfSample:
        """Sample a lobe, theta and the azimuth."""
        if self.v == 0.0 or self.s == 0.0:
            return NOTHING
        x, y, choice = numbers
        lobes = self._lobes(wo)
        shares = _shares(lobes)
        ends = np.cumsum(shares)
        k = min(int(np.searchsorted(ends, choice)), 3)
        left = float(np.clip((choice - ends[k] + shares[k]) / shares[k], 0.0, 1.0))
        _, theta_o, v, azimuth = lobes[k]
        # von Mises and Fisher's distribution around the mirrored theta
        cosine = max(
            1.0 + v * math.log(max(x + (1.0 - x) * math.exp(-2.0 / v), 1e-300)), -1.0
        )
        across = math.sqrt(1.0 - cosine**2) * math.cos(2.0 * math.pi * y)
        sine = across * abs(math.cos(theta_o)) - cosine * math.sin(theta_o)
        inner = (2.0 * left - 1.0) * math.tanh(math.pi / 2.0 / self.s)
        azimuth += 2.0 * self.s * math.atanh(np.clip(inner, -1 + 1e-16, 1 - 1e-16))
        phi = math.atan2(wo[2], wo[0]) + (azimuth if k < 3 else 2.0 * math.pi * left)
        radius = math.sqrt(max(1.0 - sine**2, 0.0))
        return self.chosen(
            wo, np.array([radius * math.cos(phi), sine, radius * math.sin(phi)])
        )


def _shares(lobes: list[Lobe]) -> Vector:
    """Return how often each lobe is sampled."""
    light = np.array([LUMINANCE @ attenuation for attenuation, *_ in lobes])
    return light / light.sum()


def _bessel(x: float) -> float:
    """Return I0(x) by eleven terms of its series, as in Mitsuba: 0.6 % too small at 12."""
    return sum((x / 2.0) ** (2 * k) / math.factorial(k) ** 2 for k in range(11))


def _along(theta_o: float, theta_i: float, v: float) -> float:
    """Return the longitudinal distribution [DEon2011b]: its integral over sin is 1.

    csch(1 / v) / (2 v) exp(-sin sin / v) I0(cos cos / v); below v = 0.1 with Mitsuba's
    expansion of I0 and its digits of log 2.
    """
    c = abs(math.cos(theta_o)) * math.cos(theta_i) / v
    s = math.sin(theta_o) * math.sin(theta_i) / v
    if v >= 0.1:
        return _bessel(c) * math.exp(-s) / (2.0 * v * math.sinh(1.0 / v))
    far = c > 12.0
    bessel = (
        c - math.log(2 * math.pi * c) / 2 + 1 / (16 * c) if far else math.log(_bessel(c))
    )
    return math.exp(bessel - s - 1.0 / v + 0.6931) / (2.0 * v)
