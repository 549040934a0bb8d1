"""The register: what disagrees, by how much, why, and what would be an alarm."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

from mitsuba_ref.expected_failures import (
    cost,
    light,
    offsets,
    reference,
    rounding,
    volpathmis,
)

Verdict = Literal["still disagrees", "ALARM: agrees now", "ALARM: another number"]
Band = tuple[float, float]


@dataclass(frozen=True)
class ExpectedFailure:
    """One known disagreement. Both bands include their ends, and they do not overlap."""

    name: str
    what: str  # the method that disagrees, and what its number is
    measure: Callable[[], float]
    measured: float  # when the entry was written
    band: Band  # around it: other machines, other orders of summation
    agreement: Band  # what the number would be if the method were right
    reason: str
    slow: bool = False


@dataclass(frozen=True)
class Outcome:
    """What one entry says today."""

    entry: ExpectedFailure
    measured: float
    verdict: Verdict

    @property
    def alarm(self) -> bool:
        """Whether someone has to look."""
        return self.verdict != "still disagrees"


def check(entry: ExpectedFailure) -> Outcome:
    """Measure one entry. What is no number is an alarm too."""
    measured = entry.measure()
    verdict: Verdict = "ALARM: another number"
    if _within(measured, entry.agreement):
        verdict = "ALARM: agrees now"
    elif _within(measured, entry.band):
        verdict = "still disagrees"
    return Outcome(entry, measured, verdict)


def _within(value: float, band: Band) -> bool:
    return band[0] <= value <= band[1]


MEASURES: dict[str, Callable[[], float]] = {
    "small triangles": rounding.small_triangles_lost,
    "far spheres": rounding.far_spheres_wrong,
    "single precision film": rounding.single_precision_sum,
    "fixed epsilon": partial(offsets.smallest_gap, offsets.FIXED),
    "Mitsuba's epsilon": partial(offsets.smallest_gap, offsets.MITSUBA),
    "tight offset on a large square": partial(
        offsets.smallest_gap, offsets.TIGHT, half=1000.0
    ),
    "tube of mirrors": offsets.tube_of_mirrors_changed,
    "Embree's default mode": reference.edge_rays_lost,
    "Mitsuba's point light, sampled four times": reference.point_light_sampled_often,
    "Mitsuba's lamp with vertex normals": reference.lamp_with_vertex_normals,
    "roulette of Mitsuba's volpathmis": volpathmis.white_mist_with_roulette,
    "tinted panes of Mitsuba's volpathmis": volpathmis.floor_behind_a_tinted_pane,
    "clear lamps of Mitsuba's volpathmis": volpathmis.floor_in_a_clear_lamp,
    "single density of Mitsuba's volpathmis": volpathmis.red_floor_by_one_density,
    "Mitsuba's coloured mist without spectral extinction": volpathmis.blue_in_coloured_mist,
    "caustic of a point light": light.caustic_of_a_point_light,
    "terminator of a coarse sphere": light.terminator_band,
    "teapot in a stadium": cost.stadium_tests_per_ray,
}
"""By the names of register.toml."""


def _entry(name: str, row: dict[str, Any]) -> ExpectedFailure:
    bands = {key: tuple(row[key]) for key in ("band", "agreement")}
    return ExpectedFailure(name, measure=MEASURES[name], **{**row, **bands})


_TABLE = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
REGISTER = tuple(_entry(name, row) for name, row in _TABLE.items())
