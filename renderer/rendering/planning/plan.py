"""`Plan`: what a render will do, and how many rays that is."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, NamedTuple

from renderer.accelerators.choice import USUAL_RAYS, RayCounts
from renderer.integrators.kind import Case, Decision, IntegratorKind
from renderer.integrators.registry import INTEGRATORS
from renderer.mitsuba_version import NEWEST, RULES
from renderer.process.names import REPLAY
from renderer.scene_file.description import Moments, Sampler, Sensor

# -------------------------------------------------------------------------- restriction
# What a simplified scene, or `direct` without light samples, leaves out of its paths.
#
# One of the two ways to find light can be left out, and the paths that are caustics. A
# scene in which that would change nothing is planned without the restriction.


class Restriction(NamedTuple):
    """How light is followed then."""

    decision: Decision
    strategy: str  # "both", "lights", "bsdfs"
    caustics: bool


def restrict(decision: Decision, case: Case, *, sampled_whole: bool) -> Restriction:
    """Return what is left of an integrator's decision.

    Parameters
    ----------
    decision, case
        The integrator's, and what it had to decide from.
    sampled_whole
        Light samples go wherever a light shines.
    """
    sampled = case.lights and case.smooth and decision.max_depth > 1
    weighed = sampled and case.extended and decision.follow
    strategy = case.requested.strategy
    if decision.method == "direct" and decision.light_samples == 0:
        strategy = "bsdfs"  # points and directions give no light then, as in Mitsuba
    if not (weighed if strategy == "lights" else sampled):
        strategy = "both"
    # camera, rough surface, mirror or glass, lamp: three segments
    possible = weighed and case.delta and decision.max_depth > 2
    caustics = case.requested.caustics or not possible
    last = decision.max_depth == 2 and not case.delta
    if strategy == "lights" and last and sampled_whole:
        # the second segment would look for lamps, in vain
        decision = dataclasses.replace(decision, follow=False)
    return Restriction(decision, strategy, caustics)


# ------------------------------------------------------------------------ expected rays
# How many rays a render is likely to trace, which decides what building may cost.

# Segments of a usual path: most leave the scene or end by roulette before any more.
_USUAL_DEPTH = 6


def expected_rays(
    camera: Sensor,
    spp: int,
    max_depth: int,
    lights: int,
    threads: int,
) -> RayCounts:
    """Estimate from the picture's size and the depth.

    Parameters
    ----------
    camera
        Whose film is rendered.
    spp
        Samples per pixel.
    max_depth
        Segments of a path; 1 where the first hit alone is looked at.
    lights
        Shadow rays of one point: 1, or all lights.
    threads
        That trace them.
    """
    paths = float(camera.film.crop_width * camera.film.crop_height * spp)
    if max_depth < 2:
        return RayCounts(paths, 0.0, threads)
    later = max(0, min(max_depth, _USUAL_DEPTH) - 2)
    return RayCounts(paths, paths * (lights + later * (1 + lights)), threads)


# --------------------------------------------------------------------------------- plan
# The plan: what will be done, as `make_plan` decides it and the kernels need it.


class RayOffset(NamedTuple):
    """Where new rays start, so as not to meet their surface again, and shadow rays end."""

    rounding: float  # off the surface by so many rounding errors of the position ...
    fixed: float  # ... plus this times (1 + its largest coordinate)
    light_gap: float  # a shadow ray leaves out this part of its length at its end


def offset_rule(name: str, version: str = NEWEST.version) -> RayOffset:
    """Return a rule by its name; of `mitsuba`, that of a version of Mitsuba.

    `tight` is right for scenes of millimetres and of kilometres alike. With Mitsuba's rule
    a tube of mirrors agrees with its picture to 6e-6 instead of 6e-2
    (docs/decisions/ray-offset.md).
    """
    if name == "tight":
        # At the silhouette of a sphere the distance to the light is uncertain by the root
        # of the rounding error (2.4e-4 of it), and the light must not shade itself. The
        # number is Mitsuba's, so that both take the same decisions.
        return RayOffset(64.0, 0.0, NEWEST.shadow_epsilon)
    rules = RULES[version]
    return RayOffset(0.0, rules.ray_epsilon, rules.shadow_epsilon)


# 16 samples of a pixel go together, if it has as many: a packet is one pixel then. 64 would
# have more light to keep than the second cache holds.
MOST_TOGETHER = 2
# Squares of a tile whose rays go together after the first hit: longer streams, and fuller
# groups of one BSDF. 16 squares, which leave the second cache, are 0.9 to 1.1 times as
# fast as 4.
MOST_SQUARES = 4
UNSTRATIFIED = ("independent", "sobol")  # samplers without a grid of strata
# So many times more light samples: what BSDF samples find that a light sample could have
# found as well then weighs 1e-30 of it, less than any rounding. The rest still weighs 1.
LIGHTS_ALONE = 1e15


@dataclass(frozen=True, kw_only=True)
class Plan(Decision):
    """What will be done. `lines` explains it; the other fields steer the kernels."""

    weigh: bool  # multiple importance sampling
    hide_emitters: bool
    transparent: bool  # samples that meet nothing but holes are black
    spp: int
    sampler: Sampler
    ray_offset: str = "tight"
    mitsuba_version: str = NEWEST.version  # whose rules count where Mitsuba's do
    light_choice: str = "importance"  # of one of several lights; or "uniform"
    replay: bool = False  # draw the random numbers that Mitsuba draws, in its order
    # of a replay of `volpathmis`: densities that weigh a path, of 3 colours or 1; else 0
    mis_densities: int = 0
    moments: Moments | None = None  # second moments, in addition to the picture
    strategy: str = "both"  # or "lights", "bsdfs": the one way to find light
    caustics: bool = True  # paths may be, if the scene has what it takes
    # An even sky is left to BSDF samples: no light sample is taken of it, nothing weighed.
    # A diffuse point that sees nothing else has no noise then, and no shadow ray.
    finds_sky: bool = False
    through_panes: bool = False  # panes refract light samples
    sky_by_place: bool = False  # light samples go to the sky that a place sees
    near_lamps: bool = False  # segments in fog that pass small lamps have one more point
    rays: RayCounts = USUAL_RAYS
    lines: tuple[str, ...] = ()

    @property
    def offset(self) -> RayOffset:
        """Where rays start and shadow rays end."""
        return offset_rule(self.ray_offset, self.mitsuba_version)

    @property
    def kind(self) -> IntegratorKind:
        """The integrator that runs."""
        return INTEGRATORS[self.method]

    @property
    def several(self) -> bool:
        """Whether a point takes more than one sample of its lights or its BSDF."""
        return max(self.light_samples, self.bsdf_samples) > 1

    @property
    def trace(self) -> Any:
        """The kernel of the method."""
        if self.through_panes:
            return self.kind.trace_through_panes
        if self.near_lamps:
            return self.kind.trace_near_lamps
        return self.kind.trace_several if self.several else self.kind.trace

    @property
    def name(self) -> str:
        """The method, and what makes its loop another one."""
        name = f"{self.method} with several samples" if self.several else self.method
        if self.through_panes:
            name = f"{self.method} through panes"
        if self.near_lamps:
            name = f"{self.method} near lamps"
        return name if self.moments is None else f"moments of {name}"

    @property
    def samples_lights(self) -> bool:
        """Whether lights are sampled at surface points."""
        return self.kind.sees_lights and self.max_depth > 1 and self.strategy != "bsdfs"

    @property
    def light_share(self) -> float:
        """Light samples for each BSDF sample: their densities count so many times."""
        if self.strategy == "lights":
            return LIGHTS_ALONE
        return self.light_samples / self.bsdf_samples if self.weigh else 1.0

    @property
    def by_importance(self) -> bool:
        """Whether a point chooses among lights by what each can give there."""
        one_of_them = self.samples_lights and not self.every_light
        return one_of_them and self.light_choice == "importance"

    @property
    def level(self) -> int:
        """4 ** level samples of a pixel are traced together (`Tile`)."""
        if self.replay or self.kind.splits or not self.kind.sees_lights:
            # A replay draws its numbers in order. In a tree of rays the order in which two
            # branches add their light depends on the others of the batch. And of AOVs and
            # counts there would be too much to keep.
            return 0
        level = MOST_TOGETHER
        while level and (
            4**level > self.spp
            # those together are of one grid of strata, which has a cell for each sample
            or (self.sampler.name not in UNSTRATIFIED and self.spp % 4**level)
        ):
            level -= 1
        return level

    def squares(self, level: int) -> int:
        """Return how many of the 4 ** level squares of a tile are traced together."""
        if self.several or self.kind.splits:
            return 1
        return min(MOST_SQUARES, 4**level)

    @property
    def sampler_name(self) -> str:
        """Name of the sampler, and whose numbers it draws."""
        return f"{REPLAY} {self.sampler.name}" if self.replay else self.sampler.name


def stratified_cells(sample_count: int) -> tuple[int, int]:
    """Return (columns, rows) of the grid for a number of samples, as square as possible."""
    root = int(sample_count**0.5 + 1e-9)
    for rows in range(root, 0, -1):
        if sample_count % rows == 0:
            return sample_count // rows, rows
    return sample_count, 1
