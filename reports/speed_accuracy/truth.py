"""Pictures without noise in double precision: the simple path tracer, all branches.

A path chooses one light and one side of a glass at random. Here its parts are asked for
each light and for both sides, so that what is left of the path tracer is a tree of rays
[Whitted1980] whose sum has no noise. It shares the reader of scenes with the kernels, and
nothing else.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.scene_file.description import (
    Conductor,
    ConstantLight,
    Dielectric,
    SceneDescription,
)
from renderer.simple.camera import Ray, camera_ray
from renderer.simple.path_tracer import emission, light_of
from renderer.simple.scene import Scene, closest_hit
from renderer.simple.surfaces.bsdfs import fresnel, sample_bsdf
from renderer.simple.surfaces.surfaces import Hit, Surface
from renderer.simple.vectors import Vector

CENTRE = (0.5, 0.5)


def true_pixels(
    description: SceneDescription, pixels: NDArray[np.int64], say: Callable[[str], None]
) -> Vector:
    """Return the radiance (n, 3) along the rays through the middles of pixels.

    Parameters
    ----------
    description
        Of integrator `direct`, `whitted`, or `aov` around one of them.
    pixels
        (n, 2) rows and columns of the crop window.
    say
        Is told how far it is.

    Raises
    ------
    SceneError
        For what the simple path tracer lacks, and for light that needs chance.
    """
    asked = description.integrator.nested or description.integrator
    integrator = dataclasses.replace(asked, name="path", aovs=(), nested=None)
    scene = Scene(dataclasses.replace(description, integrator=integrator))
    if any(isinstance(light, Surface | ConstantLight) for light in scene.lights):
        raise SceneError(f"{description.source}: light from all sides has noise")
    film = description.camera.film
    radiance = np.zeros((len(pixels), 3))
    for index, (row, column) in enumerate(pixels.tolist()):
        if index % 100 == 0:
            say(f"truth, pixel {index + 1} of {len(pixels)}")
        x, y = film.crop_offset_x + column + 0.5, film.crop_offset_y + row + 0.5
        ray = camera_ray(description.camera, x, y, CENTRE)
        radiance[index] = tree_radiance(scene, ray, asked.cutoff)
    return radiance


def tree_radiance(scene: Scene, ray: Ray, cutoff: float) -> Vector:
    """Return the light that arrives against the direction of a ray, by all ways.

    A branch whose weight is below `cutoff` in all colours is left out, as the integrator
    `whitted` says.
    """
    radiance = np.zeros(3)
    waiting = [(ray, np.ones(3), 1)]
    while waiting:
        (p, d, near, far), weight, depth = waiting.pop()
        hit = closest_hit(scene, p, d, near, far)
        radiance += weight * emission(scene, p, hit, 0.0, None)
        if hit is None or depth >= scene.max_depth:
            continue
        radiance += weight * light_of_all(scene, hit)
        for wi, share in branches(hit):
            if (weight * share).max() >= cutoff:
                waiting.append(((hit.x, wi, 0.0, np.inf), weight * share, depth + 1))
    return radiance


def light_of_all(scene: Scene, hit: Hit) -> Vector:
    """Return what a point reflects of every light."""
    lights = range(len(scene.lights))
    return sum((light_of(scene, hit, k, (0.5, 0.5, 0.5)) for k in lights), np.zeros(3))


def branches(hit: Hit) -> Iterator[tuple[Vector, Vector]]:
    """Yield the directions of perfect reflection and refraction, and their weights."""
    bsdf = hit.bsdf
    if isinstance(bsdf, Conductor) and (mirrored := sample_bsdf(hit, *CENTRE, 0.5)):
        yield mirrored.wi, mirrored.weight
    if isinstance(bsdf, Dielectric):
        eta = bsdf.eta if hit.front else 1.0 / bsdf.eta
        cosine = float(hit.wo @ hit.normal)
        total = 1.0 - cosine**2 >= eta**2  # nothing goes through
        reflected = 1.0 if total else float(fresnel(cosine, eta))
        # a choice of 0 is below any reflectance, one of 1 is not
        for choice, share in ((0.0, reflected), (1.0, 1.0 - reflected)):
            if share > 0.0 and (scattered := sample_bsdf(hit, *CENTRE, choice)):
                yield scattered.wi, share * scattered.weight
