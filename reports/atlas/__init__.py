"""The atlas of limits: which method fails under which stress, where, why, what instead.

Texts and boundaries are data, one TOML file a chapter. `reports.studies.limits` measures
them and `reports.pages.limits_page` draws them. A new case is a table in one of the files,
and for each method an entry in `MEASURES` of a module of the study; `PICTURES` has what a
failure looks like.
"""

from __future__ import annotations

import functools
import math
from pathlib import Path

import msgspec

CHAPTERS = ("numbers", "structures", "light", "comparing")


class Method(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One method under the stress of its case.

    What is measured is within the tolerance from the harmless end of the axis to `holds`,
    and out of it from `fails` on; the method gives way between them. `fails` may be below
    `holds`: then the harmless end is the right one.
    """

    title: str
    holds: float | None = None  # None: at all strengths of the case, and it has no `fails`
    fails: float | None = None
    tolerance: float | None = None  # None: that of the case


class Case(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One stress, and the methods that are put under it: one chart."""

    name: str
    title: str
    stress: str  # what the axis means
    measured: str  # what the curves are of
    strengths: tuple[float, ...]  # of the curves, growing
    tolerance: float
    why: str
    instead: str
    methods: dict[str, Method]  # by the name that cautions and documents refer to
    source: str = "measured here"
    caption: str = ""  # of the picture; "" if there is none
    slow: bool = False  # more than some seconds

    def tolerance_of(self, name: str) -> float:
        """Return the most that is measured of a method while it holds."""
        own = self.methods[name].tolerance
        return self.tolerance if own is None else own

    def holds(self, name: str) -> float:
        """Return the strength up to which a method holds."""
        own = self.methods[name].holds
        return self.strengths[-1] if own is None else own

    def expected(self, name: str, strength: float) -> bool | None:
        """Return whether a method holds at a strength; None between both sides."""
        holds, fails = self.holds(name), self.methods[name].fails
        if fails is None:
            return True
        side = math.copysign(1.0, fails - holds)
        if side * strength <= side * holds:
            return True
        return False if side * strength >= side * fails else None


class Chapter(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Cases that belong together."""

    title: str
    cases: tuple[Case, ...]


@functools.cache
def read_atlas() -> dict[str, Chapter]:
    """Return the chapters by name."""
    folder = Path(__file__).parent
    return {
        name: msgspec.toml.decode((folder / f"{name}.toml").read_bytes(), type=Chapter)
        for name in CHAPTERS
    }


def every_case() -> dict[str, Case]:
    """Return the cases of all chapters by name."""
    return {case.name: case for chapter in read_atlas().values() for case in chapter.cases}
