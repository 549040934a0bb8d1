"""A scene rendered with many seeds by both renderers, for the ladder of tests."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.ladder import rungs_without_noise
from mitsuba_ref.ladder.climb import climb
from mitsuba_ref.ladder.evidence import Evidence
from mitsuba_ref.ladder.evidence_maps import evidence
from mitsuba_ref.ladder.preconditions import (
    Incomparable,
    NotComparable,
    count_non_finite,
    find_obstacle,
)
from mitsuba_ref.our_renderer.picture import OurPicture, RenderOurs
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.records.results import Rung
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.render import Reference
from mitsuba_ref.statistics.samples import stack

Array = NDArray[np.float32]

# Far from any seed that a user gives: the same seed on both sides proves nothing.
FIRST_REFERENCE_SEED = 1_000_003

SEED_STEP = 61
"""How far apart the seeds of Mitsuba's pictures are.

Mitsuba gives each pixel a separate random stream. Their numbers start at the render's seed
times the pixels of the film, as though all blocks were full
(`renderer.replay.numbers`).
Pictures of neighbouring seeds therefore have streams in common, at other pixels: 22 % of
them at 48 x 48. A step of 61 is enough for films that fill a sixtieth of their blocks. It
is prime, since seeds count modulo 2^32 / pixels only.
"""


def reference_seed(index: int) -> int:
    """Return the seed of Mitsuba's picture `index`; no two share a random number."""
    return FIRST_REFERENCE_SEED + SEED_STEP * index


def climb_scene(
    found: Evidence,
    request: RenderRequest,
    seeds: int,
    ours: tuple[OurPicture, OurPicture],
    theirs: tuple[Sequence[Reference], Reference],
    render_ours: RenderOurs,
    references: ReferenceCache,
    progress: Callable[[str], None] = lambda stage: None,
    *,
    deterministic: bool = False,
    further: Sequence[Callable[[], Rung]] = (),
) -> tuple[Evidence, dict[str, Array]]:
    """Render what is missing of `seeds` pictures a side and climb the ladder.

    Parameters
    ----------
    found
        What is known of the scene.
    request
        Of our first picture.
    seeds
        Pictures of each renderer; a scene without noise needs no more than it has.
    ours
        Our first picture and our AOVs.
    theirs
        Mitsuba's first pictures, with seeds by `reference_seed`, and its AOVs.
    render_ours, references
        Where further pictures come from.
    progress
        Told what is being done.
    deterministic
        The scene has no noise.
    further
        What makes the rungs above those of `climb`.

    Returns
    -------
    The evidence with the rungs, and the arrays that show what they saw.

    Raises
    ------
    SceneError, MitsubaError
        When a renderer refuses the scene.

    Notes
    -----
    A picture of another size or with NaN has its own verdict (`find_obstacle`), even if it
    is the last one.
    """
    a, b = seeded_pictures(
        request,
        seeds,
        ours[0],
        theirs[0],
        render_ours,
        references,
        progress,
        deterministic=deterministic,
    )
    progress("the ladder of tests")
    aovs = ours[1].arrays, theirs[1].arrays
    obstacle = find_obstacle(a, b, *aovs)
    if obstacle:
        finite = count_non_finite(a, b) if found.finite.passed else found.finite
        lowest = rungs_without_noise.finite(a, b)
        return _ended(replace(found, finite=finite), [], lowest, obstacle), {}
    shown = {} if deterministic else evidence(stack(a), stack(b))
    rungs: list[Rung] = []
    try:
        climb(a, b, *aovs, deterministic, further=further, tell=rungs.append)
    except NotComparable as hindered:
        last = replace(rungs[-1], name="convergence")
        return _ended(found, rungs, last, hindered.obstacle), shown
    return replace(found, rungs=tuple(rungs)), shown


def _ended(
    found: Evidence, rungs: Sequence[Rung], last: Rung, obstacle: Incomparable
) -> Evidence:
    """Return the evidence with a climb that an obstacle ended at its last rung."""
    last = replace(last, passed=False, sentence=f"{obstacle.what}.")
    obstacle = replace(obstacle, rung=last.name)
    return replace(found, rungs=(*rungs, last), obstacles=(*found.obstacles, obstacle))


def seeded_pictures(
    request: RenderRequest,
    seeds: int,
    ours: OurPicture,
    theirs: Sequence[Reference],
    render_ours: RenderOurs,
    references: ReferenceCache,
    progress: Callable[[str], None] = lambda stage: None,
    *,
    deterministic: bool = False,
) -> tuple[list[Array], list[Array]]:
    """Return `seeds` pictures of ours and of Mitsuba, (H, W, 3) each; see `climb_scene`.

    Without noise they are the pictures that are there already.
    """
    a, b = [ours.pixels], [picture.pixels for picture in theirs]
    for index in range(1, 1 if deterministic else seeds):
        progress(f"our renderer, seed {index + 1} of {seeds}")
        a.append(render_ours(replace(request, seed=(request.seed + index) % 2**32)).pixels)
    for index in range(len(b), len(b) if deterministic else seeds):
        progress(f"Mitsuba, seed {index + 1} of {seeds}")
        seeded = replace(request, seed=reference_seed(index))
        b.append(references.get(seeded, ours.files).pixels)
    return a, b
