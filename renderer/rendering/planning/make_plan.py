"""Makes the plan: the cheapest method that gives the requested picture, and why.

`make_plan` uses the requests of the file and the options, and the contents of the scene. It
explains its decisions in words (`--explain`).
"""

from __future__ import annotations

import dataclasses

from renderer.errors import SceneError
from renderer.integrators.kind import Case
from renderer.integrators.path import DIM_UNDER_SKY
from renderer.integrators.registry import INTEGRATORS
from renderer.mitsuba_version import NEWEST, followed_version
from renderer.plugins.bsdfs.registry import reaches_all
from renderer.plugins.lights.registry import plugin_of
from renderer.process.names import REPLAY
from renderer.rendering.keywords import with_keywords
from renderer.rendering.planning.explanation import (
    Explanation,
    describe_integrator,
    explain_accelerators,
    explain_geometry,
    explain_light_choice,
    explain_materials_and_lights,
    explain_media,
    explain_roulette,
    explain_samples,
    explain_shadow_rays,
    explain_weights,
)
from renderer.rendering.planning.plan import Plan, expected_rays, restrict
from renderer.rendering.render_options import RenderOptions
from renderer.replay.replay_mode import check_replay
from renderer.scene.fog_lamps import fog_lamps
from renderer.scene.light_properties import (
    has_even_sky,
    has_extended_lights,
    has_lights_outside_their_samples,
)
from renderer.scene.scene import Scene
from renderer.scene_file.description import (
    EnvironmentMap,
    Integrator,
    Sampler,
    SunSky,
)
from renderer.scene_file.objects.films import round_sample_count

OF_MITSUBA = "those of the scalar variants of Mitsuba {}, in their order"


def _is_transparent(scene: Scene, requested: Integrator) -> bool:
    """Return whether paths that hit only surfaces with straight transmission are black.

    A rule of Mitsuba's `path`. Its `direct` does not have it, and shows lights behind holes
    even with `hide_emitters`.
    """
    if requested.name != "path":
        return False
    emitters = scene.description.emitters
    sky = any(plugin_of(emitter).environment for emitter in emitters)
    return scene.materials.straight and (requested.hide_emitters or not sky)


def _choose_integrator(scene: Scene, name: str | None) -> Integrator:
    requested = scene.description.integrator
    if name not in (None, "auto"):
        requested = dataclasses.replace(requested, mis_densities=0)
    if name in (None, "auto", requested.name):
        if requested.refusal:
            raise SceneError(requested.refusal)
        return requested
    if requested.refusal:
        inner = requested.nested or requested
        return Integrator(name, inner.max_depth, inner.rr_depth, inner.hide_emitters)
    return dataclasses.replace(requested, name=name, aovs=(), nested=None, moments=None)


def _choose_sampler(scene: Scene, name: str | None) -> Sampler:
    requested = scene.description.camera.sampler
    if name in (None, requested.name, REPLAY):
        return requested
    return dataclasses.replace(requested, name=name, jitter=True)


def _with_sample_count(sampler: Sampler, requested: int) -> Sampler:
    """Return the sampler with a supported number of samples, rounded as in Mitsuba."""
    count = round_sample_count(sampler.name, requested)
    return dataclasses.replace(sampler, sample_count=count)


def plan_with(scene: Scene, options: RenderOptions) -> Plan:
    """Return the plan of a render; only some of the options affect it.

    Parameters
    ----------
    scene : Scene
        The scene to render.
    {options}

    Raises
    ------
    SceneError
        If a name does not exist, or the number of samples is out of range.
    """
    choices = options.only("plan") | {
        "accel": options.accelerator,
        "threads": options.thread_count,
    }
    plan: Plan = scene.recently("plan", tuple(choices.values()), _make_plan, scene, options)
    return plan


make_plan = with_keywords(RenderOptions, plan_with, "make_plan")


def _make_plan(scene: Scene, options: RenderOptions) -> Plan:
    plan = _decide(scene, options)
    why = Explanation(list(plan.lines))
    emitting = sum(shape.radiance is not None for shape in scene.description.shapes)
    sampled = emitting + len(scene.description.emitters) - plan.finds_sky
    lights = max(1, sampled) if plan.every_light else 1  # or the ray to the sky
    camera = scene.description.camera
    explain_light_choice(plan, sampled, why)
    threads, accel = options.thread_count, options.accelerator
    rays = expected_rays(camera, plan.spp, plan.max_depth, lights, threads)
    explain_accelerators(scene, accel, rays, why)
    if plan.samples_lights and scene.materials.smooth and not plan.replay:
        explain_shadow_rays(scene, accel, rays, plan.finds_sky, plan.offset[:2], why)
    return dataclasses.replace(plan, rays=rays, lines=tuple(why.lines))


def _light_choice(name: str | None, replay: bool, as_mitsuba: bool) -> str:
    if replay and name == "importance":
        raise SceneError("light choice 'importance': a replay takes Mitsuba's, 'uniform'")
    return name or ("uniform" if as_mitsuba else "importance")


def _decide(scene: Scene, options: RenderOptions) -> Plan:
    why = Explanation()
    requested = _choose_integrator(scene, options.integrator)
    replay = options.sampler == REPLAY
    offset = options.ray_offset or ("mitsuba" if replay else "tight")
    version = NEWEST.version
    if replay or offset == "mitsuba":
        version = options.mitsuba_version or followed_version()
    transparent = _is_transparent(scene, requested)
    # At a surface with smooth lobes and straight transmission, Mitsuba loses the light
    # sample if the path goes straight on. The lost fraction depends on the pdfs of its
    # selection.
    loses_light = transparent and scene.materials.half_open
    as_mitsuba = replay or loses_light or requested.moments is not None
    choice = _light_choice(options.light_choice, replay, as_mitsuba)
    # a cheaper method has the same expected picture, but other paths and moments
    automatic = options.integrator in (None, "auto")
    reduce = automatic and not replay and requested.moments is None
    chosen_sampler = _choose_sampler(scene, options.sampler)
    count = chosen_sampler.sample_count if options.spp is None else options.spp
    materials = scene.materials
    extended = has_extended_lights(scene.description)
    lights = extended or bool(scene.description.emitters)
    if reduce and not lights and INTEGRATORS[requested.name].sees_lights:
        count = 1  # the picture is black: one sample suffices
        why.say("left out", "all samples but one per pixel: without a light nothing varies")
    chosen_sampler = _with_sample_count(chosen_sampler, count)
    why.say("file says", describe_integrator(requested))
    media = scene.description.has_media and INTEGRATORS[requested.name].media
    case = Case(
        requested,
        reduce,
        replay,
        lights,
        extended,
        materials.delta,
        materials.smooth or media,
        materials.chooses,
        transparent,
        media,
        materials.straight,
    )
    decision = INTEGRATORS[requested.name].decide(case, why.say)
    if INTEGRATORS[decision.method].media:  # uses both light samples and BSDF samples
        both = dataclasses.replace(requested, strategy="both", caustics=True)
        case = case._replace(requested=both)
    sampled_whole = not has_lights_outside_their_samples(scene.description)
    restriction = restrict(decision, case, sampled_whole=sampled_whole)
    decision = restriction.decision
    if replay:
        check_replay(requested, decision.method, extended)
        why.say("numbers", OF_MITSUBA.format(version))
    depth = decision.max_depth
    strategy, finds_sky = restriction.strategy, False
    if choice == "importance" and decision.follow and materials.smooth and depth > 1:
        finds_sky = (
            has_even_sky(scene.description)
            and not loses_light
            and strategy == "both"
            and not INTEGRATORS[decision.method].media
            and max(decision.light_samples, decision.bsdf_samples) == 1
            and all(map(reaches_all, scene.materials.bsdfs))
        )
    if finds_sky and decision.dim_depth is not None:
        decision = dataclasses.replace(decision, survival_scale=1.0 / DIM_UNDER_SKY)
    weighed = has_extended_lights(scene.description, but_even_sky=finds_sky)
    if finds_sky and not weighed and len(scene.description.emitters) == 1:
        strategy = "bsdfs"
    plan = Plan(
        **vars(decision),
        weigh=weighed
        and decision.follow
        and case.smooth
        and depth > 1
        and strategy != "bsdfs",
        hide_emitters=requested.hide_emitters
        and not INTEGRATORS[decision.method].first_hit,
        transparent=case.transparent,
        spp=chosen_sampler.sample_count,
        sampler=chosen_sampler,
        ray_offset=offset,
        mitsuba_version=version,
        replay=replay,
        mis_densities=requested.mis_densities if replay else 0,
        moments=requested.moments,
        strategy=strategy,
        caustics=restriction.caustics,
        light_choice=choice,
        finds_sky=finds_sky,
    )
    if case.reduce and _may_go_through_panes(scene, plan):
        plan = dataclasses.replace(plan, through_panes=True)
        why.say("panes", "they refract light samples, which find what shines behind them")
    if case.reduce and _may_look_for_sky(scene, plan):
        plan = dataclasses.replace(plan, sky_by_place=True)
        why.say(
            "sky", "if little of it is visible, light samples go to what is, place by place"
        )
    if case.reduce and _may_look_near_lamps(scene, plan):
        plan = dataclasses.replace(plan, near_lamps=True)
        why.say(
            "lamps in fog", "light samples are also taken near small ones (equiangular)"
        )
    if plan.moments is not None:
        why.say("moments", "the means of the squares of single samples, as in Mitsuba")
    if plan.kind.splits and plan.mirrors:
        _check_tree(scene)
    if plan.kind.sees_lights:
        explain_weights(plan, scene, extended, why)
        if not plan.caustics:
            why.say("left out", "caustics, on rough surfaces, as simplified")
        explain_roulette(plan, why)
        if plan.kind.scatters and not plan.mirrors and not plan.follow and depth > 1:
            why.say("left out", "scattering: nothing is reflected towards another surface")
        explain_geometry(scene, why)
        explain_materials_and_lights(scene, why)
        if plan.kind.media:
            explain_media(scene, why)
        elif scene.description.has_media:
            why.say("left out", f"participating media: {plan.method} ignores them")
    else:
        why.say("left out", "lights, shadow rays, bounces: the first hit alone is needed")
        explain_geometry(scene, why)
    random = decision.random and depth > 1
    explain_samples(chosen_sampler, count, random, why, replay=replay)
    return dataclasses.replace(plan, lines=tuple(why.lines))


def _may_go_through_panes(scene: Scene, plan: Plan) -> bool:
    """Return whether the plan allows light samples that panes refract."""
    return (
        plan.kind.trace_through_panes is not None
        and plan.light_choice == "importance"
        and plan.weigh
        and plan.mirrors
        and plan.caustics
        and plan.strategy == "both"
        and not plan.transparent
        and plan.max_depth > 2  # camera to surface, to pane, to light
        and bool(scene.shapes.pane.any())
    )


def _may_look_for_sky(scene: Scene, plan: Plan) -> bool:
    """Return whether the plan allows light samples by visibility of the environment."""
    return (
        plan.light_choice == "importance"
        and plan.weigh
        and plan.strategy == "both"
        and not plan.kind.media
        and not plan.transparent
        and any(isinstance(e, EnvironmentMap | SunSky) for e in scene.description.emitters)
    )


def _may_look_near_lamps(scene: Scene, plan: Plan) -> bool:
    """Return whether the plan allows additional points in fog near small lights."""
    return (
        plan.kind.trace_near_lamps is not None
        and plan.light_choice == "importance"
        and plan.samples_lights
        and fog_lamps(scene).size > 0
    )


def _check_tree(scene: Scene) -> None:
    """Refuse nested BSDFs whose delta lobes Whitted's ray tree cannot follow.

    Raises
    ------
    SceneError
        Names the first one.
    """
    for kind in scene.materials.kinds:
        if kind.delta and kind.inside:
            raise SceneError(
                f"{scene.description.source}: integrator 'whitted' has no branches for the "
                f"bsdf {kind.name}; possible are path and direct, or whitted without it"
            )
