"""Orthographic sensor: parallel rays.

The film's width covers [-1, 1] of the local x axis: a scale in `to_world` sets the size.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import splat_f32
from renderer.kernels.lanes.vectors import column, vec3
from renderer.plugins.sensors.kind import CameraRay, SensorKind, camera_ray
from renderer.plugins.sensors.pinhole import vector_column
from renderer.scene_file.coordinate_limits import FARTHEST
from renderer.scene_file.description import OrthographicCamera
from renderer.scene_file.objects.sensors import shared


class Orthographic(NamedTuple):
    """Rays along `forward` from corner + x right + y down, x and y in pixels."""

    corner: NDArray[np.float32]  # (3, 1) pixel position (0, 0) on the near plane
    right: NDArray[np.float32]  # (3, 1) one pixel further in x
    down: NDArray[np.float32]  # (3, 1) one pixel further in y
    forward: NDArray[np.float32]  # (3, 1) unit
    length: float  # from the near plane to the far one


def read(properties: Any) -> OrthographicCamera:
    """Read the properties of a file."""
    common = shared(properties)
    properties.number("focus_distance", common["far_clip"])  # ignored: everything is sharp
    camera = OrthographicCamera(**common, to_world=properties.transform("to_world"))
    # the corners of the far plane may be farther away than its centre
    if not np.abs(camera.to_world[:3]).sum(axis=1).max() * camera.far_clip < FARTHEST:
        properties.fail(
            "to_world",
            f"what makes the picture reach farther than {FARTHEST:g}",
            "coordinates that single precision can square; scale the scene down",
        )
    return camera


def axes(camera: OrthographicCamera) -> tuple[NDArray[np.float64], ...]:
    """Return corner, right and down as in `Orthographic`, in double precision."""
    left, up, forward, origin = camera.to_world[:3].T
    film = camera.film
    pixel = 2.0 / film.width  # on either axis: pixels are square
    corner = origin + left + up * (film.height / film.width) + forward * camera.near_clip
    corner += (left + up) * (pixel * film.border)  # the border may be sampled too
    return corner, -left * pixel, -up * pixel


def record(camera: OrthographicCamera) -> Orthographic:
    """Return the camera as its kernel uses it."""
    forward = camera.to_world[:3, 2] / np.linalg.norm(camera.to_world[:3, 2])
    vectors = (vector_column(v) for v in (*axes(camera), forward))
    # as in Mitsuba, a scale along z changes the near plane but not the visible depth
    return Orthographic(*vectors, float(camera.far_clip - camera.near_clip))


@camera_ray.by(Orthographic)
@kernel
def _orthographic_ray(camera, px, py, lens_x, lens_y):
    origin = (
        column(camera.corner, 0)
        + px * column(camera.right, 0)
        + py * column(camera.down, 0)
    )
    forward = column(camera.forward, 0)
    direction = vec3(splat_f32(forward.x), splat_f32(forward.y), splat_f32(forward.z))
    return CameraRay(origin, direction, splat_f32(np.float32(camera.length)))


ORTHOGRAPHIC = SensorKind("orthographic", OrthographicCamera, read, record)
