"""The record speed_accuracy.json: seconds and errors of all contenders, scene by scene."""

from __future__ import annotations

import statistics
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated

from msgspec import Meta

from mitsuba_ref.records.other_programs import LOAD
from mitsuba_ref.statistics.equal_error import log_ratio_error, worth
from reports.records.circumstances import Circumstances
from reports.records.json_file import read_json, write_json

SCHEMA = 1
FILE = "speed_accuracy.json"
OURS = "lightproof"

Positive = Annotated[float, Meta(gt=0.0)]


@dataclass(frozen=True)
class Pictures:
    """The pictures of one contender with one number of samples."""

    spp: int  # per pixel, as many as the sampler's pattern makes of those asked for
    errors: Annotated[list[Positive], Meta(min_length=2)]  # relMSE, one a seed
    seconds: Annotated[list[Positive], Meta(min_length=2)]  # of the same

    @property
    def error(self) -> float:
        """The mean relMSE."""
        return statistics.fmean(self.errors)

    @property
    def time(self) -> float:
        """The median of the seconds."""
        return statistics.median(self.seconds)

    @property
    def worth(self) -> float:
        """1 / (relMSE x seconds)."""
        return worth(self.errors, self.seconds)


@dataclass(frozen=True)
class Curve:
    """One renderer with one method and one sampler."""

    renderer: str
    method: str  # the integrator
    sampler: str
    pictures: Annotated[list[Pictures], Meta(min_length=1)]  # a number of samples each

    @property
    def last(self) -> Pictures:
        """The pictures with most samples, by which contenders are compared."""
        return self.pictures[-1]


@dataclass(frozen=True)
class NoisyScene:
    """A scene with noise."""

    scene: str
    width: int
    height: int
    reference: str  # whose, and how many samples
    reference_error: float  # its own relMSE, which is in all others
    curves: Annotated[list[Curve], Meta(min_length=1)]
    unavailable: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse what cannot be compared seed by seed, and a scene without us."""
        steps = [step for one in self.curves for step in one.pictures]
        if len({len(part) for step in steps for part in (step.errors, step.seconds)}) > 1:
            raise ValueError(f"{self.scene}: not as many errors as seconds everywhere")
        if not any(one.renderer == OURS for one in self.curves):
            raise ValueError(f"{self.scene}: no curve of {OURS}")

    @property
    def best_peer(self) -> Curve | None:
        """The peer that is worth most, or None if there is no peer."""
        peers = [one for one in self.curves if one.renderer != OURS]
        return max(peers, key=lambda one: one.last.worth, default=None)

    @property
    def best_of_ours(self) -> Curve:
        """Our method and sampler that is worth most with the second most samples.

        By the pictures with most, which the ratios are of, the luckiest would be chosen,
        and its luck be in the ratio. They decide only where there are no others.
        """
        ours = [one for one in self.curves if one.renderer == OURS]
        return max(ours, key=lambda one: one.pictures[-2:][0].worth)

    def beside_best_peer(self, curve: Curve) -> tuple[float, float] | None:
        """Return how many times a curve is worth the best peer, and its error.

        The error is the standard error of the logarithm, from the scatter over seeds; that
        this peer is the best is taken as known. None if there is no peer.
        """
        peer = self.best_peer
        if peer is None:
            return None
        first, second = (
            [e * s for e, s in zip(one.last.errors, one.last.seconds, strict=True)]
            for one in (curve, peer)
        )
        return curve.last.worth / peer.last.worth, log_ratio_error(first, second)


@dataclass(frozen=True)
class NoiselessPicture:
    """A contender on a scene without noise."""

    renderer: str
    method: str
    structure: str  # the accelerator
    ray_offset: str
    numbers: str  # "own", or "replayed": Mitsuba's roundings step by step
    seconds: Annotated[list[Positive], Meta(min_length=1)]
    error: Annotated[
        float, Meta(ge=0.0)
    ]  # relative, as of noisy pictures: root mean square beside the truth
    pixels_off: int  # pixels that differ from the truth by more than 1 %

    @property
    def time(self) -> float:
        """The median of the seconds."""
        return statistics.median(self.seconds)


@dataclass(frozen=True)
class NoiselessScene:
    """A scene without noise."""

    scene: str
    width: int
    height: int
    pixels: int  # as many have a truth
    pictures: Annotated[list[NoiselessPicture], Meta(min_length=1)]
    different: list[str] = field(default_factory=list)  # structures with another picture
    unavailable: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse a scene without us."""
        if not any(one.renderer == OURS for one in self.pictures):
            raise ValueError(f"{self.scene}: no picture of {OURS}")


@dataclass(frozen=True, kw_only=True)
class SpeedAccuracy(Circumstances):
    """A whole speed_accuracy.json."""

    whole: bool  # of all scenes, in full
    spp: Annotated[list[int], Meta(min_length=1)]
    seeds: int
    threads: int  # of each renderer
    # of older files: processes that wanted a processor in the minute before it began, ...
    load: list[float] = field(default_factory=list)
    noisy: list[NoisyScene]
    noiseless: list[NoiselessScene]
    failed: dict[str, str] = field(default_factory=dict)  # scenes, and why

    def __post_init__(self) -> None:
        """Refuse a record of nothing."""
        if not (self.noisy or self.noiseless or self.failed):
            raise ValueError("holds no scene")


def read_speed_accuracy(path: Path) -> SpeedAccuracy:
    """Read and check the record; raise ReportError for what is wrong, and where."""
    record = read_json(path, SpeedAccuracy, SCHEMA)
    if not record.load:
        return record
    return replace(record, machine={**record.machine, LOAD: round(record.load[0], 2)})


def write_speed_accuracy(path: Path, record: SpeedAccuracy) -> None:
    """Write the record in one step."""
    write_json(path, record, SCHEMA)
