"""The plan: no more than a scene needs, and why.

From what the file asks for and what the scene holds, `make_plan` takes the least method
that gives the same answer, and says so in words (`--explain`).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from renderer.accelerators.cost_model import USUAL_RAYS, RayCounts
from renderer.errors import NotReplayable, SceneError
from renderer.kinds.lights.registry import plugin_of
from renderer.names import INTEGRATORS, REPLAY, SAMPLERS
from renderer.rendering.planning.expected_rays import expected_rays
from renderer.rendering.planning.explanation import (
    Explanation,
    describe_integrator,
    explain_accelerators,
    explain_geometry,
    explain_materials_and_lights,
    explain_roulette,
    explain_samples,
    explain_weights,
)
from renderer.replay.refusals import check_replay
from renderer.scene.scene import Scene
from renderer.scene_file.description import (
    Integrator,
    Moments,
    Sampler,
)
from renderer.scene_file.objects.samplers import round_sample_count
from renderer.threads import default_threads

OF_MITSUBA = "those of Mitsuba's scalar variants, in their order"
# A new ray starts off its surface, so as not to meet it again: so many rounding errors of
# the position, plus this times (1 + its largest coordinate). `tight` is right for scenes of
# millimetres and of kilometres alike. `mitsuba` is the rule of Mitsuba 3.9.1 (1500 units in
# the last place): with it a tube of mirrors agrees to 6e-6 instead of 6e-2
# (docs/decisions/ray-offset.md).
RAY_OFFSETS = {"tight": (64.0, 0.0), "mitsuba": (0.0, 1500.0 * 2.0**-24)}
NO_LIMIT = 1 << 30
MOST_SAMPLES = 1 << 24  # per pixel, as in a file
WHITTED_DEPTH = 8  # where the file gives no limit: light caught in glass never leaves
DEEPEST_TREE = 256  # each depth of a ray tree has waiting rays of its own: 130 KB
COLOURS_OF_WORK = (
    "box tests and primitive tests per ray, from 0 (black) to the pixel with the most "
    "(pale yellow), whose number is printed with the picture and kept in its metadata"
)


@dataclass(frozen=True)
class Plan:
    """What will be done. `lines` explains it; the other fields steer the kernels."""

    method: str  # direct, whitted, path, depth, aov or work
    max_depth: int
    roulette_depth: int | None  # None: no Russian roulette
    weigh: bool  # multiple importance sampling
    mirrors: bool  # go on from mirrors and glass
    every_light: bool  # ask all lights at each point instead of one at random
    follow: bool  # go on from diffuse surfaces
    hide_emitters: bool
    cutoff: float
    spp: int
    sampler: Sampler
    ray_offset: str = "tight"
    replay: bool = False  # draw the random numbers that Mitsuba draws, in its order
    light_samples: int = 1  # of `direct`, at each point
    bsdf_samples: int = 1  # of `direct`, at each point
    moments: Moments | None = None  # second moments are asked for as well
    rays: RayCounts = USUAL_RAYS
    lines: tuple[str, ...] = ()

    @property
    def counts_work(self) -> bool:
        """Whether traversals count what they do."""
        return self.method == "work"

    @property
    def loop(self) -> str:
        """Name of the loop over the stages, in `RENDER_TILE`."""
        several = max(self.light_samples, self.bsdf_samples) > 1
        return "direct-samples" if several else self.method

    @property
    def name(self) -> str:
        """What is done, in words."""
        name = "direct with several samples" if self.loop == "direct-samples" else self.loop
        return name if self.moments is None else f"moments of {name}"

    @property
    def sees_lights(self) -> bool:
        """Whether paths gather light at all."""
        return self.method in ("direct", "path", "whitted")

    @property
    def asks_lights(self) -> bool:
        """Whether lights are sampled at surface points."""
        return self.sees_lights and self.max_depth > 1

    @property
    def sampler_name(self) -> str:
        """Name of the sampler, and whose numbers it draws."""
        return f"{REPLAY} {self.sampler.name}" if self.replay else self.sampler.name


def _has_extended_lights(scene: Scene) -> bool:
    shapes = any(shape.radiance is not None for shape in scene.description.shapes)
    environment = any(
        plugin_of(emitter).environment for emitter in scene.description.emitters
    )
    return shapes or environment


def _choose_integrator(scene: Scene, name: str | None) -> Integrator:
    asked = scene.description.integrator
    if name in (None, "auto", asked.name):
        if asked.refusal:
            raise SceneError(asked.refusal)
        return asked
    if name not in INTEGRATORS:
        known = ", ".join(INTEGRATORS)
        raise SceneError(f"integrator {name!r} is unknown; there are: {known}")
    if asked.refusal:  # nothing in it was read, so that the defaults count
        return Integrator(name)
    if name in ("aov", "work"):
        return dataclasses.replace(asked, name=name, aovs=(), nested=None, moments=None)
    return dataclasses.replace(asked, name=name, moments=None)


def _choose_sampler(scene: Scene, name: str | None) -> Sampler:
    asked = scene.description.camera.sampler
    if name in (None, asked.name, REPLAY):
        return asked
    if name not in SAMPLERS:
        known = ", ".join((*SAMPLERS, REPLAY))
        raise SceneError(f"sampler {name!r} is unknown; there are: {known}")
    return dataclasses.replace(asked, name=name, jitter=True)


def _with_sample_count(sampler: Sampler, asked: int) -> Sampler:
    """Return the sampler with the number that its pattern allows, as Mitsuba rounds it."""
    if not 1 <= asked <= MOST_SAMPLES:
        raise SceneError(f"spp is {asked}; 1 to {MOST_SAMPLES} are possible")
    count = round_sample_count(sampler.name, asked)
    return dataclasses.replace(sampler, sample_count=count)


def make_plan(
    scene: Scene,
    *,
    integrator: str | None = None,
    sampler: str | None = None,
    spp: int | None = None,
    accel: str | None = None,
    ray_offset: str | None = None,
    threads: int | None = None,
) -> Plan:
    """Decide how to render.

    Parameters
    ----------
    scene : Scene
        What is there.
    integrator : str, optional
        One of `INTEGRATORS`. None and "auto" take the least method that gives the answer
        which the file asks for; any other name is taken at its word.
    sampler : str, optional
        One of `SAMPLERS`; None takes the file's, `mitsuba` too but with the random numbers
        that Mitsuba's scalar variants draw, in their order.
    spp : int, optional
        Samples per pixel; None takes the file's. Rounded up to what the sampler's pattern
        allows, as in Mitsuba.
    accel : str, optional
        What `build_accelerators` will be asked for; it is explained here.
    ray_offset : str, optional
        One of `RAY_OFFSETS`: how far off their surface new rays start. None is `tight`, in
        a replay of Mitsuba its own.
    threads : int, optional
        That will trace; None is one for each core.

    Raises
    ------
    SceneError
        For a name that does not exist or a number of samples that is out of range.
    """
    plan = _decide(scene, integrator, sampler, spp)
    why = Explanation(list(plan.lines))
    emitting = sum(shape.radiance is not None for shape in scene.description.shapes)
    lights = emitting + len(scene.description.emitters) if plan.every_light else 1
    camera = scene.description.camera
    rays = expected_rays(
        camera, plan.method, plan.spp, plan.max_depth, lights, threads or default_threads()
    )
    explain_accelerators(scene, accel or "auto", rays, why)
    return dataclasses.replace(
        plan,
        ray_offset=_known_ray_offset(ray_offset, plan.replay),
        rays=rays,
        lines=tuple(why.lines),
    )


def _known_ray_offset(name: str | None, replay: bool) -> str:
    if name is None:
        return "mitsuba" if replay else "tight"
    if name not in RAY_OFFSETS:
        known = ", ".join(RAY_OFFSETS)
        raise SceneError(f"ray offset {name!r} is unknown; there are: {known}")
    return name


def _decide(
    scene: Scene, integrator: str | None, sampler: str | None, spp: int | None
) -> Plan:
    why = Explanation()
    asked = _choose_integrator(scene, integrator)
    replay = sampler == REPLAY
    # a leaner method gives the same answer, but not by the same paths, nor the same moments
    reduce = integrator in (None, "auto") and not replay and asked.moments is None
    chosen_sampler = _choose_sampler(scene, sampler)
    count = chosen_sampler.sample_count if spp is None else spp
    materials = scene.materials
    extended = _has_extended_lights(scene)
    lights = extended or bool(scene.description.emitters)
    if reduce and not lights and asked.name in ("direct", "whitted", "path"):
        count = 1  # the picture is black
        why.say("left out", "all samples but one per pixel: without a light nothing varies")
    chosen_sampler = _with_sample_count(chosen_sampler, count)
    mirrors = materials.delta
    method = asked.name
    depth = NO_LIMIT if asked.max_depth < 0 else asked.max_depth
    why.say("file asks", describe_integrator(asked))

    if method in ("depth", "aov"):
        why.say("method", f"{method}: the first hit alone; no light, no BSDF is sampled")
        return _first_hit_plan(scene, asked, chosen_sampler, count, why, replay=replay)
    if method == "work":
        if replay:
            raise NotReplayable(
                "sampler 'mitsuba': Mitsuba has no integrator that counts work; possible "
                "are path, direct, depth, aov and whitted"
            )
        why.say("method", "work: what camera rays cost; nothing is shaded")
        why.say("colours", COLOURS_OF_WORK)
        why.say("filter", "box, whatever the file asks for: counts stay in their pixel")
        return _first_hit_plan(scene, asked, chosen_sampler, count, why, replay=replay)

    if method == "direct":
        depth = min(depth, 2) if asked.max_depth >= 0 else 2
    if method == "whitted":
        depth = WHITTED_DEPTH if asked.max_depth < 0 else min(depth, DEEPEST_TREE)
        if depth != asked.max_depth:
            why.say(
                "depth", f"{depth}: a tree of rays needs a limit, and not too deep a one"
            )
    if reduce and method == "path" and depth <= 2:
        method = "direct"
        why.say("method", "direct: with max_depth <= 2 a path is direct light alone")
    elif reduce and method in ("path", "whitted") and not lights:
        method, depth = "direct", min(depth, 1)
        why.say("method", "direct, no bounces: without a light every path is black")
    elif method == "whitted" and reduce and not mirrors:
        depth = min(depth, 2)
        why.say("method", "whitted without recursion: there is no mirror and no glass")
    else:
        why.say("method", f"{method}, as asked for")

    light_samples = bsdf_samples = 1
    if method == "direct":
        light_samples, bsdf_samples = asked.emitter_samples, asked.bsdf_samples
        if max(light_samples, bsdf_samples) > 1 and reduce and not extended:
            light_samples, bsdf_samples = 1, min(bsdf_samples, 1)
            why.say("left out", "more samples at each point: no light has an extent")
        elif max(light_samples, bsdf_samples) > 1:
            each = "one of the lights" if replay else "each light"
            samples = f"{light_samples} of {each}, {bsdf_samples} of the BSDF"
            why.say("at each point", f"samples: {samples}")
    mirrors = mirrors and not (method == "direct" and asked.bsdf_samples == 0)
    if replay:
        check_replay(asked, method, extended)
        why.say("numbers", OF_MITSUBA)
    every_light = method == "whitted" or (
        method == "direct" and not replay and asked.moments is None
    )
    # BSDF samples look for lights only where lights can be hit
    follow = method == "path" or (
        method == "direct" and extended and asked.bsdf_samples > 0
    )
    if method == "path" and not materials.smooth:
        follow = False
    weigh = extended and follow and materials.smooth and depth > 1
    roulette = asked.rr_depth if method == "path" and asked.rr_depth < depth else None
    plan = Plan(
        method,
        depth,
        roulette,
        weigh,
        mirrors,
        every_light,
        follow,
        asked.hide_emitters,
        asked.cutoff if method == "whitted" else 0.0,
        chosen_sampler.sample_count,
        chosen_sampler,
        replay=replay,
        light_samples=light_samples,
        bsdf_samples=bsdf_samples,
        moments=asked.moments,
    )
    if plan.moments is not None:
        why.say("moments", "the means of the squares of single samples, as in Mitsuba")
    explain_weights(plan, scene, extended, why)
    explain_roulette(plan, asked, why)
    if method == "direct" and not mirrors and not follow and depth > 1:
        why.say("left out", "scattering: nothing is reflected towards another surface")
    explain_geometry(scene, why)
    explain_materials_and_lights(scene, why)
    random = _is_random(plan, extended, materials.chooses)
    explain_samples(chosen_sampler, count, random, why, replay=replay)
    return dataclasses.replace(plan, lines=tuple(why.lines))


def _first_hit_plan(
    scene: Scene,
    asked: Integrator,
    sampler: Sampler,
    count: int,
    why: Explanation,
    *,
    replay: bool,
) -> Plan:
    plan = Plan(
        method=asked.name,
        max_depth=1,
        roulette_depth=None,
        weigh=False,
        mirrors=False,
        every_light=False,
        follow=False,
        hide_emitters=asked.hide_emitters,
        cutoff=0.0,
        spp=sampler.sample_count,
        sampler=sampler,
        replay=replay,
        moments=asked.moments,
    )
    if replay:
        why.say("numbers", OF_MITSUBA)
    why.say("left out", "lights, shadow rays, bounces: the first hit alone is asked for")
    explain_geometry(scene, why)
    explain_samples(sampler, count, False, why, replay=replay)
    return dataclasses.replace(plan, lines=tuple(why.lines))


def _is_random(plan: Plan, extended: bool, glass: bool) -> bool:
    """Return whether more than the position in the pixel is drawn at random."""
    if plan.max_depth <= 1:
        return False
    if plan.method == "path" and plan.max_depth > 2:
        return True
    return extended or (plan.method == "direct" and glass)


def stratified_cells(sample_count: int) -> tuple[int, int]:
    """Return (columns, rows) of the grid for a number of samples, as square as possible."""
    root = int(sample_count**0.5 + 1e-9)
    for rows in range(root, 0, -1):
        if sample_count % rows == 0:
            return sample_count // rows, rows
    return sample_count, 1
