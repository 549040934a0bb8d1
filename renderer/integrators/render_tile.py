"""The render loop of one tile: for each sample, trace the pixels, add them to the film.

One entry for each integrator, so that only the one in use is compiled. The film is the
same at any number of threads: each random number depends on pixel, sample and dimension
alone, and a tile's samples are added in their order.
"""

from __future__ import annotations

from renderer.integrators.direct_samples import trace_direct_samples
from renderer.integrators.first_hit import CHANNELS, trace_first_hits
from renderer.integrators.path import trace_paths
from renderer.integrators.whitted import trace_ray_trees
from renderer.integrators.work import CHANNELS as WORK_CHANNELS
from renderer.integrators.work import trace_work
from renderer.jit import entry_kernel, kernel
from renderer.records.batch import CAPACITY
from renderer.stages.film import add_to_tile


@kernel
def _clear(radiance):
    for channel in range(radiance.shape[0]):
        for slot in range(CAPACITY):
            radiance[channel, slot] = 0.0


@entry_kernel
def render_paths(scene, rfilter, tile, first_sample, end_sample, work, sums, border):
    """Add samples first_sample .. end_sample - 1 of a tile to `sums`, by path tracing."""
    for sample in range(first_sample, end_sample):
        _clear(work.radiance)
        trace_paths(scene, tile, sample, work)
        add_to_tile(rfilter, tile, work.film, work.radiance, sums, border)


@entry_kernel
def render_direct_samples(
    scene, rfilter, tile, first_sample, end_sample, work, sums, border
):
    """Add samples first_sample .. end_sample - 1 of a tile to `sums`, by direct light."""
    for sample in range(first_sample, end_sample):
        _clear(work.radiance)
        trace_direct_samples(scene, tile, sample, work)
        add_to_tile(rfilter, tile, work.film, work.radiance, sums, border)


@entry_kernel
def render_ray_trees(scene, rfilter, tile, first_sample, end_sample, work, sums, border):
    """Add samples first_sample .. end_sample - 1 of a tile to `sums`, by ray trees."""
    for sample in range(first_sample, end_sample):
        _clear(work.radiance)
        trace_ray_trees(scene, tile, sample, work)
        add_to_tile(rfilter, tile, work.film, work.radiance, sums, border)


@entry_kernel
def render_first_hits(scene, rfilter, tile, first_sample, end_sample, work, sums, border):
    """Add samples first_sample .. end_sample - 1 of a tile's AOVs to `sums`."""
    for sample in range(first_sample, end_sample):
        _clear(work.radiance)
        trace_first_hits(scene, tile, sample, work)
        add_to_tile(rfilter, tile, work.film, work.radiance, sums, border)


@entry_kernel
def render_work(scene, rfilter, tile, first_sample, end_sample, work, sums, border):
    """Add the work of samples first_sample .. end_sample - 1 of a tile to `sums`."""
    for sample in range(first_sample, end_sample):
        _clear(work.radiance)
        trace_work(scene, tile, sample, work)
        add_to_tile(rfilter, tile, work.film, work.radiance, sums, border)


# loop of the plan -> (kernel, channels of the film)
RENDER_TILE = {
    "direct": (render_paths, 3),
    "direct-samples": (render_direct_samples, 3),
    "path": (render_paths, 3),
    "whitted": (render_ray_trees, 3),
    "depth": (render_first_hits, CHANNELS),
    "aov": (render_first_hits, CHANNELS),
    "work": (render_work, WORK_CHANNELS),
}
