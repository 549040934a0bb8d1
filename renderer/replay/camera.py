"""Stage 1 in a replay: camera rays with Mitsuba's rounding.

A grazing hit at a distance of 9 moves by 7e-6 if the direction changes by one unit in the
last place, so this first rounding outweighs all later ones. Mitsuba uses the matrix from
the crop window to the camera. It cannot be computed here bit for bit: some of its factors
are reciprocals from a table of the processor. The harness reads its entries from Mitsuba
and passes them on. They are used if they differ from ours by rounding only.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import interface, kernel, method_kernel, never_inline
from renderer.kernels.lanes.vectors import column, vec3
from renderer.replay.arithmetic import (
    fused_multiply_add,
    fused_sum,
    times_point,
    times_vector,
    unit,
)
from renderer.scene_file.description import (
    OrthographicCamera,
    PerspectiveCamera,
    Sensor,
    ThinLensCamera,
)

_ONE = np.float32(1.0)
_SAME = 1e-6  # relative difference of a matrix entry that counts as rounding
_ZERO = np.float32(0.0)
_ROUNDING = np.float32(1e-5)  # of a direction, and of an origin relative to its size
_QUARTER_PI = np.float32(np.pi / 4.0)
_HALF_PI = np.float32(np.pi / 2.0)

ENTRIES = ((0, 0), (0, 3), (1, 1), (1, 3), (2, 3), (3, 3))
"""Entries of Mitsuba's matrix from the crop window to the camera; others have no effect."""


class ReplayCamera(NamedTuple):
    """A pinhole camera with Mitsuba's numbers."""

    entries: NDArray[np.float32]  # (6,) see `ENTRIES`
    window: NDArray[np.float32]  # (3, 2) window position = (a * film position + b) + c
    to_world: NDArray[np.float32]  # (12, 1) rows
    near: float


class ReplayThinLens(NamedTuple):
    """A thin lens camera with Mitsuba's numbers."""

    pinhole: ReplayCamera
    radius: float
    focus: float


class ReplayOrthographic(NamedTuple):
    """An orthographic camera with Mitsuba's numbers."""

    camera: ReplayCamera


def replay_camera(camera: Sensor, measured: Sequence[float] | None) -> Any:
    """Return the sensor of a replay.

    Parameters
    ----------
    camera : Sensor
        The sensor of the file.
    measured : sequence of 6 floats, optional
        Mitsuba's own `ENTRIES`. An entry that differs from ours by more than rounding is
        ignored, so the pictures show the difference.
    """
    film = camera.film
    size = np.array([film.width, film.height], np.float64)
    crop = np.array([film.crop_width, film.crop_height], np.float64)
    offset = np.array([film.crop_offset_x, film.crop_offset_y], np.float64)
    half, moved = 1.0, np.zeros(2)
    last = [camera.near_clip, 1.0]  # depth of the near plane, from the last two entries
    if isinstance(camera, PerspectiveCamera):
        half = np.tan(np.radians(camera.fov_x) / 2.0)
        moved = np.array([camera.principal_point_offset_x, camera.principal_point_offset_y])
        last = [1.0, 1.0 / camera.near_clip]
    half_sides = half * np.array([1.0, size[1] / size[0]])
    a = -2.0 * half_sides * crop / size
    b = half_sides * (1.0 - 2.0 * offset / size)
    ours = np.array([a[0], b[0], a[1], b[1], *last], np.float32)
    if measured is not None:
        theirs = np.asarray(measured, np.float32)
        scale = np.maximum(np.abs(ours), np.float32(half))
        ours = np.where(np.abs(theirs - ours) <= _SAME * scale, theirs, ours)
    one = np.float32(1.0) / crop.astype(np.float32)
    # our film begins `border` pixels earlier, where samples lie beyond its edge
    shift = -(offset + film.border).astype(np.float32) * one
    found = ReplayCamera(
        ours.astype(np.float32),
        np.array([one, shift, moved * size / crop], np.float32),
        np.ascontiguousarray(camera.to_world[:3].reshape(12, 1), np.float32),
        float(camera.near_clip),
    )
    if isinstance(camera, ThinLensCamera):
        return ReplayThinLens(found, camera.aperture_radius, camera.focus_distance)
    if isinstance(camera, OrthographicCamera):
        return ReplayOrthographic(found)
    return found


@interface
def exact_ray(camera: Any, px: Any, py: Any, lens_x: Any, lens_y: Any) -> Any:
    """Return origin and direction of the ray through a film position in pixels."""


@kernel
def _in_window(camera, px, py):
    """Return the x and y, in camera space, of the matrix product before division by w."""
    w, m = camera.window, camera.entries
    x = fused_multiply_add(px, w[0, 0], w[1, 0]) + w[2, 0]
    y = fused_multiply_add(py, w[0, 1], w[1, 1]) + w[2, 1]
    return fused_multiply_add(m[0], x, m[1]), fused_multiply_add(m[2], y, m[3])


@kernel
def _on_near_plane(camera, px, py):
    x, y = _in_window(camera, px, py)
    m = camera.entries
    inverse = _ONE / m[5]
    return vec3(x * inverse, y * inverse, m[4] * inverse)


@exact_ray.by(ReplayCamera)
@kernel
def _pinhole_ray(camera, px, py, lens_x, lens_y):
    local = unit(_on_near_plane(camera, px, py))
    direction = times_vector(camera.to_world, 0, 0, local)
    near = np.float32(camera.near) * (_ONE / local.z)
    m = camera.to_world
    return fused_sum(direction, near, vec3(m[3, 0], m[7, 0], m[11, 0])), direction


@kernel
def _on_disk(x, y):
    """Map [0, 1)^2 to the unit disk; the sine may be off by a unit in the last place."""
    a = x * np.float32(2.0) - _ONE
    b = y * np.float32(2.0) - _ONE
    if a == _ZERO and b == _ZERO:
        return a, b
    if abs(a) < abs(b):
        radius, angle = b, _HALF_PI - _QUARTER_PI * a / b
    else:
        radius, angle = a, _QUARTER_PI * b / a
    return radius * np.cos(angle), radius * np.sin(angle)


@exact_ray.by(ReplayThinLens)
@kernel
def _thin_lens_ray(camera, px, py, lens_x, lens_y):
    pinhole = camera.pinhole
    near_point = _on_near_plane(pinhole, px, py)
    x, y = _on_disk(lens_x, lens_y)
    radius = np.float32(camera.radius)
    lens = vec3(radius * x, radius * y, _ZERO)
    local = unit(near_point * (np.float32(camera.focus) / near_point.z) - lens)
    direction = times_vector(pinhole.to_world, 0, 0, local)
    near = np.float32(pinhole.near) * (_ONE / local.z)
    return fused_sum(direction, near, times_point(pinhole.to_world, 0, 0, lens)), direction


@exact_ray.by(ReplayOrthographic)
@kernel
def _parallel_ray(sensor, px, py, lens_x, lens_y):
    camera = sensor.camera
    x, y = _in_window(camera, px, py)
    m = camera.entries
    origin = times_point(camera.to_world, 0, 0, vec3(x, y, m[4] * (_ONE / m[5])))
    forward = vec3(_ZERO, _ZERO, _ONE)
    return origin, unit(times_vector(camera.to_world, 0, 0, forward))


@kernel
def _close(a, b, limit):
    return abs(a.x - b.x) <= limit and abs(a.y - b.y) <= limit and abs(a.z - b.z) <= limit


@kernel
def round_camera_ray(camera, rays, k, px, py, lens_x, lens_y):
    """Round ray k through film position (px, py) if it differs by rounding only."""
    never_inline()
    origin, direction = exact_ray(camera, px, py, lens_x, lens_y)
    size = _ONE + max(abs(origin.x), max(abs(origin.y), abs(origin.z)))
    if not (
        _close(direction, column(rays.direction, k), _ROUNDING)
        and _close(origin, column(rays.origin, k), _ROUNDING * size)
    ):
        return
    rays.direction[0, k], rays.direction[1, k] = direction.x, direction.y
    rays.direction[2, k] = direction.z
    rays.origin[0, k], rays.origin[1, k] = origin.x, origin.y
    rays.origin[2, k] = origin.z


@method_kernel
def round_camera_rays(camera, rays, count, film):
    """Round a tile's camera rays, whose film positions are given by slot."""
    for k in range(count):
        s = rays.slot[k]
        round_camera_ray(camera, rays, k, film[0, s], film[1, s], film[2, s], film[3, s])
