"""Perspective sensor: all rays come from one point."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.vectors import column, dot, normalize
from renderer.plugins.sensors.kind import CameraRay, SensorKind, camera_ray
from renderer.plugins.sensors.pinhole import pinhole, vector_column
from renderer.scene_file.description import PerspectiveCamera
from renderer.scene_file.objects.sensors import read_fov_x, shared, without_scale


class Perspective(NamedTuple):
    """A pinhole: rays from `origin` along corner + x right + y down, in pixels."""

    origin: NDArray[np.float32]  # (3, 1)
    corner: NDArray[np.float32]  # (3, 1) towards pixel position (0, 0)
    right: NDArray[np.float32]  # (3, 1) one pixel further in x
    down: NDArray[np.float32]  # (3, 1) one pixel further in y
    forward: NDArray[np.float32]  # (3, 1) unit
    near: float
    far: float


def read(properties: Any) -> PerspectiveCamera:
    """Read the properties of a file."""
    common = shared(properties)
    film = common["film"]
    properties.number("focus_distance", common["far_clip"])  # ignored: pinholes are sharp
    return PerspectiveCamera(
        **common,
        to_world=without_scale(properties),
        fov_x=read_fov_x(properties, film.width / film.height),
        principal_point_offset_x=properties.number("principal_point_offset_x", 0.0),
        principal_point_offset_y=properties.number("principal_point_offset_y", 0.0),
    )


def record(camera: PerspectiveCamera) -> Perspective:
    """Return the camera as its kernel uses it."""
    p = pinhole(camera)
    forward = camera.to_world[:3, 2] / np.linalg.norm(camera.to_world[:3, 2])
    vectors = (
        vector_column(v) for v in (p.o, p.corner(camera.film.border), p.x, p.y, forward)
    )
    return Perspective(*vectors, float(camera.near_clip), float(camera.far_clip))


@camera_ray.by(Perspective)
@kernel
def _perspective_ray(camera, px, py, lens_x, lens_y):
    direction = normalize(
        column(camera.corner, 0)
        + px * column(camera.right, 0)
        + py * column(camera.down, 0)
    )
    # clip to the near and the far plane
    along = 1.0 / dot(direction, column(camera.forward, 0))
    near = np.float32(camera.near) * along
    origin = column(camera.origin, 0) + direction * near
    return CameraRay(origin, direction, np.float32(camera.far) * along - near)


PERSPECTIVE = SensorKind("perspective", PerspectiveCamera, read, record)
