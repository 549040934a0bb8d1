"""Path tracing on one screen, one ray at a time. Read this file first.

The light that leaves a point x in the direction w_o is what x emits, and what it reflects
of the light from all directions w_i, the rendering equation [Kajiya1986; Immel1986]:

    L_o(x, w_o) = L_e(x, w_o) + integral of f(x, w_i, w_o) L_i(x, w_i) cos(w_i) dw_i

L_i in turn is the L_o of the point that the ray x(t) = x + t w_i meets first. Monte Carlo
replaces the integral by one direction chosen with density pdf(w_i): f L_i cos / pdf has
the integral as its mean. So the integral in the integral in the integral becomes a path.

The two integrators before it stand below: direct light alone, and the tree of rays through
mirrors and glass. The kernels of this renderer walk the same paths and trees, thousands at
a time, in single precision. Given the same random numbers both find the same light
(tests/renderer/integrators/test_simple_path_tracer.py).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from renderer.scene_file.description import SceneDescription, Sensor
from renderer.simple.bsdfs import BsdfSample, Lobe
from renderer.simple.camera import Ray, Vector, camera_ray
from renderer.simple.lights import power_heuristic, sample_light
from renderer.simple.materials import Material
from renderer.simple.scene import (
    BLOCKS_PER_BOUNCE,
    Draw,
    Scene,
    closest_hit,
    emission,
    visible,
)
from renderer.simple.shapes import Hit
from renderer.simple.volume_path import volpath_radiance

# four numbers in [0, 1) for the pixel, the sample, and the block: 0 is the place in the
# pixel, 1 + BLOCKS_PER_BOUNCE * bounce the BSDF there, the blocks after it the lights
Numbers = Callable[[int, int, int], Sequence[float]]


def numpy_numbers(pixel: int, sample: int, block: int) -> Sequence[float]:
    """Draw from NumPy's default generator, started anew for each block."""
    return np.random.default_rng((pixel, sample, block)).random(4).tolist()


def render(
    description: SceneDescription, spp: int, numbers: Numbers = numpy_numbers
) -> Vector:
    """Return the crop window as (height, width, 3), linear sRGB: each pixel a mean."""
    camera = description.camera
    picture = np.zeros((camera.film.crop_height, camera.film.crop_width, 3))
    for row, column, radiance in estimates(Scene(description), camera, spp, numbers):
        picture[row, column] += radiance / spp
    return picture


def estimates(
    scene: Scene, camera: Sensor, spp: int, numbers: Numbers = numpy_numbers
) -> Iterator[tuple[int, int, Vector]]:
    """Give row, column and an estimate of the light there: of all pixels, `spp` times."""
    film, integrator = camera.film, INTEGRATORS[scene.integrator]
    pixels = list(np.ndindex(film.crop_height, film.crop_width))
    for sample, (row, column) in itertools.product(range(spp), pixels):
        x, y = film.crop_offset_x + column, film.crop_offset_y + row
        draw = partial(numbers, y * film.width + x, sample)
        dx, dy, _, _ = draw(0)
        u, v, _, _ = draw(BLOCKS_PER_BOUNCE)  # the lens, if there is one
        ray = camera_ray(camera, x + dx, y + dy, (u, v))
        yield row, column, integrator(scene, ray, draw)


def path_radiance(scene: Scene, ray: Ray, draw: Draw) -> Vector:
    """Return an estimate of the light that arrives against the direction of a ray."""
    p, d, near, far = ray  # the camera's planes end the first ray alone
    radiance = np.zeros(3)
    throughput = np.ones(3)  # product of f cos / pdf along the path
    share = 1.0 / max(len(scene.lights), 1)  # one light is sampled, each as often
    came_by: BsdfSample | None = None  # what chose d; None: the camera
    only_holes = True  # nothing but holes has been met
    eta = 1.0  # product of the relative indices of refraction
    for bounce in itertools.count() if scene.max_depth < 0 else range(scene.max_depth):
        block, last = 1 + BLOCKS_PER_BOUNCE * bounce, bounce + 1 == scene.max_depth
        hit = closest_hit(scene, p, d, near, far)
        radiance += throughput * emission(scene, p, d, hit, came_by, share)
        if only_holes and nothing_is_seen(scene, hit, last):
            return np.zeros(3)
        if hit is None or last:
            break
        material = Material(hit)
        *place, which = draw(block + 1)
        if scene.lights:
            light = int(which * len(scene.lights))
            reflected = light_of(scene, hit, material, light, place, share)
            radiance += throughput * reflected / share

        x, y, choice, roulette = draw(block)
        came_by = material.sample((x, y, choice))
        throughput = throughput * came_by.weight
        eta *= came_by.eta
        if bounce + 1 >= scene.rr_depth:
            # Russian roulette [Arvo1990]: a dim path ends, or stands for those that ended.
            # eta^2 undoes what radiance loses in glass and gains again on leaving it.
            survival = min(throughput.max() * eta**2, 0.95)
            if roulette >= survival:
                break
            throughput = throughput / survival
        if not throughput.any():
            break
        only_holes = only_holes and came_by.lobe is Lobe.STRAIGHT
        p, d, near, far = hit.x, came_by.wi, 0.0, np.inf
    return radiance


def direct_radiance(scene: Scene, ray: Ray, draw: Draw) -> Vector:
    """Return what the first surface emits, and reflects of the lights [Appel1968].

    All lights are sampled there. Directions that the BSDF samples find lights with an
    extent too. Each of the two ways is weighted by its density and number of samples
    [Veach1997, section 9.2.2].
    """
    p, d, near, far = ray
    if scene.max_depth < 1:
        return np.zeros(3)
    hit = closest_hit(scene, p, d, near, far)
    radiance = emission(scene, p, d, hit, None)
    if hit is None or scene.max_depth < 2:
        return radiance
    material, count = Material(hit), scene.bsdf_samples
    share = scene.emitter_samples / count if count > 0 else np.inf
    for k in range(scene.emitter_samples):
        block = 2 + BLOCKS_PER_BOUNCE * k
        reflected = light_of_all(scene, hit, material, draw, block, share)
        radiance = radiance + reflected / scene.emitter_samples
    for k in range(count):
        x, y, choice, _ = draw(1 + BLOCKS_PER_BOUNCE * k)
        scattered = material.sample((x, y, choice))
        if scattered.weight.any():
            found = closest_hit(scene, hit.x, scattered.wi, 0.0, np.inf)
            light = emission(scene, hit.x, scattered.wi, found, scattered, share)
            radiance = radiance + scattered.weight * light / count
    return radiance


def whitted_radiance(scene: Scene, ray: Ray, draw: Draw) -> Vector:
    """Return the light along all branches of a tree of rays [Whitted1980].

    A branch whose weight is below the cutoff in all colours is left out [Hall1983].
    """
    radiance = np.zeros(3)
    waiting = [(ray, np.ones(3), 0)]
    while waiting:
        (p, d, near, far), weight, depth = waiting.pop()
        if depth >= scene.max_depth:
            continue
        hit = closest_hit(scene, p, d, near, far)
        radiance += weight * emission(scene, p, d, hit, None)
        if hit is None or depth + 1 >= scene.max_depth:
            continue
        material, block = Material(hit), 2 + BLOCKS_PER_BOUNCE * depth
        radiance += weight * light_of_all(scene, hit, material, draw, block)
        for branch in material.branches():
            carried = weight * branch.weight
            if carried.max() >= scene.cutoff:
                waiting.append(((hit.x, branch.wi, 0.0, np.inf), carried, depth + 1))
    return radiance


INTEGRATORS = {
    "path": path_radiance,
    "direct": direct_radiance,
    "whitted": whitted_radiance,
    "volpath": volpath_radiance,
}


def light_of_all(
    scene: Scene,
    hit: Hit,
    material: Material,
    draw: Draw,
    block: int,
    share: float = np.inf,
) -> Vector:
    """Return the reflected light of all lights; light k is sampled with block + k."""
    radiance = np.zeros(3)
    for light in range(len(scene.lights)):
        *place, _ = draw(block + light)
        radiance += light_of(scene, hit, material, light, place, share)
    return radiance


def light_of(
    scene: Scene,
    hit: Hit,
    material: Material,
    light: int,
    place: Sequence[float],
    share: float,
) -> Vector:
    """Return the reflected light of a place on a light, given by number: f L / pdf V cos.

    `share` is the number of light samples for each sample of the BSDF, infinite where the
    BSDF is not sampled. A mirror reflects a light only if the path meets it.
    """
    sample = sample_light(scene.lights[light], hit.x, *place)
    if not sample.radiance.any():
        return np.zeros(3)
    f_cos, bsdf_pdf = material.eval_pdf(sample.wi)
    if not f_cos.any() or not visible(scene, hit.x, sample.wi, sample.distance):
        return np.zeros(3)
    weight = power_heuristic(sample.pdf * share, bsdf_pdf) if sample.pdf > 0 else 1.0
    return f_cos * sample.radiance * weight


def nothing_is_seen(scene: Scene, hit: Hit | None, last: bool) -> bool:
    """Return whether a path that has met holes alone ends here without meeting a light.

    Mitsuba's `path` takes such a sample for transparent. It drops the light that was
    sampled at the holes, where a `mask` reflects a part of it.
    """
    if scene.environment is not None:
        return False
    return hit is None or (last and not hit.surface.radiance)
