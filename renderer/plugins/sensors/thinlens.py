"""Thin lens camera: the plane of focus is sharp, the rest is blurred [Potmesil1981].

The lens refracts all rays of one film position to one point of the plane of focus. That is
the point where the ray through the lens's centre, which is not refracted, hits the plane.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.vectors import column, dot, normalize
from renderer.plugins.sampling.numbers_and_warps import square_to_disk
from renderer.plugins.sensors.kind import CameraRay, SensorKind, camera_ray
from renderer.plugins.sensors.pinhole import pinhole, vector_column
from renderer.scene_file.description import ThinLensCamera
from renderer.scene_file.objects.sensors import read_fov_x, shared, without_scale

# Mitsuba replaces the radius 0 by this: half the distance from 1 to the next float32
_SMALLEST_RADIUS = 2.0**-24


class ThinLens(NamedTuple):
    """A lens around `origin`; rays meet at corner + x right + y down (pixels) in focus."""

    origin: NDArray[np.float32]  # (3, 1)
    left: NDArray[np.float32]  # (3, 1) from the lens's centre to its rim
    up: NDArray[np.float32]  # (3, 1) likewise
    # in the plane of focus, relative to the centre of the lens
    corner: NDArray[np.float32]  # (3, 1) pixel position (0, 0)
    right: NDArray[np.float32]  # (3, 1) one pixel further in x
    down: NDArray[np.float32]  # (3, 1) one pixel further in y
    forward: NDArray[np.float32]  # (3, 1) unit
    near: float
    far: float


def read(properties: Any) -> ThinLensCamera:
    """Read the properties of a file."""
    common = shared(properties)
    film = common["film"]
    if not properties.has("aperture_radius"):
        properties.fail("aperture_radius", "nothing", "the radius of the lens, above 0")
    radius = properties.number("aperture_radius", 0.0, at_least=0.0)
    if radius == 0.0:
        radius = _SMALLEST_RADIUS
        properties.reading.warn(
            properties.location,
            f'{properties.element}, property "aperture_radius": 0 is taken as {radius:g}; '
            'a "perspective" has none',
        )
    return ThinLensCamera(
        **common,
        to_world=without_scale(properties),
        fov_x=read_fov_x(properties, film.width / film.height),
        aperture_radius=radius,
        focus_distance=properties.number("focus_distance", common["far_clip"], above=0.0),
    )


def record(camera: ThinLensCamera) -> ThinLens:
    """Return the camera as its kernel uses it."""
    p = pinhole(camera)
    left, up, forward = (
        camera.to_world[:3, k] / np.linalg.norm(camera.to_world[:3, k]) for k in range(3)
    )
    lens = (p.o, left * camera.aperture_radius, up * camera.aperture_radius)
    plane = (v * camera.focus_distance for v in (p.corner(camera.film.border), p.x, p.y))
    vectors = (vector_column(v) for v in (*lens, *plane, forward))
    return ThinLens(*vectors, float(camera.near_clip), float(camera.far_clip))


@camera_ray.by(ThinLens)
@kernel
def _thin_lens_ray(camera, px, py, lens_x, lens_y):
    x, y = square_to_disk(lens_x, lens_y)
    on_lens = x * column(camera.left, 0) + y * column(camera.up, 0)
    in_focus = (
        column(camera.corner, 0)
        + px * column(camera.right, 0)
        + py * column(camera.down, 0)
    )
    direction = normalize(in_focus - on_lens)
    along = 1.0 / dot(direction, column(camera.forward, 0))
    near = np.float32(camera.near) * along
    origin = column(camera.origin, 0) + on_lens + direction * near
    return CameraRay(origin, direction, np.float32(camera.far) * along - near)


THIN_LENS = SensorKind("thinlens", ThinLensCamera, read, record, has_aperture=True)
