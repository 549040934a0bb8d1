"""The ladder of tests as a check of a renderer: to the top, with eight seeds a side.

It draws our own random numbers, so it sees what a replay does not use, and it is what the
page "proof" shows of each scene. `make test` does not climb: it would take a minute.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.ladder.climb import climb
from mitsuba_ref.ladder.pictures_by_seed import reference_seed, seeded_pictures
from mitsuba_ref.mutations.rungs import (
    CLIMB,
    RUNS,
    WITHOUT_REPLAY,
    CountedRender,
    Rung,
)
from mitsuba_ref.records import results
from mitsuba_ref.records.options import scene_name, scene_request
from mitsuba_ref.records.proof_file import read_proof
from mitsuba_ref.records.request import FEWEST_SEEDS, RenderRequest
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.errors import MitsubaError

Arrays = dict[str, NDArray[np.float32]]

STILL = 2
"""Pictures of Mitsuba of a scene without noise: they show how far it agrees with itself."""

NOT_CLIMBED = {
    "smooth-lamp": "for the density of a mesh light Mitsuba takes the normal between the "
    "vertices, and is up to 11 % darker below the lamp; ours does so in a replay alone",
    "volpathmis": "Mitsuba's weights are wrong in the mean (docs/mitsuba-faults.md); ours "
    "has them in a replay alone",
}
"""Scenes on which the renderers differ by more than noise, for a known reason."""


def ladder(scene: Path, ours: CountedRender, references: ReferenceCache) -> Sequence[Rung]:
    """Climb the ladder of tests to the top at the scene's test size.

    Parameters
    ----------
    scene, ours, references
        As `rungs.comparison` takes them. A scene without noise has only the rungs without
        noise. A scene of `NOT_CLIMBED` has no rungs.

    Raises
    ------
    MitsubaError
        If Mitsuba cannot render the scene, which says nothing of ours.
    """
    if scene_name(scene) in NOT_CLIMBED:
        return []
    proof = read_proof(scene)
    request = scene_request(scene, proof, WITHOUT_REPLAY)
    still = bool(proof.deterministic)
    before, started = ours.compile_seconds, time.perf_counter()
    climbed: list[Rung] = []

    def tell(rung: results.Rung) -> None:
        compiled = ours.compile_seconds - before
        seconds = time.perf_counter() - started - compiled
        climbed.extend(_judged(rung, ours.spp, seconds, 1 if still else FEWEST_SEEDS))

    try:
        pictures = _pictures(request, ours, references, still)
    except MitsubaError:
        raise
    except Exception as error:  # whatever a defect brings about
        return [Rung(RUNS, True, f"ladder: {error}", ours.spp, 0.0)]
    climb(*pictures, still, to_the_top=True, tell=tell)
    return climbed


def _pictures(
    request: RenderRequest, ours: CountedRender, references: ReferenceCache, still: bool
) -> tuple[list[NDArray[np.float32]], list[NDArray[np.float32]], Arrays, Arrays]:
    """Return our pictures, Mitsuba's, our AOVs and Mitsuba's."""
    first, first_hits = ours(request), replace(request, kind="aovs", spp=None)
    theirs = [
        references.get(replace(request, seed=reference_seed(index)), first.files)
        for index in range(STILL)
    ]
    a, b = seeded_pictures(
        request, FEWEST_SEEDS, first, theirs, ours, references, deterministic=still
    )
    their_aovs = references.get(replace(first_hits, seed=0), first.files)
    return a, b, dict(ours(first_hits).arrays), dict(their_aovs.arrays)


def _judged(
    rung: results.Rung, spp: int | None, seconds: float, seeds: int
) -> Sequence[Rung]:
    """Return what a rung says as one of the matrix; nothing if it did not judge."""
    # A limit that nothing exceeds: "uniformity" where the renderers' noise differs.
    if rung.passed and rung.limit == np.inf:
        return []
    why = "" if rung.passed else rung.sentence
    name = CLIMB + rung.name
    if rung.name == "aovs":  # of rays through the centres of pixels: no seed
        return [Rung(name, not rung.passed, why, 1, seconds)]
    return [Rung(name, not rung.passed, why, spp, seconds, seeds)]
