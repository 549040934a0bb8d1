"""Sun and sky: the formulas of Hosek and Wilkie, one direction at a time.

`sky_model` looks up the models' tables for the sun of the file; the kernels use the same
numbers. Their evaluation by direction is implemented here independently.
"""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np

from renderer.plugins.lights.sky_model import make_sky
from renderer.scene_file.description import SunSky
from renderer.simple.camera import Vector, mix, normalize, orthonormal_basis, square_to_disk


class Sky:
    """The environment of a scene; directions are in world space unless named local."""

    def __init__(self, light: SunSky) -> None:
        self.light, self.sky = light, make_sky(light)
        self.to_world = light.to_world[:3, :3]
        self.one_minus_cos = 1.0 - self.sky.cosine
        self.azimuth = math.atan2(self.sky.sun[1], self.sky.sun[0])
        _, _, mean, spread_c, spread_azimuth = self.sky.warp
        self.by_c = NormalDist(mean, spread_c)
        self.by_azimuth = NormalDist(0.0, spread_azimuth)

    def local(self, d: Vector) -> Vector:
        """Return a direction in the frame where z is up."""
        return normalize(np.asarray(np.linalg.solve(self.to_world, d), np.float64))

    def is_sun(self, local: Vector) -> bool:
        """Return whether a local direction is within the sun's disk."""
        return float(local @ self.sky.sun) >= self.sky.cosine

    def radiance(self, d: Vector, in_sun: bool = False) -> Vector:
        """Return L of a direction; `in_sun` skips the test of the sun's disk."""
        local = self.local(d)
        if local[2] < 0.0:
            return np.zeros(3)
        lit = self._of_sky(local)
        if in_sun or self.is_sun(local):
            lit = lit + (self._of_limb(local) if self.light.complex_sun else self.sky.disk)
        return lit

    def _angle(self, local: Vector) -> float:
        return 2.0 * math.asin(min(0.5 * float(np.linalg.norm(local - self.sky.sun)), 1.0))

    def _of_sky(self, local: Vector) -> Vector:
        """Return the radiance of the sky [Hosek2012]."""
        a, b, c, d, e, f, g, i, h = self.sky.parameters  # the paper's, in Mitsuba's order
        angle, height = self._angle(local), local[2]
        cos = math.cos(angle)
        glow = (1.0 + cos**2) / (1.0 + h**2 - 2.0 * h * cos) ** 1.5
        horizon = 1.0 + a * np.exp(b / (height + 0.01))
        around = c + d * np.exp(e * angle) + f * cos**2 + g * glow + i * math.sqrt(height)
        return np.asarray(horizon * around * self.sky.radiance)

    def _of_limb(self, local: Vector) -> Vector:
        """Return the radiance of the sun's disk with limb darkening [Hosek2013]."""
        elevation = math.asin(local[2])
        segment = min(int(45.0 * np.cbrt(2.0 / math.pi * elevation)), 44)
        x = elevation - 0.5 * math.pi * (segment / 45.0) ** 3
        edge = math.sin(math.radians(0.5 * self.light.sun_aperture))
        psi = math.sqrt(max(1.0 - (math.sin(self._angle(local)) / edge) ** 2, 0.0))
        powers = x ** np.arange(4), psi ** np.arange(6)
        return np.asarray(np.einsum("ckj,k,j->c", self.sky.limb[segment], *powers))

    def pdf(self, d: Vector, in_sun: bool = False) -> float:
        """Return the density [1/sr] with which `sample` chooses a direction."""
        local = self.local(d)
        if local[2] < 0.0 or not self.sky.risen:
            return 0.0
        peak, slope, *_ = self.sky.warp
        c, azimuth = local[2], math.atan2(local[1], local[0]) - self.azimuth
        azimuth = math.remainder(azimuth, 2.0 * math.pi)
        within = _share(self.by_c, 0.0, 1.0) * _share(self.by_azimuth, -math.pi, math.pi)
        near = self.by_c.pdf(c) * self.by_azimuth.pdf(azimuth) / within
        far = (1.0 + c**2 * (1.0 / slope**2 - 1.0)) ** -1.5 / (2.0 * math.pi * slope)
        sun = in_sun or self.is_sun(local)
        of_sun = 1.0 / (2.0 * math.pi * self.one_minus_cos) if sun else 0.0
        return mix(of_sun, mix(far, near, peak), self.sky.share)

    def sample(self, x: float, y: float) -> tuple[Vector, bool]:
        """Sample a direction with x, y in [0, 1); also return whether it is in the sun."""
        share = self.sky.share
        if x >= share:
            return self.to_world @ self._in_sun((x - share) / (1.0 - share), y), True
        x /= share
        peak, slope, *_ = self.sky.warp
        if x < peak:
            c = _cut(self.by_c, 0.0, 1.0, x / peak)
            azimuth = _cut(self.by_azimuth, -math.pi, math.pi, y)
        else:
            x = (x - peak) / (1.0 - peak)
            c = slope * x / math.sqrt(1.0 + x * x * (slope**2 - 1.0))
            azimuth = 2.0 * math.pi * (y - 0.5)
        c, azimuth = max(c, 0.0), azimuth + self.azimuth
        across = math.sqrt(max(1.0 - c * c, 0.0))
        local = np.array([across * math.cos(azimuth), across * math.sin(azimuth), c])
        return self.to_world @ local, False

    def _in_sun(self, x: float, y: float) -> Vector:
        p, q = square_to_disk(x, y)
        height = self.one_minus_cos * (p * p + q * q)  # 1 - cos of the angle to the centre
        out = math.sqrt(self.one_minus_cos * (2.0 - height))
        s, t = orthonormal_basis(self.sky.sun)
        return s * (p * out) + t * (q * out) + self.sky.sun * (1.0 - height)


def _share(normal: NormalDist, least: float, most: float) -> float:
    return normal.cdf(most) - normal.cdf(least)


def _cut(normal: NormalDist, least: float, most: float, x: float) -> float:
    """Return the x-quantile of a normal distribution truncated to least .. most."""
    share = normal.cdf(least) + x * _share(normal, least, most)
    return normal.inv_cdf(min(max(share, 2.0**-24), 1.0 - 2.0**-24))
