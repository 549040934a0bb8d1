"""What needs.json holds."""

from __future__ import annotations

from dataclasses import dataclass

from reports.records.circumstances import Circumstances

SCHEMA = 3


@dataclass(frozen=True, kw_only=True)
class Loss:
    """What one simplification, or several at once, take from the picture.

    All but `flip` and the times are relative to the mean of the full picture, or to its
    pixels (`error`); 0.01 is 1 %. Intervals are at 95 %, over seeds.
    """

    words: list[str]  # NAME=VALUE
    sentence: str
    mean: float  # difference of the means of the pictures
    mean_half_width: float
    tile: float  # the same for the tile with the largest
    tile_half_width: float  # for all tiles at once
    tiles_off: int  # tiles whose interval does not hold 0
    tiles: int
    error: float  # root of the mean relative squared difference, without the noise
    error_high: float  # upper end of its interval
    flip: float
    time: float  # over that of the full scene, the best of several turns
    # variance of the difference over that with independent seeds; None: there is no noise
    shared_variance: float | None
    noise: float | None  # variance over that of the full scene; None: that has none

    @property
    def exact(self) -> bool:
        """Whether both pictures are the same, bit for bit."""
        return self.error_high == 0.0 and self.tile == 0.0

    @property
    def cost(self) -> float:
        """Time for the same noise, over that of the full scene."""
        return self.time * (1.0 if self.noise is None else self.noise)


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A line of the plan about what it leaves out, and what loses nothing therefore."""

    text: str
    words: list[str]  # NAME=VALUE whose pictures are the same; []: none is about that
    at_its_word: bool  # so is that of the file's integrator as it stands, but for rounding


@dataclass(frozen=True, kw_only=True)
class SceneNeeds:
    """One scene."""

    scene: str
    size: list[int]  # width, height
    spp: int
    seeds: int
    tolerance: float
    seconds: float  # of a full picture
    losses: list[Loss]
    absent: list[str]  # words that the scene has nothing for: exactly 0, checked
    claims: list[Claim]  # of the plan: exactly 0, checked
    least: Loss | None  # None: nothing can be left out
    command: str
    content: str = ""  # hash of all files that the scene reads; "": not noted


@dataclass(frozen=True, kw_only=True)
class NeedsRecord(Circumstances):
    """What needs.json holds."""

    whole: bool  # no scene was refused, nobody interrupted
    scenes: list[SceneNeeds]
