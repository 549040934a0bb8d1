"""Transmittance of a rough interface: a table over the cosine, in float64.

The values are a Gauss-Legendre quadrature over the two random numbers that sample a visible
normal, with 32 or 128 nodes for each. Its error is below 1e-5 except at grazing angles, and
Mitsuba has the same error.
"""

from __future__ import annotations

import math
from functools import cache
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RESOLUTION = 64  # cosines at which the table has entries
_LEAST_COSINE = 1e-6
_SMOOTHEST = 1e-4
_erf = np.vectorize(math.erf)
_normal_quantile = np.vectorize(NormalDist().inv_cdf)
_gauss_legendre = cache(np.polynomial.legendre.leggauss)


@cache
def rough_transmittance(beckmann: bool, alpha: float, eta: float) -> tuple[Array, float]:
    """Return the table of an interface, and its mean reflectance from the other side.

    Parameters
    ----------
    beckmann : bool
        Beckmann distribution; otherwise GGX.
    alpha : float
        Roughness, isotropic.
    eta : float
        Index of refraction of the transmitted side over that of the incident side.

    Returns
    -------
    ndarray of shape (64,), float
        Transmittance by the cosine of the incident angle, 0 to 1; and the reflectance
        for diffuse light from the other side.
    """
    alpha = max(alpha, _SMOOTHEST)
    cosines = np.maximum(np.linspace(0.0, 1.0, RESOLUTION), _LEAST_COSINE)
    passes = [_scattered(beckmann, alpha, eta, mu, reflect=False) for mu in cosines]
    stays = [_scattered(beckmann, alpha, 1.0 / eta, mu, reflect=True) for mu in cosines]
    return np.array(passes), 2.0 * float(np.mean(cosines * stays))


def _scattered(
    beckmann: bool, alpha: float, eta: float, mu: float, *, reflect: bool
) -> float:
    """Return the reflectance, or the transmittance, for an incident cosine mu."""
    node, weight = _gauss_legendre(32 if eta > 1.0 else 128)
    u, half = 0.5 * (node + 1.0), len(node) // 2
    # symmetric about the plane of wo: half of the nodes across it suffice
    x, y, z = _visible_normals(beckmann, alpha, mu, u, half)
    weights = 0.5 * np.outer(weight, weight[half:])
    if not beckmann:  # for GGX the first number is across the plane
        weights = weights.T
    sine = math.sqrt(1.0 - mu * mu)
    cos_o = sine * x + mu * z
    fresnel, cos_t = _fresnel(cos_o, eta)
    if reflect:
        out_z, out_x = 2.0 * cos_o * z - mu, 2.0 * cos_o * x - sine
        out_y, share = 2.0 * cos_o * y, fresnel
    else:
        scale = cos_o / eta + cos_t
        out_z, out_x = scale * z - mu / eta, scale * x - sine / eta
        out_y, share = scale * y, 1.0 - fresnel
    there = out_z > 0.0 if reflect else out_z < 0.0
    cosine = out_x * x + out_y * y + out_z * z
    with np.errstate(all="ignore"):
        tan2 = alpha**2 * (out_x**2 + out_y**2) / out_z**2
        seen = np.where(there & (cosine * out_z > 0.0), _unshadowed(beckmann, tan2), 0.0)
    return float(np.sum(weights * seen * share))


def _unshadowed(beckmann: bool, tan2: Array) -> Array:
    """Return G1, see `microfacets.unshadowed`."""
    if not beckmann:
        return 2.0 / (1.0 + np.sqrt(1.0 + tan2))
    a = 1.0 / np.sqrt(tan2)
    fit = (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a)
    return np.where(a >= 1.6, 1.0, fit)


def _fresnel(cosine: Array, eta: float) -> tuple[Array, Array]:
    """Return reflectance and cosine of the refracted direction, which is negative."""
    cos_t = np.sqrt(np.maximum(0.0, 1.0 - (1.0 - cosine**2) / eta**2))
    perpendicular = (cosine - eta * cos_t) / (cosine + eta * cos_t)
    parallel = (eta * cosine - cos_t) / (eta * cosine + cos_t)
    return 0.5 * (perpendicular**2 + parallel**2), -cos_t


def _visible_normals(
    beckmann: bool, alpha: float, mu: float, u: Array, half: int
) -> tuple[Any, Any, Any]:
    """Return the normals visible from wo = (sin, 0, mu), with u[half:] across its plane.

    Sampled as in `microfacets`, whose docstrings have the references.
    """
    sine = math.sqrt(1.0 - mu * mu)
    norm = math.hypot(alpha * sine, mu)
    c, s = mu / norm, alpha * sine / norm
    slopes = _beckmann_slopes if beckmann else _ggx_slopes
    along, across = slopes(c, s, u, half)
    x, y = -alpha * along, -alpha * across
    z = 1.0 / np.sqrt(x * x + y * y + 1.0)
    return x * z, y * z, z


def _ggx_slopes(c: float, s: float, u: Array, half: int) -> tuple[Any, Any]:
    a, b = np.meshgrid(2.0 * u[half:] - 1.0, 2.0 * u - 1.0, indexing="ij")
    steep = np.abs(a) < np.abs(b)
    radius, other = np.where(steep, b, a), np.where(steep, a, b)
    angle = np.pi / 4 * other / radius
    angle = np.where(steep, np.pi / 2 - angle, angle)
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    share = 0.5 * (1.0 + c)
    y = (1.0 - share) * np.sqrt(np.maximum(0.0, 1.0 - x * x)) + share * y
    z = np.sqrt(np.maximum(0.0, 1.0 - x * x - y * y))
    scale = 1.0 / (s * y + c * z)
    return (c * y - s * z) * scale, x * scale


def _beckmann_slopes(c: float, s: float, u: Array, half: int) -> tuple[Any, Any]:
    if s == 0.0:  # at normal incidence both slopes have the same distribution
        return _erfinv(2.0 * u - 1.0)[:, None], _erfinv(2.0 * u[half:] - 1.0)
    tangent = s / c
    most = math.erf(1.0 / tangent)
    scale = tangent / math.sqrt(math.pi)
    target = u * (1.0 + most + scale * math.exp(-((1.0 / tangent) ** 2)))
    x = most - (1.0 + most) * _erf(np.sqrt(-np.log(u)))
    for _ in range(3):
        slope = _erfinv(x)
        value = 1.0 + x + scale * np.exp(-(slope**2)) - target
        x = x - value / (1.0 - slope * tangent)
    return _erfinv(x)[:, None], _erfinv(2.0 * u[half:] - 1.0)


def _erfinv(x: Array) -> Array:
    result: Array = _normal_quantile(0.5 * (x + 1.0)) / math.sqrt(2.0)
    return result
