"""The pinhole camera by the lecture's parameters: position o, focal vector f, up vector.

f points from o to the middle of the image plane. x and y span the plane to the right and
downwards, one pixel each; a pixel position (u, v) is seen along
f + (u - xres/2) x + (v - yres/2) y.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.vectors import column, dot, normalize
from renderer.plugins.sensors.kind import CameraRay, SensorKind, camera_ray
from renderer.scene_file.description import PerspectiveCamera
from renderer.scene_file.objects.sensors import read_fov_x, shared, without_scale


@dataclass(frozen=True, eq=False)
class Pinhole:
    """The lecture's camera; vectors are (3,) in world space."""

    o: NDArray[np.float64]  # position of the eye
    f: NDArray[np.float64]  # to the middle of the image plane, at unit distance
    up: NDArray[np.float64]  # unit, perpendicular to f
    x: NDArray[np.float64]  # one pixel to the right
    y: NDArray[np.float64]  # one pixel down
    xres: int
    yres: int

    def corner(self, border: int) -> NDArray[np.float64]:
        """Return the vector to the corner that lies `border` pixels beyond the film."""
        x, y = self.xres / 2.0 + border, self.yres / 2.0 + border
        return self.f - self.x * x - self.y * y


def pinhole(camera: PerspectiveCamera) -> Pinhole:
    """Return the lecture's parameters of a perspective camera of a scene file.

    The file's camera looks along local +z with +y up and +x to the *left*; its principal
    point offsets move the image by a fraction of the film's width and height.
    """
    film = camera.film
    left, up, forward = (
        camera.to_world[:3, k] / np.linalg.norm(camera.to_world[:3, k]) for k in range(3)
    )
    width = 2.0 * np.tan(np.radians(camera.fov_x) / 2.0)  # of the plane at distance 1
    x = -left * (width / film.width)
    y = -up * (width / film.width)  # pixels are square
    middle = (
        forward
        + x * (camera.principal_point_offset_x * film.width)
        + y * (camera.principal_point_offset_y * film.height)
    )
    return Pinhole(camera.to_world[:3, 3], middle, up, x, y, film.width, film.height)


def vector_column(vector: Any) -> NDArray[np.float32]:
    """Return a vector as kernels load it, (3, 1)."""
    return np.ascontiguousarray(np.reshape(vector, (3, 1)), np.float32)


# -------------------------------------------------------------------------- perspective
# Perspective sensor: all rays come from one point.


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
    properties.number("focus_distance", common["far_clip"])  # pinholes are sharp everywhere
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
    # the near plane cuts the ray's start, the far plane its end
    along = 1.0 / dot(direction, column(camera.forward, 0))
    near = np.float32(camera.near) * along
    origin = column(camera.origin, 0) + direction * near
    return CameraRay(origin, direction, np.float32(camera.far) * along - near)


PERSPECTIVE = SensorKind("perspective", PerspectiveCamera, read, record)
