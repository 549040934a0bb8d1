"""Stage 1 in a replay: camera rays as Mitsuba rounds them.

A hit 9 away at a grazing angle moves by 7e-6 when the direction changes by one unit in the
last place, so that this first rounding outweighs all later ones. Mitsuba goes through the
matrix that leads from the crop window to the camera, and that cannot be computed here bit
for bit: some of its factors are reciprocals from a table of the processor. Whoever has
Mitsuba beside him can read its entries and hand them on; they are taken if they differ from
ours by rounding only.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.jit import kernel, method_kernel, never_inline
from renderer.lanes.vectors import column, vec3
from renderer.replay.rounding.fused import fused_multiply_add
from renderer.replay.rounding.rounded_once import fused_sum, times_vector, unit
from renderer.scene_file.description import PerspectiveCamera

_ONE = np.float32(1.0)
_SAME = 1e-6  # relative difference of a matrix entry that rounding explains
_ROUNDING = np.float32(1e-5)  # of a direction

ENTRIES = ((0, 0), (0, 3), (1, 1), (1, 3), (2, 3), (3, 3))
"""Of Mitsuba's matrix from the crop window to the camera: all that matter at z = 0."""


class ReplayCamera(NamedTuple):
    """The camera as Mitsuba has it."""

    entries: NDArray[np.float32]  # (6,) see `ENTRIES`
    window: NDArray[np.float32]  # (3, 2) place in the window = (a * film position + b) + c
    to_world: NDArray[np.float32]  # (12, 1) rows
    near: float


def replay_camera(
    camera: PerspectiveCamera, measured: Sequence[float] | None
) -> ReplayCamera:
    """Return the camera of a replay.

    Parameters
    ----------
    camera : PerspectiveCamera
        As the file has it.
    measured : sequence of 6 floats, optional
        Mitsuba's own `ENTRIES`. An entry that is not ours up to rounding is not taken, so
        that the pictures show it.
    """
    film = camera.film
    size = np.array([film.width, film.height], np.float64)
    crop = np.array([film.crop_width, film.crop_height], np.float64)
    offset = np.array([film.crop_offset_x, film.crop_offset_y], np.float64)
    moved = np.array([camera.principal_point_offset_x, camera.principal_point_offset_y])
    half = np.tan(np.radians(camera.fov_x) / 2.0)
    half_sides = half * np.array([1.0, size[1] / size[0]])
    a = -2.0 * half_sides * crop / size
    b = half_sides * (1.0 - 2.0 * offset / size)
    ours = np.array([a[0], b[0], a[1], b[1], 1.0, 1.0 / camera.near_clip], np.float32)
    if measured is not None:
        theirs = np.asarray(measured, np.float32)
        scale = np.maximum(np.abs(ours), np.float32(half))
        ours = np.where(np.abs(theirs - ours) <= _SAME * scale, theirs, ours)
    one = np.float32(1.0) / crop.astype(np.float32)
    # ours begins `border` pixels before the film where samples lie beyond it
    shift = -(offset + film.border).astype(np.float32) * one
    return ReplayCamera(
        ours.astype(np.float32),
        np.array([one, shift, moved * size / crop], np.float32),
        np.ascontiguousarray(camera.to_world[:3].reshape(12, 1), np.float32),
        float(camera.near_clip),
    )


@kernel
def _direction(camera, px, py):
    """Return the direction in the camera's space for a place on the film in pixels."""
    w = camera.window
    x = fused_multiply_add(px, w[0, 0], w[1, 0]) + w[2, 0]
    y = fused_multiply_add(py, w[0, 1], w[1, 1]) + w[2, 1]
    m = camera.entries
    inverse = _ONE / m[5]
    return unit(
        vec3(
            fused_multiply_add(m[0], x, m[1]) * inverse,
            fused_multiply_add(m[2], y, m[3]) * inverse,
            m[4] * inverse,
        )
    )


@kernel
def round_camera_ray(camera, rays, k, px, py):
    """Round ray k, which goes through film position (px, py), unless it is another ray."""
    never_inline()
    local = _direction(camera, px, py)
    new = times_vector(camera.to_world, 0, 0, local)
    old = column(rays.direction, k)
    x, y, z = abs(new.x - old.x), abs(new.y - old.y), abs(new.z - old.z)
    if not (x <= _ROUNDING and y <= _ROUNDING and z <= _ROUNDING):
        return
    m = camera.to_world
    near = np.float32(camera.near) * (_ONE / local.z)
    origin = fused_sum(new, near, vec3(m[3, 0], m[7, 0], m[11, 0]))
    rays.direction[0, k], rays.direction[1, k] = new.x, new.y
    rays.direction[2, k] = new.z
    rays.origin[0, k], rays.origin[1, k] = origin.x, origin.y
    rays.origin[2, k] = origin.z


@method_kernel
def round_camera_rays(camera, rays, count, film):
    """Round the camera rays of a tile, which go through places on the film, by slot."""
    for k in range(count):
        slot = rays.slot[k]
        round_camera_ray(camera, rays, k, film[0, slot], film[1, slot])
