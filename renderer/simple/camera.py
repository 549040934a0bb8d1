"""Camera rays, x(t) = p + t d: the pinhole, the thin lens, and parallel rays."""

from __future__ import annotations

import numpy as np

from renderer.plugins.sensors.pinhole import pinhole
from renderer.scene_file.description import PerspectiveCamera, Sensor, ThinLensCamera
from renderer.simple.vectors import Vector, normalize, square_to_disk

Ray = tuple[Vector, Vector, float, float]


def camera_ray(camera: Sensor, x: float, y: float, lens: tuple[float, float]) -> Ray:
    """Return p, d, and t on the near and the far plane, for a place on the film.

    Parameters
    ----------
    camera
        One of the scene file.
    x, y
        Place on the film, in pixels from its upper left corner.
    lens
        Two numbers in [0, 1) that choose a place on the lens; a pinhole is a point.
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
    half = film.width / 2  # pixels to local units, on both axes
    local = [1 - x / half, film.height / film.width - y / half, camera.near_clip, 1]
    p = (camera.to_world @ np.array(local))[:3]
    return p, normalize(camera.to_world[:3, 2]), 0.0, camera.far_clip - camera.near_clip
