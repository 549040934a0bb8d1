"""The render loop of one tile: for each sample, trace the pixels, add them to the film."""

from __future__ import annotations

from typing import Any, NamedTuple

from numba.extending import overload

from renderer.batch import CAPACITY
from renderer.film import add_to_tile
from renderer.integrators.first_hit import CHANNELS, trace_first_hits
from renderer.integrators.path import trace_paths
from renderer.integrators.whitted import trace_ray_trees
from renderer.jit import entry_kernel, record_class


class PathMethod(NamedTuple):
    """Path tracing, or direct light as its shortest case."""

    channels: int = 3


class WhittedMethod(NamedTuple):
    """Trees of reflected and refracted rays."""

    channels: int = 3


class FirstHitMethod(NamedTuple):
    """Depth and AOVs."""

    channels: int = CHANNELS


_TRACE = {
    PathMethod: trace_paths,
    WhittedMethod: trace_ray_trees,
    FirstHitMethod: trace_first_hits,
}


def trace(method: Any, scene: Any, tile: Any, sample: int, work: Any) -> None:
    """Write one sample of each pixel of a tile to `work.radiance`."""
    raise TypeError("inside kernels only")


@overload(trace)
def _trace(method, scene, tile, sample, work):
    chosen = _TRACE.get(record_class(method))
    if chosen is None:
        return None
    return lambda method, scene, tile, sample, work: chosen(scene, tile, sample, work)


@entry_kernel
def render_tile(method, scene, rfilter, tile, first_sample, end_sample, work, sums, border):
    """Add samples first_sample .. end_sample - 1 of a tile to its sums.

    The film is the same at any number of threads, as each random number depends on
    pixel, sample and dimension alone.
    """
    for sample in range(first_sample, end_sample):
        for channel in range(work.radiance.shape[0]):
            for slot in range(CAPACITY):
                work.radiance[channel, slot] = 0.0
        trace(method, scene, tile, sample, work)
        add_to_tile(rfilter, scene, tile, sample, work.radiance, sums, border)
