"""Renderers that take turns: ours in this process, a variant of Mitsuba in its own."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np

import renderer
from mitsuba_ref.ladder.pictures_by_seed import SEED_STEP
from mitsuba_ref.speed.timed_mitsuba import TimedMitsuba
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


def warmed(contender: Contender, *counts: int) -> Contender:
    """Render at all sample counts that will be used; JIT variants compile for each."""
    for spp in counts:
        contender(0, spp)
    return contender
