"""The rungs that measure how fast a scene's noise falls with the number of samples.

They need further pictures, over a hundred a side: at doubling sample counts, with the
sampler `independent` instead of the file's, since the exponent is -0.5 for it alone. The
pictures have the *test* size of the scene: the exponent does not depend on the size.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.ladder import rungs_with_noise, rungs_without_noise
from mitsuba_ref.ladder.pictures_by_seed import SEED_STEP
from mitsuba_ref.ladder.preconditions import NotComparable, find_obstacle
from mitsuba_ref.our_renderer.picture import RenderOurs
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.records.results import Rung
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.statistics.convergence import measure_convergence

Array = NDArray[np.float32]

# Far from the seeds of the other rungs.
_FIRST_SEEDS = {"ours": 4_000_037, "Mitsuba": 5_000_011}


def convergence_seed(side: str, index: int) -> int:
    """Return the seed of picture `index` of "ours" or "Mitsuba"; each has its own."""
    return _FIRST_SEEDS[side] + SEED_STEP * index


def convergence_rungs(
    request: RenderRequest,
    files: Sequence[str],
    render_ours: RenderOurs,
    references: ReferenceCache,
    progress: Callable[[str], None] = lambda stage: None,
    *,
    deterministic: bool = False,
) -> list[Callable[[], Rung]]:
    """Return what makes the rung of each renderer; nothing is rendered before.

    Parameters
    ----------
    request
        The scene in the size in which to measure.
    files
        Every file that the scene reads.
    render_ours, references
        The two renderers.
    progress
        Told what is being done.
    deterministic
        The scene has no noise: one rung that says so.
    """
    if deterministic:
        return [rungs_without_noise.no_convergence]
    sides: dict[str, Callable[[RenderRequest], Array]] = {
        "ours": lambda asked: render_ours(asked).pixels,
        "Mitsuba": lambda asked: references.get(asked, files).pixels,
    }

    sound: list[Array] = []

    def rung_of(side: str) -> Callable[[], Rung]:
        return lambda: _rung(side, sides[side], request, progress, sound)

    return [rung_of(side) for side in sides]


def _rung(
    side: str,
    render: Callable[[RenderRequest], Array],
    request: RenderRequest,
    progress: Callable[[str], None],
    sound: list[Array],
) -> Rung:
    """Measure one side.

    Parameters
    ----------
    side, render, request, progress
        Of this side; the request is changed to each number of samples.
    sound
        A picture to be like, without a fault; empty at first. Both sides have it in
        common: a renderer whose pictures are all too small is in step with itself.

    Raises
    ------
    NotComparable
        For a picture of another size than the first one, or with NaN.
    """
    whose = "our renderer" if side == "ours" else side

    def picture(spp: int, index: int) -> Array:
        progress(f"{whose}, convergence at {spp} samples per pixel")
        seed = convergence_seed(side, index)
        at_spp = replace(request.with_spp(spp), seed=seed)
        pixels = render(replace(at_spp, box_filter=True, independent=True))
        if not sound:
            sound.append(np.zeros_like(pixels))
        like = sound[0]
        pair = ([pixels], [like] * 2) if side == "ours" else ([like], [pixels] * 2)
        obstacle = find_obstacle(*pair)
        if obstacle:
            at = f"convergence at {spp} samples per pixel, seed {seed}"
            raise NotComparable(replace(obstacle, what=f"{at}: {obstacle.what}"))
        return pixels

    return rungs_with_noise.exponent(measure_convergence(picture), side)
