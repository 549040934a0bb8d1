"""How many rays a path needs: Mitsuba's path estimator walked by hand, counting.

Rays per second need a number of rays, and a renderer that counted while it is timed would
be slower for it. The count is a property of the scene and the estimator, so it is taken
apart, once, on a few thousand paths; it holds for every renderer that runs the same one.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_ref.reference.edited_scene import refuse_code
from mitsuba_ref.reference.errors import MitsubaError
from mitsuba_ref.reference.variant import load_mitsuba

# Russian roulette never keeps a path with more than this probability (path.cpp).
ROULETTE_CAP = 0.95


def mean_rays_per_path(
    path: Path,
    parameters: Mapping[str, str],
    *,
    max_depth: int,
    rr_depth: int,
    paths: int = 4096,
) -> float:
    """Return the mean number of camera, bounce and shadow rays of one path.

    Parameters
    ----------
    path
        Mitsuba 3 XML.
    parameters
        Values for the file's `$name`.
    max_depth, rr_depth
        Of the `path` integrator; -1 is no limit.
    paths
        How many paths to walk, through random places of the film.

    Raises
    ------
    MitsubaError
        When Mitsuba refuses the scene.
    """
    mi = load_mitsuba()
    try:
        refuse_code(path, parameters)
        scene = mi.load_file(str(path), **{k: str(v) for k, v in parameters.items()})
    except RuntimeError as error:
        raise MitsubaError("Mitsuba: " + " ".join(str(error).split())) from None
    sensor = scene.sensors()[0]
    random = np.random.default_rng(0)
    rays = 0
    for place in random.random((paths, 2)):
        ray, _ = sensor.sample_ray(0.0, 0.5, place.tolist(), [0.5, 0.5])
        rays += _rays_of(mi, scene, ray, random, max_depth, rr_depth)
    return rays / paths


def _rays_of(
    mi: Any,
    scene: Any,
    ray: Any,
    random: np.random.Generator,
    max_depth: int,
    rr_depth: int,
) -> int:
    context = mi.BSDFContext()
    throughput, eta, depth, rays = np.ones(3), 1.0, 0, 0
    while True:
        surface = scene.ray_intersect(ray)
        rays += 1
        if not surface.is_valid() or depth + 1 == max_depth:
            return rays
        bsdf = surface.bsdf(ray)
        if mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth):
            point = random.random(2).tolist()
            direction, _ = scene.sample_emitter_direction(surface, point, False)
            rays += direction.pdf != 0.0  # its visibility is tested
        chosen, weight = bsdf.sample(
            context, surface, random.random(), random.random(2).tolist()
        )
        throughput = throughput * np.array(weight)
        eta *= chosen.eta
        depth += 1
        if throughput.max() == 0.0:
            return rays
        if depth >= rr_depth:
            keep = min(throughput.max() * eta**2, ROULETTE_CAP)
            if random.random() >= keep:
                return rays
            throughput = throughput / keep
        ray = surface.spawn_ray(surface.to_world(chosen.wo))
