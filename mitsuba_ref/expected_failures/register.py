"""The register: what disagrees, by how much, why, and what would be an alarm."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

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


REGISTER = (
    ExpectedFailure(
        name="small triangles",
        what="Moeller-Trumbore with |determinant| > 1e-8: share of hits lost, edges 1e-4",
        measure=rounding.small_triangles_lost,
        measured=1.0,
        band=(0.99, 1.0),
        agreement=(0.0, 0.01),
        reason="A determinant goes with the square of the edges, a fixed bound does not.",
    ),
    ExpectedFailure(
        name="far spheres",
        what="b^2 - 4 a c in float32, unit sphere at 10^4: share of rays lost or misplaced",
        measure=rounding.far_spheres_wrong,
        measured=1.0,
        band=(0.95, 1.0),
        agreement=(0.0, 0.01),
        reason="b^2 and 4 a c are near 4e8, where float32 steps by 32; the radius is 1.",
    ),
    ExpectedFailure(
        name="single precision film",
        what="ten million times 0.1 in float32, over a million",
        measure=rounding.single_precision_sum,
        measured=1.087937,
        band=(1.087, 1.089),
        agreement=(0.999, 1.001),
        reason="The sum's steps grow past the summand's; our film adds in float64.",
    ),
    ExpectedFailure(
        name="fixed epsilon",
        what="new rays start 1e-3 off their surface: the smallest gap that is seen into",
        measure=functools.partial(offsets.smallest_gap, offsets.FIXED),
        measured=1e-3,
        band=(0.9e-3, 1.1e-3),
        agreement=(0.0, 1e-4),
        reason="An absolute length suits one size of scene. Ours resolves 2e-5 there.",
    ),
    ExpectedFailure(
        name="Mitsuba's epsilon",
        what="new rays start by the rule of Mitsuba: the smallest gap seen into",
        measure=functools.partial(offsets.smallest_gap, offsets.MITSUBA),
        measured=0.9e-4,
        band=(0.8e-4, 1.0e-4),
        agreement=(0.0, 0.5e-4),
        reason="1500 units of 1 + max|p|, and never less; used when Mitsuba is compared.",
    ),
    ExpectedFailure(
        name="tight offset on a large square",
        what="our own rule, pane 2000 wide: the smallest gap seen into, in its middle",
        measure=functools.partial(offsets.smallest_gap, offsets.TIGHT, half=1000.0),
        measured=0.0191,
        band=(0.018, 0.020),
        agreement=(0.0, 1e-3),
        reason="It follows the whole primitive's size; Mitsuba's the point's coordinates.",
    ),
    ExpectedFailure(
        name="tube of mirrors",
        what="tight ray offset against Mitsuba's, down three mirrors: relative RMSE",
        measure=offsets.tube_of_mirrors_changed,
        measured=0.0666,
        band=(0.03, 0.1),
        agreement=(0.0, 1e-4),
        reason="Each reflection moves the ray sideways by some of the offset.",
    ),
    ExpectedFailure(
        name="Embree's default mode",
        what="Mitsuba, from inside a closed mesh at points of edges: share of rays lost",
        measure=reference.edge_rays_lost,
        measured=0.0461,
        band=(0.01, 0.1),
        agreement=(0.0, 1e-3),
        reason="Edges are not shared exactly (issue 1149); the harness requests `robust`.",
    ),
    ExpectedFailure(
        name="Mitsuba's point light, sampled four times",
        what="Mitsuba, direct with emitter_samples 4 below a point light: E h^2 / I",
        measure=reference.point_light_sampled_often,
        measured=4.0,
        band=(3.99, 4.01),
        agreement=(0.99, 1.01),
        reason="Delta lights are not divided by the number of samples; ours samples once.",
    ),
    ExpectedFailure(
        name="Mitsuba's lamp with vertex normals",
        what="Mitsuba, small level lamp, vertex normals tilted by 45 degrees: E h^2 / L A",
        measure=reference.lamp_with_vertex_normals,
        measured=0.707,
        band=(0.70, 0.715),
        agreement=(0.99, 1.01),
        reason="Area becomes solid angle by the shading normal's cosine; ours gives 1.",
    ),
    ExpectedFailure(
        name="roulette of Mitsuba's volpathmis",
        what="Mitsuba, volpathmis with rr_depth 2: white mist under a sky of radiance 1",
        measure=volpathmis.white_mist_with_roulette,
        measured=0.9799,
        band=(0.975, 0.985),
        agreement=(0.997, 1.003),
        reason="Roulette is in one of two densities that weigh a path; ours gives 1.",
    ),
    ExpectedFailure(
        name="tinted panes of Mitsuba's volpathmis",
        what="Mitsuba, volpathmis: floor in a ball of panes, over what these let through",
        measure=volpathmis.floor_behind_a_tinted_pane,
        measured=1.1787,
        band=(1.16, 1.20),
        agreement=(0.99, 1.01),
        reason="The tint is in one of two throughputs that weigh a path; ours gives 1.",
    ),
    ExpectedFailure(
        name="clear lamps of Mitsuba's volpathmis",
        what="Mitsuba, volpathmis: white floor in a lamp of null under a sky of 1",
        measure=volpathmis.floor_in_a_clear_lamp,
        measured=1.173,
        band=(1.15, 1.19),
        agreement=(0.99, 1.01),
        reason="The lamp's density stays in what weighs the sky behind it; ours gives 1.",
    ),
    ExpectedFailure(
        name="single density of Mitsuba's volpathmis",
        what="Mitsuba, volpathmis without use_spectral_mis: red of a floor without green",
        measure=volpathmis.red_floor_by_one_density,
        measured=0.0,
        band=(0.0, 0.0),
        agreement=(0.99, 1.01),
        reason="A colour whose weight is 0 voids all three; ours gives 1.",
    ),
    ExpectedFailure(
        name="Mitsuba's coloured mist without spectral extinction",
        what="Mitsuba, volpathmis: blue behind what absorbs red, over exp(-sigma_t 2)",
        measure=volpathmis.blue_through_coloured_mist,
        measured=0.550,
        band=(0.53, 0.57),
        agreement=(0.99, 1.01),
        reason="All colours get the mean transmittance; ours does not look at the flag.",
    ),
    ExpectedFailure(
        name="caustic of a point light",
        what="path tracing below a glass ball: light with the ball, over without it",
        measure=light.caustic_of_a_point_light,
        measured=0.0,
        band=(0.0, 0.0),
        agreement=(0.5, math.inf),
        reason="Glass stops shadow rays, and no ray meets a point by chance.",
    ),
    ExpectedFailure(
        name="terminator of a coarse sphere",
        what="16 segments with vertex normals, where the cosine is below 0.2: RMSE",
        measure=light.terminator_band,
        measured=0.0360,
        band=(0.034, 0.038),
        agreement=(0.0, 0.01),
        reason="A facet that looks away from the light is dark whatever its normals say.",
    ),
    ExpectedFailure(
        name="teapot in a stadium",
        what="uniform grid, 5000 triangles in one cell: primitive tests per ray",
        measure=cost.stadium_tests_per_ray,
        measured=5002.0,
        band=(4500.0, 5100.0),
        agreement=(0.0, 200.0),
        reason="Cells are of one size: the field decides it, the ball fits in one.",
    ),
)
