"""Charts: directions from a point to a light as coordinates in the unit square.

A density of directions is smooth in the coordinates of a chart, however the light's outline
lies on the sphere of directions, so it integrates to many digits. All in float64 and apart
from the renderer: only the geometry of shape and point comes in.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from kernel_probes import unit
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Look(NamedTuple):
    """What is seen at coordinates of a chart, (n,) each."""

    distance: Array
    cosine: Array  # at the light, positive
    solid_angle: Array  # per unit of a and of b


class Chart(NamedTuple):
    """One piece of a light as a point sees it: all of it from the front."""

    look: Callable[[Array, Array], Look]
    find: Callable[[Array], tuple[Array, Array]]  # directions (n, 3) -> a, b


def basis(axis: Any) -> tuple[Array, Array, Array]:
    """Return unit vectors s, t and the axis."""
    w = unit(axis)
    s = unit(np.cross(w, np.eye(3)[np.abs(w).argmin()]))
    return s, np.cross(w, s), w


def _turn(y: Array, x: Array) -> Array:
    return (np.arctan2(y, x) / (2 * np.pi)) % 1


# ----------------------------------------------------------------------- flat shapes

# For each: (a, b) -> (u, v), the Jacobian of that, and (u, v) -> (a, b)
_FLAT: dict[str, tuple[Callable, Callable, Callable]] = {
    "rectangle": (lambda a, b: (a, b), lambda a: 1 + 0 * a, lambda u, v: (u, v)),
    "disk": (
        lambda a, b: (a * np.cos(2 * np.pi * b), a * np.sin(2 * np.pi * b)),
        lambda a: 2 * np.pi * a,
        lambda u, v: (np.hypot(u, v), _turn(v, u)),
    ),
    "triangle": (
        lambda a, b: (a, b * (1 - a)),
        lambda a: 1 - a,
        lambda u, v: (u, v / np.maximum(1 - u, 1e-12)),
    ),
}


def flat_chart(kind: str, position: Array, corner: Array, e1: Array, e2: Array) -> Chart:
    """Chart of a piece of a plane, `corner + u e1 + v e2`."""
    to_uv, jacobian, from_uv = _FLAT[kind]
    cross = np.cross(e1, e2)
    area = np.linalg.norm(cross)
    normal = cross / area
    rows = np.linalg.pinv(np.stack((e1, e2), axis=1))

    def look(a: Array, b: Array) -> Look:
        u, v = to_uv(a, b)
        to_light = corner - position + u[:, None] * e1 + v[:, None] * e2
        r = np.linalg.norm(to_light, axis=1)
        cosine = np.abs(to_light @ normal) / r
        return Look(r, cosine, cosine / r**2 * area * jacobian(a))

    def find(wi: Array) -> tuple[Array, Array]:
        t = ((corner - position) @ normal) / (wi @ normal)
        u, v = rows @ (position + wi * t[:, None] - corner).T
        return from_uv(u, v)

    return Chart(look, find)


# ---------------------------------------------------------------------- round shapes


def cone_chart(position: Array, center: Array, radius: float) -> Chart:
    """Chart of a sphere from outside: a is the share of the cone's solid angle, b turns."""
    s, t, w = basis(center - position)
    d = np.linalg.norm(center - position)
    sine2 = (radius / d) ** 2
    opening = sine2 / (1 + np.sqrt(1 - sine2))  # 1 - cos

    def look(a: Array, b: Array) -> Look:
        less = a * opening
        half_chord = np.sqrt(np.maximum(radius**2 - d**2 * less * (2 - less), 0))
        r = d * (1 - less) - half_chord
        return Look(r, half_chord / radius, 2 * np.pi * opening + 0 * a)

    def find(wi: Array) -> tuple[Array, Array]:
        # half of the squared chord keeps its digits where 1 - cos would not
        return np.sum((wi - w) ** 2, axis=1) / 2 / opening, _turn(wi @ t, wi @ s)

    return Chart(look, find)


def all_around_chart(position: Array, center: Array, radius: float) -> Chart:
    """Chart of all directions, to a sphere from inside: a is height, b turns around z."""

    def direction(a: Array, b: Array) -> Array:
        z = 2 * a - 1
        r, angle = np.sqrt(1 - z * z), 2 * np.pi * b
        return np.stack((r * np.cos(angle), r * np.sin(angle), z), axis=1)

    def look(a: Array, b: Array) -> Look:
        wi = direction(a, b)
        along = wi @ (center - position)
        offset2 = np.sum((center - position) ** 2)
        half_chord = np.sqrt(radius**2 - offset2 + along**2)
        return Look(along + half_chord, half_chord / radius, 4 * np.pi + 0 * a)

    return Chart(look, lambda wi: ((1 + wi[:, 2]) / 2, _turn(wi[:, 1], wi[:, 0])))


def tube_chart(position: Array, base: Array, radius: float, height: float) -> Chart:
    """Chart of the near half of an upright cylinder: a is height, b the angle."""
    from_axis = np.arctan2(position[1] - base[1], position[0] - base[0])
    d = np.hypot(position[0] - base[0], position[1] - base[1])
    reach = np.arccos(radius / d)

    def look(a: Array, b: Array) -> Look:
        angle = from_axis + reach * (2 * b - 1)
        normal = np.stack((np.cos(angle), np.sin(angle), 0 * a), axis=1)
        to_light = base - position + radius * normal
        to_light[:, 2] += height * a
        r = np.linalg.norm(to_light, axis=1)
        cosine = -np.sum(to_light * normal, axis=1) / r
        return Look(r, cosine, cosine / r**2 * 2 * reach * radius * height)

    def find(wi: Array) -> tuple[Array, Array]:
        flat2 = np.sum(wi[:, :2] ** 2, axis=1)
        along = wi[:, :2] @ (base - position)[:2]
        root = np.sqrt(np.maximum(along**2 - flat2 * (d**2 - radius**2), 0))
        p = position + wi * ((along - root) / flat2)[:, None] - base
        angle = np.arctan2(p[:, 1], p[:, 0]) - from_axis
        angle = (angle + np.pi) % (2 * np.pi) - np.pi
        return p[:, 2] / height, (angle / reach + 1) / 2

    return Chart(look, find)


def mantle_share(position: Array, base: Array, radius: float) -> float:
    """Return the share of an upright cylinder's wall that faces a point outside."""
    d = np.hypot(position[0] - base[0], position[1] - base[1])
    return float(np.arccos(radius / d) / np.pi)
