"""Pictures without noise in double precision: the trees of rays of the simple renderer.

It follows every light and both sides of a glass, so that nothing is left to chance. It
shares the reader of scenes with the kernels, and nothing else.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.scene_file.description import ConstantLight, SceneDescription
from renderer.simple.camera import Vector, camera_ray
from renderer.simple.path_tracer import whitted_radiance
from renderer.simple.scene import Scene
from renderer.simple.shapes import Surface
from renderer.simple.sky import Sky

CENTRE = (0.5, 0.5, 0.5, 0.5)  # in the place of four random numbers


def true_pixels(
    description: SceneDescription, pixels: NDArray[np.int64], show: Callable[[str], None]
) -> Vector:
    """Return the radiance (n, 3) along the rays through the middles of pixels.

    Parameters
    ----------
    description
        Of integrator `direct`, `whitted`, or `aov` around one of them.
    pixels
        (n, 2) rows and columns of the crop window.
    show
        Called with what is being done.

    Raises
    ------
    SceneError
        For what the simple renderer lacks, and for light that needs chance.
    """
    of_file = description.integrator.nested or description.integrator
    integrator = dataclasses.replace(of_file, name="whitted", aovs=(), nested=None)
    scene = Scene(dataclasses.replace(description, integrator=integrator))
    if any(isinstance(light, Surface | ConstantLight | Sky) for light in scene.lights):
        raise SceneError(f"{description.source}: light from all sides has noise")
    film = description.camera.film
    radiance = np.zeros((len(pixels), 3))
    for index, (row, column) in enumerate(pixels.tolist()):
        if index % 100 == 0:
            show(f"truth, pixel {index + 1} of {len(pixels)}")
        x, y = film.crop_offset_x + column + 0.5, film.crop_offset_y + row + 0.5
        ray = camera_ray(description.camera, x, y, CENTRE[:2])
        radiance[index] = whitted_radiance(scene, ray, lambda _: CENTRE)
    return radiance
