"""Path tracing on one screen, one ray at a time. Read this file first.

The radiance that leaves a point x in the direction w_o is the emission of x plus the
reflected radiance from all directions w_i, the rendering equation [Kajiya1986; Immel1986]:

    L_o(x, w_o) = L_e(x, w_o) + integral of f(x, w_i, w_o) L_i(x, w_i) cos(w_i) dw_i

L_i is the L_o of the first hit of the ray x(t) = x + t w_i. Monte Carlo replaces the
integral by one direction, sampled with density pdf(w_i): the mean of f L_i cos / pdf is the
integral. The nested integrals become a path.

Two older integrators follow below: direct light, and the ray tree through delta lobes. The
kernels of this renderer trace the same paths and trees, thousands at a time, in single
precision. Given the same random numbers both compute the same radiance
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

# Four numbers in [0, 1) for a pixel, sample and block. Block 0 is the place in the pixel,
# 1 + BLOCKS_PER_BOUNCE * bounce is the BSDF there, and the following blocks are the lights.
Numbers = Callable[[int, int, int], Sequence[float]]


def numpy_numbers(pixel: int, sample: int, block: int) -> Sequence[float]:
    """Draw from NumPy's default generator, with a seed per pixel, sample and block."""
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
    """Yield row, column and a radiance estimate, for all pixels `spp` times."""
    film, integrator = camera.film, INTEGRATORS[scene.integrator]
    pixels = list(np.ndindex(film.crop_height, film.crop_width))
    for sample, (row, column) in itertools.product(range(spp), pixels):
        x, y = film.crop_offset_x + column, film.crop_offset_y + row
        draw = partial(numbers, y * film.width + x, sample)
        dx, dy, _, _ = draw(0)
        u, v, _, _ = draw(BLOCKS_PER_BOUNCE)  # the lens position, if there is a lens
        ray = camera_ray(camera, x + dx, y + dy, (u, v))
        yield row, column, integrator(scene, ray, draw)


def path_radiance(scene: Scene, ray: Ray, draw: Draw) -> Vector:
    """Return an estimate of the radiance that arrives along a ray."""
    p, d, near, far = ray  # near and far apply to the first ray only
    radiance = np.zeros(3)
    throughput = np.ones(3)  # product of f cos / pdf along the path
    share = 1.0 / max(len(scene.lights), 1)  # probability of each light
    came_by: BsdfSample | None = None  # the BSDF sample that gave d; None: the camera
    only_holes = True  # the path has only passed through holes
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
            # Russian roulette [Arvo1990]: end a dim path, or raise its throughput. eta^2
            # undoes the scaling of radiance in glass, which is undone on leaving it.
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
    """Return the emission of the first hit and its reflected direct light [Appel1968].

    All lights are sampled there, and BSDF samples find lights with an extent too. MIS
    weights both techniques by density and number of samples [Veach1997, section 9.2.2].
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
    """Return the radiance along all branches of a ray tree [Whitted1980].

    A branch whose weight is below the cutoff in all colours is dropped [Hall1983].
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
    """Return the reflected light of one sample of a light, by its index: f L / pdf V cos.

    `share` is the number of light samples per BSDF sample, infinite if the BSDF is not
    sampled. A delta lobe gets no direct light from light samples.
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
    """Return whether a path through holes only ends here without hitting a light.

    Mitsuba's `path` makes such a sample transparent. It drops the light that was sampled at
    a partly opaque `mask`.
    """
    if scene.environment is not None:
        return False
    return hit is None or (last and not hit.surface.radiance)
