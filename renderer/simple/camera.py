"""Vectors, frames, and camera rays."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.plugins.sensors.pinhole import pinhole
from renderer.scene_file.description import PerspectiveCamera, Sensor, ThinLensCamera

# ------------------------------------------------------------------------------ vectors
# Vectors, and maps from the unit square to disks, triangles and directions.
#
# A vector is a NumPy array of three numbers; `a @ b` is the dot product. The maps preserve
# area, so uniform points in the square become uniform points on the target.

Vector = NDArray[np.float64]


def normalize(v: Vector) -> Vector:
    """Return v / |v|."""
    return v / math.sqrt(v @ v)


def mix(a: Any, b: Any, t: float) -> Any:
    """Return the linear interpolation: a at t = 0, b at t = 1."""
    return (1.0 - t) * a + t * b


def orthonormal_basis(n: Vector) -> tuple[Vector, Vector]:
    """Return s, t that form a right-handed frame with the unit vector n [Duff2017]."""
    x, y, z = n
    sign = math.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    s = np.array([1.0 + sign * x * x * a, sign * b, -sign * x])
    return s, np.array([b, sign + y * y * a, -y])


def square_to_disk(x: float, y: float) -> tuple[float, float]:
    """Map [0, 1)^2 to the unit disk; concentric squares become circles [Shirley1997]."""
    a, b = 2.0 * x - 1.0, 2.0 * y - 1.0
    if abs(a) >= abs(b):
        radius, angle = a, math.pi / 4 * (b / a if a else 0.0)
    else:
        radius, angle = b, math.pi / 2 - math.pi / 4 * (a / b)
    return radius * math.cos(angle), radius * math.sin(angle)


def square_to_triangle(x: float, y: float) -> tuple[float, float]:
    """Map [0, 1)^2 to the triangle (0, 0), (1, 0), (0, 1)."""
    root = math.sqrt(1.0 - x)
    return 1.0 - root, root * y


def square_to_sphere(x: float, y: float) -> tuple[float, float, float]:
    """Map [0, 1)^2 to the unit sphere: z is uniform, since it divides area evenly."""
    z = 1.0 - 2.0 * y
    r = math.sqrt(1.0 - z * z)
    return r * math.cos(2 * math.pi * x), r * math.sin(2 * math.pi * x), z


def square_to_cosine_hemisphere(x: float, y: float) -> Vector:
    """Map [0, 1)^2 to the upper hemisphere with density cos / pi: the disk, lifted."""
    p, q = square_to_disk(x, y)
    return np.array([p, q, math.sqrt(max(1.0 - p * p - q * q, 0.0))])


# ------------------------------------------------------------------------------- camera
# Camera rays, x(t) = p + t d: the pinhole, the thin lens, and the orthographic camera.

Ray = tuple[Vector, Vector, float, float]


def camera_ray(camera: Sensor, x: float, y: float, lens: tuple[float, float]) -> Ray:
    """Return p, d, and t on the near and the far plane, for a film position.

    Parameters
    ----------
    camera
        The sensor of the scene file.
    x, y
        Film position, in pixels from its upper left corner.
    lens
        Two numbers in [0, 1) that choose a lens position; not used by a pinhole.
    """
    if not isinstance(camera, PerspectiveCamera):
        return _parallel_ray(camera, x, y)
    eye = pinhole(camera)
    through = eye.f + (x - eye.xres / 2) * eye.x + (y - eye.yres / 2) * eye.y
    p, d = eye.o, normalize(through)
    if isinstance(camera, ThinLensCamera):
        a, b = square_to_disk(*lens)
        radius = camera.aperture_radius
        shift = radius * a * normalize(-eye.x) + radius * b * normalize(-eye.y)
        p, d = p + shift, normalize(camera.focus_distance * through - shift)
    cosine = float(d @ normalize(camera.to_world[:3, 2]))
    return p, d, camera.near_clip / cosine, camera.far_clip / cosine


def _parallel_ray(camera: Sensor, x: float, y: float) -> Ray:
    film = camera.film
    half = film.width / 2  # local units per pixel, on both axes
    local = [1 - x / half, film.height / film.width - y / half, camera.near_clip, 1]
    p = (camera.to_world @ np.array(local))[:3]
    return p, normalize(camera.to_world[:3, 2]), 0.0, camera.far_clip - camera.near_clip
