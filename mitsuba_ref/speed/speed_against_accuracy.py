"""Speed against accuracy: seconds and RMSE over doubling sample counts.

Both renderers take each rung in turn, warm, with equal numbers of workers, in one run;
nothing here comes from the cache but the reference that both are measured against: the
mean of Mitsuba's pictures that a comparison has anyway. The rungs end at half of the
samples of one of these, so that four of them have eight times as many as the last rung.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.metrics import distances
from mitsuba_ref.our_renderer.picture import RenderOurs
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.records.results import Ladder, LadderPoint
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.render import Reference

RUNGS = 5
OURS = "lightproof"
MITSUBA = "mitsuba scalar_rgb"

LADDER_SEED = 2_000_003


def measure_ladder(
    request: RenderRequest,
    pictures: Sequence[Reference],
    render_ours: RenderOurs,
    references: ReferenceCache,
    progress: Callable[[str], None] = lambda stage: None,
) -> Ladder:
    """Measure both renderers at half, a quarter, ... of the samples, smallest first.

    Parameters
    ----------
    request
        As the scene was compared; half of its samples are the top rung.
    pictures
        Mitsuba's, of as many seeds as there are; their mean is the reference.
    render_ours, references
        The two renderers.
    progress
        Told what is being done.
    """
    top = pictures[0].spp
    parts = [picture.pixels for picture in pictures]
    truth = np.asarray(np.mean(parts, axis=0, dtype=np.float64))
    # Of n parts with noise s, two are sqrt(2) s apart, and their mean is s / sqrt(n) off.
    squares = [distances.rmse(a, b) ** 2 for a, b in itertools.combinations(parts, 2)]
    noise = float(np.sqrt(np.mean(squares) / (2.0 * len(parts))))
    spp = top * len(parts)

    renderers = {OURS: _timed_ours(render_ours), MITSUBA: _timed_mitsuba(references)}
    points = []
    for index, samples in enumerate(rungs(top)):
        for name, render in renderers.items():
            progress(f"ladder: {name}, {samples} samples per pixel")
            rung = replace(request.with_spp(samples), seed=LADDER_SEED + index)
            if index == 0:
                render(rung)  # warm-up: imports, caches, compiled kernels
            pixels, seconds, used = render(rung)
            points.append(
                LadderPoint(
                    name,
                    used,
                    seconds,
                    distances.rmse(pixels, truth),
                    distances.trimmed_rmse(pixels, truth),
                )
            )
    note = (
        f"RMSE against Mitsuba at {spp} samples per pixel, whose own RMSE is about "
        f"{noise:.2g}; {request.threads} workers each, in turn, warm"
    )
    return Ladder(spp, note, tuple(points))


def rungs(top: int) -> list[int]:
    """Return up to five sample counts that double, the last one half of `top`."""
    counts = {max(1, top >> step) for step in range(1, RUNGS + 1)}
    return sorted(counts)


Render = Callable[[RenderRequest], tuple[NDArray[np.float32], float, int]]


def _timed_ours(render_ours: RenderOurs) -> Render:
    def render(request: RenderRequest) -> tuple[NDArray[np.float32], float, int]:
        picture = render_ours(request)
        return picture.pixels, picture.seconds or 0.0, picture.spp

    return render


def _timed_mitsuba(references: ReferenceCache) -> Render:
    def render(request: RenderRequest) -> tuple[NDArray[np.float32], float, int]:
        picture = references.render_uncached(request)
        return picture.pixels, picture.seconds, picture.spp

    return render
