"""`Plan`: all decisions about a render, and the expected number of rays."""

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
# Light samples or BSDF samples may be left out, and caustics. If that changes nothing for a
# scene, the plan has no restriction.


class Restriction(NamedTuple):
    """The restricted decision, strategy and caustics."""

    decision: Decision
    strategy: str  # "both", "lights", "bsdfs"
    caustics: bool


def restrict(decision: Decision, case: Case, *, sampled_whole: bool) -> Restriction:
    """Return an integrator's decision after the restrictions of the scene.

    Parameters
    ----------
    decision, case
        Of the integrator, and its inputs.
    sampled_whole
        Whether light samples cover all directions in which a light emits.
    """
    sampled = case.lights and case.smooth and decision.max_depth > 1
    weighed = sampled and case.extended and decision.follow
    strategy = case.requested.strategy
    if decision.method == "direct" and decision.light_samples == 0:
        strategy = "bsdfs"  # then point and directional lights give no light, as in Mitsuba
    if not (weighed if strategy == "lights" else sampled):
        strategy = "both"
    # shortest caustic: camera to rough surface, to delta lobe, to light: three segments
    possible = weighed and case.delta and decision.max_depth > 2
    caustics = case.requested.caustics or not possible
    last = decision.max_depth == 2 and not case.delta
    if strategy == "lights" and last and sampled_whole:
        # the second segment could only find lights, which count nothing here
        decision = dataclasses.replace(decision, follow=False)
    return Restriction(decision, strategy, caustics)


# ------------------------------------------------------------------------ expected rays
# Expected number of rays of a render; it decides how much time a build may take.

# Segments of a typical path: most paths leave the scene or end by roulette before.
_USUAL_DEPTH = 6


def expected_rays(
    camera: Sensor,
    spp: int,
    max_depth: int,
    lights: int,
    threads: int,
) -> RayCounts:
    """Estimate the number of rays from the size of the picture and the depth.

    Parameters
    ----------
    camera
        The camera with the film.
    spp
        Samples per pixel.
    max_depth
        Segments of a path; 1 if only the first hit is needed.
    lights
        Shadow rays per point: 1, or the number of lights.
    threads
        Number of threads that trace the rays.
    """
    paths = float(camera.film.crop_width * camera.film.crop_height * spp)
    if max_depth < 2:
        return RayCounts(paths, 0.0, threads)
    later = max(0, min(max_depth, _USUAL_DEPTH) - 2)
    return RayCounts(paths, paths * (lights + later * (1 + lights)), threads)


# --------------------------------------------------------------------------------- plan
# The plan: the decisions of `make_plan`, as the kernels need them.


class RayOffset(NamedTuple):
    """Offsets of ray origins (against self-intersection) and of ends of shadow rays."""

    rounding: float  # offset in units of the position's rounding error ...
    fixed: float  # ... plus this times (1 + its largest coordinate)
    light_gap: float  # fraction of a shadow ray that is left out at its end


def offset_rule(name: str, version: str = NEWEST.version) -> RayOffset:
    """Return an offset rule by name; `mitsuba` is that of a version of Mitsuba.

    `tight` is suitable for scenes of millimetres and of kilometres. With Mitsuba's rule a
    tube of mirrors agrees with Mitsuba's picture to 6e-6 instead of 6e-2
    (docs/decisions/ray-offset.md).
    """
    if name == "tight":
        # At the silhouette of a sphere, the relative error of the distance to the light is
        # the root of the rounding error (2.4e-4), and the light must not shadow itself. The
        # value is Mitsuba's, so that both renderers decide equally.
        return RayOffset(64.0, 0.0, NEWEST.shadow_epsilon)
    rules = RULES[version]
    return RayOffset(0.0, rules.ray_epsilon, rules.shadow_epsilon)


# 4 ** 2 = 16 samples of a pixel are traced together if possible: a packet is then one
# pixel. The film sums of 64 would exceed the second-level cache.
MOST_TOGETHER = 2
# Squares of a tile whose rays are traced together after the first hit: this gives longer
# ray streams and larger groups of one BSDF. 16 squares exceed the second-level cache and
# are 0.9 to 1.1 times as fast as 4.
MOST_SQUARES = 4
UNSTRATIFIED = ("independent", "sobol")  # samplers without a grid of strata
# Number of light samples in MIS weights for "lights alone": BSDF samples in directions that
# light samples cover then have a weight of about 1e-30. Elsewhere their weight remains 1.
LIGHTS_ALONE = 1e15


@dataclass(frozen=True, kw_only=True)
class Plan(Decision):
    """Decisions about a render. `lines` explains them; other fields control the kernels."""

    weigh: bool  # multiple importance sampling
    hide_emitters: bool
    transparent: bool  # paths that hit only surfaces with straight transmission are black
    spp: int
    sampler: Sampler
    ray_offset: str = "tight"
    mitsuba_version: str = NEWEST.version  # whose rules are used where they differ
    light_choice: str = "importance"  # selection of one of several lights; or "uniform"
    replay: bool = False  # use Mitsuba's random numbers, in its order
    # in a replay of `volpathmis`: number of pdfs in a path's MIS weights, 3 or 1; else 0
    mis_densities: int = 0
    moments: Moments | None = None  # second moments, in addition to the picture
    strategy: str = "both"  # or "lights", "bsdfs": only these samples
    caustics: bool = True  # whether caustic paths are included
    # A constant environment is found by BSDF samples alone, with weight 1. A diffuse point
    # that sees nothing else then has no noise, and needs no shadow ray.
    finds_sky: bool = False
    through_panes: bool = False  # panes refract light samples
    sky_by_place: bool = False  # sample the sky by its visibility at a position
    near_lamps: bool = False  # segments in fog near small lights have an additional point
    rays: RayCounts = USUAL_RAYS
    lines: tuple[str, ...] = ()

    @property
    def offset(self) -> RayOffset:
        """Offsets of ray origins and of the ends of shadow rays."""
        return offset_rule(self.ray_offset, self.mitsuba_version)

    @property
    def kind(self) -> IntegratorKind:
        """The integrator that is used."""
        return INTEGRATORS[self.method]

    @property
    def several(self) -> bool:
        """Whether a point takes more than one light sample or BSDF sample."""
        return max(self.light_samples, self.bsdf_samples) > 1

    @property
    def trace(self) -> Any:
        """The kernel of the integrator."""
        if self.through_panes:
            return self.kind.trace_through_panes
        if self.near_lamps:
            return self.kind.trace_near_lamps
        return self.kind.trace_several if self.several else self.kind.trace

    @property
    def name(self) -> str:
        """The integrator's name, and the options that change its loop."""
        name = f"{self.method} with several samples" if self.several else self.method
        if self.through_panes:
            name = f"{self.method} through panes"
        if self.near_lamps:
            name = f"{self.method} near lamps"
        return name if self.moments is None else f"moments of {name}"

    @property
    def samples_lights(self) -> bool:
        """Whether light samples are taken at surface points."""
        return self.kind.sees_lights and self.max_depth > 1 and self.strategy != "bsdfs"

    @property
    def light_share(self) -> float:
        """Light samples per BSDF sample: a factor of the light pdf in MIS weights."""
        if self.strategy == "lights":
            return LIGHTS_ALONE
        return self.light_samples / self.bsdf_samples if self.weigh else 1.0

    @property
    def by_importance(self) -> bool:
        """Whether lights are selected by their importance at a point."""
        one_of_them = self.samples_lights and not self.every_light
        return one_of_them and self.light_choice == "importance"

    @property
    def level(self) -> int:
        """4 ** level samples of a pixel are traced together (`Tile`)."""
        if self.replay or self.kind.splits or not self.kind.sees_lights:
            # A replay draws its numbers in order. In a ray tree the order in which two
            # branches add their light depends on the rest of the batch. AOVs and counts
            # would need too much memory.
            return 0
        level = MOST_TOGETHER
        while level and (
            4**level > self.spp
            # samples traced together belong to one grid of strata, with a cell for each
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
        """Name of the sampler, and the source of its random numbers."""
        return f"{REPLAY} {self.sampler.name}" if self.replay else self.sampler.name


def stratified_cells(sample_count: int) -> tuple[int, int]:
    """Return (columns, rows) of the grid for a number of samples, nearly square."""
    root = int(sample_count**0.5 + 1e-9)
    for rows in range(root, 0, -1):
        if sample_count % rows == 0:
            return sample_count // rows, rows
    return sample_count, 1
