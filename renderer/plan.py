"""The plan: no more than a scene needs, and why.

From what the file asks for and what the scene holds, `make_plan` takes the least method
that gives the same answer, and says so in words (`--explain`).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

from renderer.errors import SceneError
from renderer.scene import Scene
from renderer.scene_file.description import (
    Conductor,
    ConstantLight,
    Dielectric,
    Diffuse,
    Integrator,
    Sampler,
)

INTEGRATORS = ("auto", "direct", "whitted", "path", "depth", "aov")
SAMPLERS = ("independent", "stratified", "multijitter", "orthogonal", "ldsampler")
NO_LIMIT = 1 << 30
WHITTED_DEPTH = 8  # where the file gives no limit: light caught in glass never leaves


@dataclass(frozen=True)
class Plan:
    """What will be done. `lines` explains it; the other fields steer the kernels."""

    method: str  # direct, whitted, path, depth or aov
    max_depth: int
    roulette_depth: int | None  # None: no Russian roulette
    weigh: bool  # multiple importance sampling
    every_light: bool  # ask all lights at each point instead of one at random
    follow: bool  # go on from diffuse surfaces
    hide_emitters: bool
    cutoff: float
    spp: int
    sampler: Sampler
    lines: tuple[str, ...] = ()


@dataclass
class _Explanation:
    lines: list[str] = field(default_factory=list)

    def say(self, topic: str, text: str) -> None:
        self.lines.append(f"{topic:<14}{text}")


def _has_extended_lights(scene: Scene) -> bool:
    shapes = any(shape.radiance is not None for shape in scene.description.shapes)
    environment = any(isinstance(e, ConstantLight) for e in scene.description.emitters)
    return shapes or environment


def _choose_integrator(scene: Scene, name: str | None) -> Integrator:
    asked = scene.description.integrator
    if name in (None, "auto", asked.name):
        return asked
    if name not in INTEGRATORS:
        known = ", ".join(INTEGRATORS)
        raise SceneError(f"integrator {name!r} is unknown; there are: {known}")
    if name == "aov":
        return dataclasses.replace(asked, name="aov", aovs=(), nested=None)
    return dataclasses.replace(asked, name=name)


def _choose_sampler(scene: Scene, name: str | None) -> Sampler:
    asked = scene.description.camera.sampler
    if name is None:
        return asked
    if name not in SAMPLERS:
        known = ", ".join(SAMPLERS)
        raise SceneError(f"sampler {name!r} is unknown; there are: {known}")
    return dataclasses.replace(asked, name=name, jitter=True)


def make_plan(
    scene: Scene,
    *,
    integrator: str | None = None,
    sampler: str | None = None,
    spp: int | None = None,
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
        One of `SAMPLERS`; None takes the file's.
    spp : int, optional
        Samples per pixel; None takes the file's.

    Raises
    ------
    SceneError
        For a name that does not exist or a number of samples below 1.
    """
    why = _Explanation()
    asked = _choose_integrator(scene, integrator)
    reduce = integrator in (None, "auto")
    chosen_sampler = _choose_sampler(scene, sampler)
    count = chosen_sampler.sample_count if spp is None else spp
    if count < 1:
        raise SceneError(f"spp is {count}; at least 1 sample per pixel is possible")

    materials = scene.materials
    extended = _has_extended_lights(scene)
    lights = extended or bool(scene.description.emitters)
    mirrors = materials.has(Conductor) or materials.has(Dielectric)
    method = asked.name
    depth = NO_LIMIT if asked.max_depth < 0 else asked.max_depth
    why.say("file asks", _describe(asked))

    if method in ("depth", "aov"):
        why.say("method", f"{method}: the first hit alone; no light, no BSDF is sampled")
        return _first_hit_plan(method, asked, chosen_sampler, count, why)

    if method == "direct":
        depth = min(depth, 2) if asked.max_depth >= 0 else 2
    if method == "whitted" and asked.max_depth < 0:
        depth = WHITTED_DEPTH
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

    every_light = method in ("direct", "whitted")
    # BSDF samples look for lights only where lights can be hit
    follow = method == "path" or (method == "direct" and extended and asked.bsdf_samples > 0)
    if method == "path" and not materials.has(Diffuse):
        follow = False
    weigh = extended and follow and materials.has(Diffuse)
    if not extended:
        reason = "all lights are points or directions" if lights else "there is no light"
        why.say("left out", f"multiple importance sampling, emission at hits: {reason}")
    elif not weigh:
        why.say("left out", "multiple importance sampling: diffuse surfaces send no rays on")
    roulette = asked.rr_depth if method == "path" else None
    if roulette is not None and depth <= roulette:
        roulette = None
        why.say(
            "left out",
            f"Russian roulette: max_depth {depth} ends paths before rr_depth {asked.rr_depth}",
        )
    if method == "direct" and not mirrors and not follow and depth > 1:
        why.say("left out", "scattering: nothing is reflected towards another surface")

    _explain_scene(scene, why)
    plan = Plan(
        method,
        depth,
        roulette,
        weigh,
        every_light,
        follow,
        asked.hide_emitters,
        asked.cutoff if method == "whitted" else 0.0,
        count,
        chosen_sampler,
    )
    return _with_least_samples(plan, extended, materials.has(Dielectric), why)


def _describe(asked: Integrator) -> str:
    depth = "no limit" if asked.max_depth < 0 else str(asked.max_depth)
    return f"{asked.name}, max_depth {depth}, rr_depth {asked.rr_depth}"


def _first_hit_plan(
    method: str, asked: Integrator, sampler: Sampler, spp: int, why: _Explanation
) -> Plan:
    plan = Plan(
        method, 1, None, False, False, False, asked.hide_emitters, 0.0, spp, sampler
    )
    return _with_least_samples(plan, False, False, why)


def _with_least_samples(
    plan: Plan, extended: bool, glass: bool, why: _Explanation
) -> Plan:
    """Take one sample per pixel where nothing is random."""
    sampler = plan.sampler
    fixed_positions = sampler.name == "stratified" and not sampler.jitter
    random = (
        (extended and plan.method in ("direct", "whitted", "path") and plan.max_depth > 1)
        or (plan.method == "path" and plan.max_depth > 2)
        or (plan.method == "direct" and glass and plan.max_depth > 1)
    )
    spp = plan.spp
    if fixed_positions and not random:
        cells = stratified_cells(sampler.sample_count)
        distinct = cells[0] * cells[1]
        if spp > distinct:
            spp = distinct
        text = f"{spp} per pixel: nothing is random, so no position is sampled twice"
    else:
        text = f"{spp} per pixel, {sampler.name}"
    if sampler.name in ("orthogonal", "ldsampler"):
        text += " (by correlated multi-jittering, of the same order of convergence)"
    why.say("samples", text)
    return dataclasses.replace(plan, spp=spp, lines=tuple(why.lines))


def stratified_cells(sample_count: int) -> tuple[int, int]:
    """Return (columns, rows) of the grid for a number of samples, as square as possible."""
    root = int(sample_count**0.5 + 1e-9)
    for rows in range(root, 0, -1):
        if sample_count % rows == 0:
            return sample_count // rows, rows
    return sample_count, 1


def _explain_scene(scene: Scene, why: _Explanation) -> None:
    counts = {kind: s.end - s.first for kind, s in scene.surfaces.items()}
    shapes = ", ".join(f"{count} {kind}" for kind, count in counts.items()) or "nothing"
    why.say("geometry", shapes)
    materials = scene.materials
    kinds = [k.__name__.lower() for k in (Diffuse, Conductor, Dielectric) if materials.has(k)]
    why.say("BSDFs", ", ".join(kinds) or "none")
    lights: dict[str, int] = {}
    for emitter in scene.description.emitters:
        name = type(emitter).__name__.removesuffix("Light").lower()
        lights[name] = lights.get(name, 0) + 1
    area = sum(shape.radiance is not None for shape in scene.description.shapes)
    if area:
        lights["area"] = area
    listed = ", ".join(f"{count} {name}" for name, count in lights.items())
    why.say("lights", listed or "none")
    if not materials.textured:
        why.say("left out", "textures and uv: no BSDF looks at them")
    missing = [k.__name__.lower() for k in (Diffuse, Conductor, Dielectric) if not materials.has(k)]
    if missing:
        why.say("left out", f"{', '.join(missing)}: no shape has it; not compiled")
