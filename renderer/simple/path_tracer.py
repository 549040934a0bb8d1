"""Path tracing on one screen, one ray at a time. Read this file first.

The light that leaves a point x in the direction w_o is what x emits, and what it reflects
of the light from all directions w_i, the rendering equation [Kajiya1986; Immel1986]:

    L_o(x, w_o) = L_e(x, w_o) + integral of f(x, w_i, w_o) L_i(x, w_i) cos(w_i) dw_i

L_i in turn is the L_o of the point that the ray x(t) = x + t w_i meets first. Monte Carlo
replaces the integral by one direction chosen with density pdf(w_i): f L_i cos / pdf has
the integral as its mean. So the integral in the integral in the integral becomes a path.

The kernels of this renderer walk the same paths, thousands at a time, in single precision.
Given the same random numbers both find the same light
(tests/integrators/test_simple_path_tracer.py).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from renderer.scene_file.description import Diffuse, SceneDescription, Sensor
from renderer.simple.camera import Ray, camera_ray
from renderer.simple.lights import pdf_light, power_heuristic, sample_light
from renderer.simple.scene import Scene, closest_hit, visible
from renderer.simple.surfaces.bsdfs import albedo, sample_bsdf
from renderer.simple.surfaces.surfaces import Hit
from renderer.simple.vectors import Vector

# four numbers in [0, 1) for the pixel, the sample, and the block: 0 is the place in the
# pixel, 1 + BLOCKS_PER_BOUNCE * bounce the BSDF there, the block after it the light
Numbers = Callable[[int, int, int], Sequence[float]]
BLOCKS_PER_BOUNCE = 1 << 20


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
    film = camera.film
    pixels = list(np.ndindex(film.crop_height, film.crop_width))
    for sample, (row, column) in itertools.product(range(spp), pixels):
        x, y = film.crop_offset_x + column, film.crop_offset_y + row
        draw = partial(numbers, y * film.width + x, sample)
        dx, dy, _, _ = draw(0)
        u, v, _, _ = draw(BLOCKS_PER_BOUNCE)  # the lens, if there is one
        ray = camera_ray(camera, x + dx, y + dy, (u, v))
        yield row, column, path_radiance(scene, ray, draw)


def path_radiance(scene: Scene, ray: Ray, draw: Callable[[int], Sequence[float]]) -> Vector:
    """Return an estimate of the light that arrives against the direction of a ray."""
    p, d, near, far = ray  # the camera's planes end the first ray alone
    radiance = np.zeros(3)
    throughput = np.ones(3)  # product of f cos / pdf along the path
    pdf = 0.0  # [1/sr] of d; 0: the camera, a mirror or glass chose it, with certainty
    before: Hit | None = None  # the surface point that the ray comes from
    eta = 1.0  # product of the relative indices of refraction
    for bounce in itertools.count() if scene.max_depth < 0 else range(scene.max_depth):
        block = 1 + BLOCKS_PER_BOUNCE * bounce
        hit = closest_hit(scene, p, d, near, far)
        radiance += throughput * emission(scene, p, hit, pdf, before)
        if hit is None or bounce + 1 == scene.max_depth:
            break
        radiance += throughput * direct_light(scene, hit, draw(block + 1))

        x, y, choice, roulette = draw(block)
        scattered = sample_bsdf(hit, x, y, choice)
        if scattered is None:
            break
        throughput = throughput * scattered.weight
        eta *= scattered.eta
        if bounce + 1 >= scene.rr_depth:
            # Russian roulette [Arvo1990]: a dim path ends, or stands for those that ended.
            # eta^2 undoes what radiance loses in glass and gains again on leaving it.
            survival = min(throughput.max() * eta**2, 0.95)
            if roulette >= survival:
                break
            throughput = throughput / survival
        if not throughput.any():
            break
        p, d, pdf, before = hit.x, scattered.wi, scattered.pdf, hit
        near, far = 0.0, np.inf
    return radiance


def emission(
    scene: Scene, p: Vector, hit: Hit | None, pdf: float, before: Hit | None
) -> Vector:
    """Return L_e of what a ray from p has met, as far as it counts for this way to it.

    `pdf` is that of the ray, 0 where no light was asked instead, at the point `before`; the
    sky is never asked.
    """
    light = scene.environment if hit is None else hit.light
    if light is None:
        return np.zeros(3)
    weight = 1.0
    if pdf > 0 and before is not None and light is not scene.environment:
        chosen = scene.choice.probability(
            before.x, before.normal, scene.lights.index(light)
        )
        weight = power_heuristic(pdf, pdf_light(light, p, hit) * chosen)
    return weight * np.array(light.radiance)


def direct_light(scene: Scene, hit: Hit, numbers: Sequence[float]) -> Vector:
    """Return the reflected light of one light, chosen by what it can give."""
    if not scene.lights:
        return np.zeros(3)
    *place, choice = numbers
    chosen = scene.choice.choose(hit.x, hit.normal, choice)
    probability = scene.choice.probability(hit.x, hit.normal, chosen)
    return light_of(scene, hit, chosen, place, probability) / probability


def light_of(
    scene: Scene, hit: Hit, light: int, place: Sequence[float], probability: float = 1.0
) -> Vector:
    """Return the reflected light of a place on a light, given by number: f L / pdf V cos.

    The light is asked with this probability, which the weight beside BSDF sampling needs. A
    mirror reflects a light only if the path meets it by itself.
    """
    if not isinstance(hit.bsdf, Diffuse):
        return np.zeros(3)
    sample = sample_light(scene.lights[light], hit.x, *place)
    cosine = float(sample.wi @ hit.normal)
    if cosine <= 0 or not visible(scene, hit.x, sample.wi, sample.distance):
        return np.zeros(3)
    f = albedo(hit.bsdf, hit) / np.pi  # Lambert [Lambert1760]
    pdf = sample.pdf * probability
    weight = power_heuristic(pdf, cosine / np.pi) if pdf > 0 else 1.0
    return f * cosine * sample.radiance * weight
