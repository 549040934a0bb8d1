"""The record equal_error.json: errors and seconds of all contenders, scene by scene."""

from __future__ import annotations

from dataclasses import dataclass, field

from mitsuba_ref.statistics.equal_error import log_ratio_error, worth
from reports.records.circumstances import Circumstances

OURS = "lightproof"


@dataclass(frozen=True)
class Worth:
    """The pictures of one renderer with one sampler."""

    renderer: str
    sampler: str
    errors: list[float]  # relMSE, one a seed
    seconds: list[float]

    @property
    def value(self) -> float:
        """1 / (relMSE x seconds)."""
        return worth(self.errors, self.seconds)

    @property
    def products(self) -> list[float]:
        """The relMSE x seconds of each seed."""
        return [e * s for e, s in zip(self.errors, self.seconds, strict=True)]


@dataclass(frozen=True)
class SceneWorth:
    """One scene."""

    scene: str
    width: int
    height: int
    reference: str  # whose, and how many samples
    contenders: list[Worth]
    unavailable: dict[str, str] = field(default_factory=dict)

    @property
    def best(self) -> tuple[Worth, Worth]:
        """Our sampler that is worth most, and the one of all others."""
        ours = [one for one in self.contenders if one.renderer == OURS]
        theirs = [one for one in self.contenders if one.renderer != OURS]
        first, second = (max(some, key=lambda one: one.value) for some in (ours, theirs))
        return first, second

    @property
    def ratio(self) -> float:
        """Our best sampler's worth, divided by that of the best of all others."""
        ours, theirs = self.best
        return ours.value / theirs.value

    @property
    def log_error(self) -> float:
        """The standard error of the ratio's logarithm, from the scatter over seeds.

        That these two are the best is taken as known.
        """
        ours, theirs = self.best
        return log_ratio_error(ours.products, theirs.products)


@dataclass(frozen=True, kw_only=True)
class EqualError(Circumstances):
    """A whole equal_error.json."""

    spp: int
    seeds: int
    threads: int
    scenes: list[SceneWorth]
