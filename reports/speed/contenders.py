"""Renderers that take turns: ours in this process, a variant of Mitsuba in its own."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

import renderer
from mitsuba_ref.ladder.pictures_by_seed import SEED_STEP
from mitsuba_ref.reference.errors import MitsubaError
from mitsuba_ref.speed.timed_mitsuba import TimedMitsuba
from reports.speed.section import REFERENCE
from reports.speed.turns import Contender, Render

OURS = "lightproof"
PEERS = {"mitsuba scalar_rgb": "scalar_rgb", "mitsuba llvm_ad_rgb": "llvm_ad_rgb"}


def ours(scene: Path, parameters: dict[str, str], threads: int, **ways: Any) -> Contender:
    """Return our renderer with a scene loaded; `ways` are arguments of `render`."""
    loaded = renderer.load_file(scene, **parameters)

    def render(seed: int, spp: int) -> Render:
        begin = time.perf_counter()
        image = np.asarray(
            renderer.render(loaded, spp=spp, seed=seed, threads=threads, **ways)
        )
        seconds = time.perf_counter() - begin
        red, green, blue = (float(v) for v in image.mean(axis=(0, 1), dtype=np.float64))
        return Render(seconds, (red, green, blue))

    return render


def theirs(peer: TimedMitsuba, sampler: str | None = None) -> Contender:
    """Return Mitsuba with its scene loaded; the sampler is the file's or one it has.

    Its neighbouring seeds share streams (docs/statistics.md), so these lie apart.
    """

    def render(seed: int, spp: int) -> Render:
        timed = peer.render(SEED_STEP * seed, spp, sampler=sampler)
        return Render(timed.seconds, timed.mean)

    return render


def load_all(
    stack: ExitStack,
    scene: Path,
    parameters: dict[str, str],
    threads: int,
    counts: Sequence[int],
    progress: Callable[[str], None],
    sampler: str | None = None,
    **ways: Any,
) -> tuple[dict[str, Contender], dict[str, str]]:
    """Load a scene in every renderer, and warm them all.

    Parameters
    ----------
    stack
        Ends the peers' processes.
    counts
        Samples per pixel that will be asked for.
    sampler
        Of all of them, instead of the file's.
    **ways
        Further arguments of our `render`.

    Returns
    -------
    contenders, unavailable
        By name, ours first; why a peer is not among them.

    Raises
    ------
    MitsubaError
        If `REFERENCE` cannot render the scene.
    """
    progress(f"loading {OURS}")
    mine = ours(scene, parameters, threads, sampler=sampler, **ways)
    contenders, unavailable = {OURS: warmed(mine, *counts)}, {}
    for name, variant in PEERS.items():
        progress(f"loading {name}")
        try:
            peer = stack.enter_context(
                TimedMitsuba(
                    variant, scene, parameters, threads, [sampler] if sampler else []
                )
            )
            contenders[name] = warmed(theirs(peer, sampler), *counts)
        except MitsubaError as error:
            if name == REFERENCE:
                raise
            unavailable[name] = str(error)
    return contenders, unavailable


def warmed(contender: Contender, *counts: int) -> Contender:
    """Render at all sample counts that will be used; JIT variants compile for each."""
    for spp in counts:
        contender(0, spp)
    return contender
