"""Bounds of one light for importance sampling: its place, power and emitted directions."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

_ANY_WAY = (0.0, 0.0, 1.0)
_CLOSED = 0.01  # the area vectors of a closed surface cancel but for rounding


class LightBounds(NamedTuple):
    """A ball that holds the light, and the cone that it shines into.

    A light in a finite place gives about intensity / distance^2 to a surface that faces
    it, one at infinity `strength` itself.
    """

    center: Any  # (3,) world
    radius: float  # of the ball around it
    strength: float  # [W/sr], mean of RGB; at infinity the irradiance [W/m^2]
    axis: Any  # (3,) unit: of the cone; at infinity towards the light
    # [rad] Half angles. Within `spread` of the axis it shines in full, then as the cosine
    # of the angle from there, and not at all `reach` farther on, at most pi / 2.
    spread: float
    reach: float
    at_infinity: bool = False


def all_around(center: Any, intensity: float) -> LightBounds:
    """Return the bounds of a point that shines everywhere."""
    return LightBounds(center, 0.0, intensity, _ANY_WAY, math.pi, 0.0)


def in_cone(
    center: Any, intensity: float, axis: Any, spread: float, reach: float
) -> LightBounds:
    """Return the bounds of a point that shines into a cone around an axis of any length.

    From 90 degrees beyond `spread` on the cosine is negative, and so would be the
    probability of the light: where `reach` is more, `spread` takes the rest.
    """
    rest = max(reach - 0.5 * math.pi, 0.0)
    return LightBounds(center, 0.0, intensity, _unit(axis), spread + rest, reach - rest)


def from_direction(irradiance: float, to_light: Any) -> LightBounds:
    """Return the bounds of a light at infinity that is seen in one direction."""
    return LightBounds(
        np.zeros(3), 0.0, irradiance, _unit(to_light), 0.0, 0.0, at_infinity=True
    )


def from_everywhere(radiance: float) -> LightBounds:
    """Return the bounds of an environment of a mean radiance [W/m^2/sr]."""
    irradiance = math.pi * radiance
    return LightBounds(
        np.zeros(3), 0.0, irradiance, _ANY_WAY, math.pi, 0.0, at_infinity=True
    )


def on_surface(
    points: NDArray[np.float64],
    margin: NDArray[np.float64],
    normals: NDArray[np.float64],
    areas: NDArray[np.float64],
    radiance: float,
) -> LightBounds:
    """Return the bounds of a surface that shines on the side of its normals.

    Parameters
    ----------
    points, margin
        (3, k, n) and (n,): primitive i is in the hull of points i, grown by margin i.
    normals
        (3, n) towards the side that shines; 0 where a primitive is not flat.
    areas
        (n,)
    radiance
        The mean [W/m^2/sr].
    """
    corners = points.reshape(3, -1)
    grown = np.broadcast_to(margin, points.shape[1:]).ravel()
    center = 0.5 * ((corners - grown).min(axis=1) + (corners + grown).max(axis=1))
    away = np.linalg.norm(corners - center[:, None], axis=0)
    axis = normals @ areas
    facing = float(np.linalg.norm(axis))  # the area that is seen along the axis, if flat
    spread = math.pi
    closed = facing < _CLOSED * areas.sum()
    if not closed and np.abs(normals).max(axis=0).all():
        spread = float(angles_from(axis / facing, normals.T).max())
    # a convex surface is seen under a fourth of its area on average (Cauchy)
    seen = max(facing, 0.25 * float(areas.sum()))
    return LightBounds(
        center,
        float((away + grown).max()),
        radiance * seen,
        _ANY_WAY if closed else _unit(axis),
        spread,
        0.5 * math.pi,
    )


def angles_from(axis: Any, others: Any) -> NDArray[np.float64]:
    """Return the angles [rad] between unit vectors (3,) and (n, 3).

    By their distance, as the cosine of a small angle has lost it: of two equal normals in
    single precision it makes 0.0002.
    """
    apart = 0.5 * np.linalg.norm(others - axis, axis=1)
    return np.asarray(2.0 * np.arcsin(np.minimum(apart, 1.0)))


def _unit(axis: Any) -> NDArray[np.float64]:
    given = np.asarray(axis, np.float64)
    return np.asarray(given / np.linalg.norm(given))
