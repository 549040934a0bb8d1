"""Who takes part: our renderer in many ways, Mitsuba's variants with their samplers.

A contender renders (seed, samples per pixel) into seconds and a picture. It is loaded when
it is made; who times it lets it render once before, so that nothing compiles then.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import renderer
from mitsuba_ref.ladder.pictures_by_seed import SEED_STEP
from mitsuba_ref.our_renderer.whole_picture import whole
from mitsuba_ref.records.proof_file import read_proof
from mitsuba_ref.speed.timed_mitsuba import TimedMitsuba
from renderer.process.names import SAMPLERS
from renderer.scene.scene import Scene
from reports.speed import turns

PEERS = ("scalar_rgb", "llvm_ad_rgb")
THEIR_SAMPLERS = ("independent", "stratified", "multijitter", "orthogonal", "ldsampler")
CHECK_SEEDS, CHECK_SPP = range(12), 16

Picture = NDArray[np.float64]  # (height, width, 3)
Shot = tuple[float, Picture]
Contender = Callable[[int, int], Shot]
Say = Callable[[str], None]


class Key(NamedTuple):
    """Which contender it is."""

    renderer: str
    method: str
    sampler: str

    def __str__(self) -> str:
        """Return it as a sentence names it."""
        return f"{self.renderer} {self.sampler}"


@dataclass(frozen=True)
class Settings:
    """How much is measured."""

    spp: Sequence[int] = (4, 16, 64)
    seeds: int = 5  # pictures of each contender at each number of samples
    reference: int = 2048  # samples of the reference, or a few more
    threads: int = 2  # workers of each renderer
    samplers: Sequence[str] = SAMPLERS  # ours
    full: bool = False  # the files' sizes, not those of proof.toml


def parameters_of(path: Path, settings: Settings, size: str) -> dict[str, str]:
    """Return the values for the file's width and height: those of a size of proof.toml."""
    found = None if settings.full else read_proof(path).size(size)
    return {} if found is None else found.parameters


def of_ours(scene: Scene, threads: int, **ways: Any) -> Contender:
    """Return our renderer with further arguments of `renderer.render`."""

    def render(seed: int, spp: int) -> Shot:
        begin = time.perf_counter()
        picture = np.asarray(whole(renderer.render(scene, spp, seed, threads, **ways)))
        return time.perf_counter() - begin, picture[..., :3].astype(np.float64)

    return render


def of_mitsuba(peer: TimedMitsuba, folder: Path, sampler: str | None) -> Contender:
    """Return a variant of Mitsuba with one of its samplers; pictures come as files.

    Its seeds are spread, since pictures of neighbouring ones share random numbers.
    """
    file = folder / "picture.npy"

    def render(seed: int, spp: int) -> Shot:
        seconds = peer.render(SEED_STEP * seed, spp, file, sampler).seconds
        return seconds, np.load(file).astype(np.float64)

    return render


def other_means(contenders: Mapping[Key, Contender], judge: Key) -> dict[Key, str]:
    """Return the contenders whose image mean is another than the judge's, and how far.

    A right contender is among them with a probability of `turns.ALPHA`; the seeds are
    fixed, so who passes today passes tomorrow. With 12 seeds a difference of 5 to 8
    standard errors is seen, by whose noise it is: where the judge has 1e-4 of the mean from
    seed to seed (`ball-and-sun`), 2e-4 of the mean.
    """

    def with_mean(contender: Contender) -> turns.Contender:
        @functools.cache  # the judge is asked again for each of the others
        def render(seed: int, spp: int) -> turns.Render:
            seconds, picture = contender(seed, spp)
            red, green, blue = (float(value) for value in picture.mean(axis=(0, 1)))
            return turns.Render(seconds, (red, green, blue))

        return render

    judged_by, found = with_mean(contenders[judge]), {}
    for key, contender in contenders.items():
        if key == judge:
            continue
        means = turns.compare_means(with_mean(contender), judged_by, CHECK_SEEDS, CHECK_SPP)
        if not means.passed:
            first, second, z = (
                ", ".join(f"{value:.4g}" for value in values)
                for values in (means.first, means.second, means.z)
            )
            found[key] = (
                f"image means of {key} ({first}) and of {judge} ({second}) are {z} "
                f"standard errors apart (limit {means.limit:.2g})"
            )
    return found
