"""Sums, samples, angles and slabs: what float32 loses in a line of arithmetic."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

import renderer
from mitsuba_ref.expected_failures.rounding import single_precision_sum
from renderer.plugins.lights.sky_model import half_cosine
from reports.studies.limits.one_point import estimates, load_scene, scene_at
from reports.studies.limits.probes import (
    Floats,
    Shown,
    directions,
    dot,
    on_screen,
    single,
    unit,
)

# ------------------------------------------------------------------------------------- sums


def _ones_missing(count: float) -> float:
    """Return which share of so many ones a float32 counter does not count."""
    ones = np.ones(int(count), np.float32)
    return 1.0 - float(np.add.accumulate(ones, dtype=np.float32)[-1]) / int(count)


def _double(count: float) -> float:
    tenths = np.full(int(count), 0.1, np.float32)
    total = np.add.accumulate(tenths, dtype=np.float64)[-1]
    return abs(float(total) / (int(count) * float(np.float32(0.1))) - 1.0)


def banded_sum() -> Shown:
    """Show a ramp, and the means of 10^5, 10^6 and 3 * 10^6 summands in float32."""
    block = 10_000
    ramp = np.linspace(0.1, 0.3, 144, dtype=np.float32)
    shown, total = [ramp], np.zeros_like(ramp)
    for number in range(1, 301):
        summands = np.concatenate((total[None], np.broadcast_to(ramp, (block, ramp.size))))
        total = np.add.accumulate(summands, axis=0, dtype=np.float32)[-1]
        if number in (10, 100, 300):
            shown.append(total / np.float32(number * block))
    return _strips(shown, exposure=3.0)


def _strips(rows: list[NDArray[np.floating]], exposure: float) -> Shown:
    """Show rows of grey values as strips, one below the other."""
    gap = np.full((2, len(rows[0])), 1.0 / exposure)
    height = 72 // len(rows)
    strips = [part for row in rows for part in (np.tile(row, (height, 1)), gap)]
    return on_screen([np.concatenate(strips[:-1])], exposure=exposure, enlarged=4)


# ----------------------------------------------------------------------- half precision


def _error_of_format(radiance: float, kind: type) -> float:
    """Return the relative error of a radiance that was written and read again."""
    with np.errstate(over="ignore"):
        kept = np.float64(kind(np.float32(radiance)))
    return float(abs(kept / np.float32(radiance) - 1.0))


def _half_in_the_dark(strength: float) -> float:
    return _error_of_format(1.0 / strength, np.float16)


def _single_at_both_ends(strength: float) -> float:
    ends = strength, 1.0 / strength
    return max(_error_of_format(radiance, np.float32) for radiance in ends)


def dark_ramp() -> Shown:
    """Show a ramp from 0 to 10^-6 in float32, and in halves."""
    ramp = np.linspace(0.0, 1e-6, 144, dtype=np.float32)
    return _strips([ramp, ramp.astype(np.float16).astype(np.float32)], exposure=0.7e6)


# ------------------------------------------------------------------------- random choice

NUMBERS = 2**24  # that a float32 in [0, 1) has, evenly spaced


def _uneven(entries: float) -> float:
    """Return by how much the likeliest of n equal entries is too likely."""
    n = int(entries)
    # entry k gets the numbers j with k <= n j / 2^24 < k + 1
    firsts = -(-np.arange(n + 1, dtype=np.int64) * NUMBERS // n)
    return float(np.abs(np.diff(firsts) * (n / NUMBERS) - 1.0).max())


# -------------------------------------------------------------------------- small angles

_LAMP = """<shape type="rectangle"><bsdf type="diffuse">
    <rgb name="reflectance" value="1"/></bsdf></shape>
<shape type="sphere"><point name="center" x="0" y="0" z="{distance}"/>
    <emitter type="area"><rgb name="radiance" value="{radiance}"/></emitter></shape>"""


def _naive_cone(distance: float) -> float:
    """Return the error of 1 - cos of a unit sphere's half angle, as it is written."""
    sine = np.float32(1) / np.float32(distance)
    found = np.float32(1) - np.sqrt(np.float32(1) - sine * sine)
    s = 1.0 / distance
    truth = s * s / (1.0 + np.sqrt(1.0 - s * s))
    return float(abs(found / truth - 1.0))


def _lamp(distance: float) -> float:
    """Return the error of the light that a floor gets from a sphere right above it."""
    body = _LAMP.format(distance=distance, radiance=distance**2)
    lookat = 'origin="3,0,3" target="0,0,0" up="0,1,0"'
    scene = load_scene(body, lookat, '<integrator type="direct"/>', size=1, fov=0.01)
    pixel = float(renderer.render(scene, spp=16).pixels.mean())
    return abs(pixel - 1.0)  # L (r / d)^2


def _size_of_sun(one_over_aperture: float) -> float:
    """Return the error of the solid angle of a `sunsky`'s sun, by its cosine in float32."""
    half = np.radians(0.5 / one_over_aperture)
    truth = 2.0 * np.sin(0.5 * half) ** 2
    return float(abs((1.0 - half_cosine(1.0 / one_over_aperture)) / truth - 1.0))


@cache
def _floor_in_sun(aperture: float) -> float:
    """Return the light that a floor gets from a sun in the zenith."""
    sun = f"""<shape type="rectangle"/><emitter type="sunsky">
        <float name="sun_aperture" value="{aperture!r}"/>
        <float name="sky_scale" value="0"/>
        <vector name="sun_direction" value="0,0,1"/></emitter>"""
    scene = scene_at(sun, 'origin="3,0,3" target="0,0,0" up="0,0,1"')
    return float(np.mean(estimates(scene, 16)))


def _light_of_sun(one_over_aperture: float) -> float:
    """Return how far a sun's light is from that of a sun of 1 degree, relatively."""
    return abs(_floor_in_sun(1.0 / one_over_aperture) / _floor_in_sun(1.0) - 1.0)


def _angle(strength: float, by_arccos: bool) -> float:
    """Return the largest relative error of angles of 1 / strength, in float32."""
    rng = np.random.default_rng(15)
    first = directions(1024, rng)
    across = unit(np.cross(first, directions(1024, rng)))
    a, b = single(first), single(unit(first + np.tan(1.0 / strength) * across))
    if by_arccos:
        found = np.arccos(np.clip(dot(a, b), -1.0, 1.0))
    else:
        found = np.float32(2) * np.arcsin(np.sqrt(dot(b - a, b - a)) / np.float32(2))
    return float(np.abs(found * strength - 1.0).max())


# ------------------------------------------------------------------------------------ slabs

RAYS = 8192
MARGIN = 2.0 * 3.0 * 2.0**-24 / (1.0 - 3.0 * 2.0**-24)  # 2 gamma(3): three roundings
LAST_PLACE = 2.0**-23  # of a float32 just above 1


def _enters(origin: Floats, direction: Floats, margin: float, nan_is_inside: bool) -> float:
    """Return the share of rays that the slab test lets into the unit cube.

    The far ends are 1 + margin times as far [Ize2013].
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.float32(1) / direction
        a, b = (np.float32(0) - origin) * inverse, (np.float32(1) - origin) * inverse
    far_end = np.float32(1.0 + margin)
    if nan_is_inside:  # which end is nearer goes by the sign, and NaN is passed over
        backwards = np.signbit(inverse)
        enter = np.fmax.reduce(np.where(backwards, b, a), axis=1)
        leave = np.fmin.reduce(np.where(backwards, a, b) * far_end, axis=1)
    else:
        enter = np.minimum(a, b).max(axis=1)
        leave = (np.maximum(a, b) * far_end).min(axis=1)
    return float(np.mean(np.fmax(enter, 0.0) <= leave))


def _lost_in_faces(zeros: float, nan_is_inside: bool) -> float:
    """Return the share lost of rays in faces of the cube, some components 0 or -0."""
    rng = np.random.default_rng(13)
    direction = single(directions(RAYS, rng))
    origin = single(rng.uniform(0.25, 0.75, (RAYS, 3)) - direction)
    axes = rng.permuted(np.tile(np.arange(3), (RAYS, 1)), axis=1)[:, : int(zeros)]
    rows = np.arange(RAYS)[:, None]
    direction[rows, axes] = np.where(rng.random(axes.shape) < 0.5, 0.0, -0.0)
    origin[rows, axes] = rng.integers(0, 2, axes.shape)
    return 1.0 - _enters(origin, direction, MARGIN, nan_is_inside)


def _lost_near_edges(strength: float, margin: float) -> float:
    """Return the share lost of rays at points 1 / strength inside of the cube's edges."""
    rng = np.random.default_rng(14)
    target = rng.random((RAYS, 3))
    axes = rng.permuted(np.tile(np.arange(3), (RAYS, 1)), axis=1)[:, :2]
    # silhouette edges, seen from the outside of both faces
    side = rng.integers(0, 2, axes.shape)
    rows, inside = np.arange(RAYS)[:, None], 1.0 / strength
    target[rows, axes] = np.where(side == 0, inside, 1.0 - inside)
    away = directions(RAYS, rng)
    # over one face outwards, and over the other inwards: the ray only grazes the edge
    signs = np.where(side == 0, -1.0, 1.0) * (1.0, -1.0)
    away[rows, axes] = np.abs(away[rows, axes]) * signs
    away = unit(away)
    origin = single(target + 3.0 * away)
    direction = single(unit(target - origin))
    return 1.0 - _enters(origin, direction, margin, True)


MEASURES = {
    "slabs-zero-times-infinity": partial(_lost_in_faces, nan_is_inside=False),
    "slabs-nan-passed-over": partial(_lost_in_faces, nan_is_inside=True),
    "slabs-without-margin": partial(_lost_near_edges, margin=0.0),
    "slabs-margin-too-small": partial(_lost_near_edges, margin=LAST_PLACE),
    "slabs-margin-of-two": partial(_lost_near_edges, margin=2.0 * LAST_PLACE),
    "slabs-with-margin": partial(_lost_near_edges, margin=MARGIN),
    "cone-naive": _naive_cone,
    "cone-ours": _lamp,
    "sun-solid-angle": _size_of_sun,
    "sun-light": _light_of_sun,
    "angle-by-arccos": partial(_angle, by_arccos=True),
    "angle-by-chord": partial(_angle, by_arccos=False),
    "sum-in-float32": lambda count: abs(single_precision_sum(int(count)) - 1.0),
    "counter-in-float32": _ones_missing,
    "sum-in-float64": _double,
    "half-float-bright": partial(_error_of_format, kind=np.float16),
    "half-float-dark": _half_in_the_dark,
    "single-float": _single_at_both_ends,
    "choice-by-one-float": _uneven,
}
PICTURES = {"sum": banded_sum, "half-float": dark_ramp}
