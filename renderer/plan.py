"""The plan: no more than a scene needs, and why.

From what the file asks for and what the scene holds, `make_plan` takes the least method
that gives the same answer, and says so in words (`--explain`).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

from renderer.accelerators.build import FEW
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
from renderer.scene_file.samplers import round_sample_count

INTEGRATORS = ("auto", "direct", "whitted", "path", "depth", "aov")
SAMPLERS = ("independent", "stratified", "multijitter", "orthogonal", "ldsampler")
# A new ray starts off its surface, so as not to meet it again: so many rounding errors of
# the position, plus this times (1 + its largest coordinate). `tight` is right for scenes of
# millimetres and of kilometres alike. `mitsuba` is the rule of Mitsuba 3.9.1 (1500 units in
# the last place): with it a tube of mirrors agrees to 6e-6 instead of 6e-2
# (docs/decisions/ray-offset.md).
RAY_OFFSETS = {"tight": (64.0, 0.0), "mitsuba": (0.0, 1500.0 * 2.0**-24)}
NO_LIMIT = 1 << 30
MOST_SAMPLES = 1 << 24  # per pixel, as in a file
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
    ray_offset: str = "tight"
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
    if name in (None, asked.name):
        return asked
    if name not in SAMPLERS:
        known = ", ".join(SAMPLERS)
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
        Samples per pixel; None takes the file's. Rounded up to what the sampler's pattern
        allows, as in Mitsuba.
    accel : str, optional
        What `build_accelerators` will be asked for; it is explained here.
    ray_offset : str, optional
        One of `RAY_OFFSETS`: how far off their surface new rays start.

    Raises
    ------
    SceneError
        For a name that does not exist or a number of samples that is out of range.
    """
    plan = _decide(scene, integrator, sampler, spp)
    return dataclasses.replace(
        plan,
        ray_offset=_known_ray_offset(ray_offset),
        lines=(*plan.lines, *_explain_accelerators(scene, accel or "auto")),
    )


def _known_ray_offset(name: str | None) -> str:
    if name is None:
        return "tight"
    if name not in RAY_OFFSETS:
        known = ", ".join(RAY_OFFSETS)
        raise SceneError(f"ray offset {name!r} is unknown; there are: {known}")
    return name


def _decide(
    scene: Scene, integrator: str | None, sampler: str | None, spp: int | None
) -> Plan:
    why = _Explanation()
    asked = _choose_integrator(scene, integrator)
    reduce = integrator in (None, "auto")
    chosen_sampler = _choose_sampler(scene, sampler)
    count = chosen_sampler.sample_count if spp is None else spp
    chosen_sampler = _with_sample_count(chosen_sampler, count)

    materials = scene.materials
    extended = _has_extended_lights(scene)
    lights = extended or bool(scene.description.emitters)
    mirrors = materials.has(Conductor) or materials.has(Dielectric)
    method = asked.name
    depth = NO_LIMIT if asked.max_depth < 0 else asked.max_depth
    why.say("file asks", _describe(asked))

    if method in ("depth", "aov"):
        why.say("method", f"{method}: the first hit alone; no light, no BSDF is sampled")
        return _first_hit_plan(scene, asked, chosen_sampler, count, why)

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
    follow = method == "path" or (
        method == "direct" and extended and asked.bsdf_samples > 0
    )
    if method == "path" and not materials.has(Diffuse):
        follow = False
    weigh = extended and follow and materials.has(Diffuse)
    if not extended:
        reason = "all lights are points or directions" if lights else "there is no light"
        why.say("left out", f"multiple importance sampling, emission at hits: {reason}")
    elif not weigh:
        why.say(
            "left out", "multiple importance sampling: diffuse surfaces send no rays on"
        )
    roulette = asked.rr_depth if method == "path" else None
    if roulette is not None and depth <= roulette:
        roulette = None
        why.say(
            "left out",
            f"Russian roulette: max_depth {depth} comes before rr_depth {asked.rr_depth}",
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
        chosen_sampler.sample_count,
        chosen_sampler,
    )
    _explain_samples(
        plan, _is_random(plan, extended, materials.has(Dielectric)), count, why
    )
    return dataclasses.replace(plan, lines=tuple(why.lines))


def _describe(asked: Integrator) -> str:
    depth = "no limit" if asked.max_depth < 0 else str(asked.max_depth)
    match asked.name:
        case "path":
            return f"path, max_depth {depth}, rr_depth {asked.rr_depth}"
        case "whitted":
            return f"whitted, max_depth {depth}"
        case "aov" if asked.nested is not None:
            return f"aov, and the colours of {_describe(asked.nested)}"
        case _:
            return asked.name


def _first_hit_plan(
    scene: Scene, asked: Integrator, sampler: Sampler, count: int, why: _Explanation
) -> Plan:
    plan = Plan(
        method=asked.name,
        max_depth=1,
        roulette_depth=None,
        weigh=False,
        every_light=False,
        follow=False,
        hide_emitters=asked.hide_emitters,
        cutoff=0.0,
        spp=sampler.sample_count,
        sampler=sampler,
    )
    _explain_geometry(scene, why)
    _explain_samples(plan, False, count, why)
    return dataclasses.replace(plan, lines=tuple(why.lines))


def _is_random(plan: Plan, extended: bool, glass: bool) -> bool:
    """Return whether more than the position in the pixel is drawn at random."""
    if plan.max_depth <= 1:
        return False
    if plan.method == "path" and plan.max_depth > 2:
        return True
    return extended or (plan.method == "direct" and glass)


_PATTERNS = {
    "stratified": "a square number",
    "multijitter": "the cells of a grid",
    "orthogonal": "the square of a prime",
    "ldsampler": "a power of 4",
}


def _explain_samples(plan: Plan, random: bool, asked: int, why: _Explanation) -> None:
    sampler = plan.sampler
    text = f"{plan.spp} per pixel"
    if sampler.name != "stratified" or sampler.jitter:
        text += f", {sampler.name}"
    elif plan.spp == 1:
        text += ", at its centre"
    else:
        columns, rows = stratified_cells(plan.spp)
        text += f", on a fixed grid of {columns} x {rows}"
    if not random and sampler.name == "stratified" and not sampler.jitter:
        text += ": nothing is random"
    if asked != plan.spp:
        pattern = _PATTERNS[sampler.name]
        text += f" ({asked} asked for; the sampler needs {pattern}, as in Mitsuba)"
    if sampler.name in ("orthogonal", "ldsampler"):
        text += " (by correlated multi-jittering, of the same order of convergence)"
    why.say("samples", text)


def stratified_cells(sample_count: int) -> tuple[int, int]:
    """Return (columns, rows) of the grid for a number of samples, as square as possible."""
    root = int(sample_count**0.5 + 1e-9)
    for rows in range(root, 0, -1):
        if sample_count % rows == 0:
            return sample_count // rows, rows
    return sample_count, 1


def _primitives(scene: Scene) -> dict[str, int]:
    return {kind: s.end - s.first for kind, s in scene.surfaces.items()}


def _counted(count: int, kind: str) -> str:
    return f"{count} {kind.removesuffix('s') if count == 1 else kind}"


def _explain_geometry(scene: Scene, why: _Explanation) -> None:
    counts = _primitives(scene).items()
    shapes = ", ".join(_counted(count, kind) for kind, count in counts)
    why.say("geometry", shapes or "nothing")


def _explain_accelerators(scene: Scene, name: str) -> tuple[str, ...]:
    """Return a line for each kind of primitive: how the nearest hit is found."""
    why = _Explanation()
    for kind, count in _primitives(scene).items():
        chosen, reason = name, ", as asked for"
        if name == "auto":
            chosen = "brute" if count <= FEW else "bvh"
            reason = f": up to {FEW}, that is faster than a tree" if count <= FEW else ""
        text = {
            "brute": "each ray tests all of them",
            "bvh": "a tree of boxes, by the surface area heuristic",
        }.get(chosen, chosen)
        why.say("accelerator", f"{chosen} for {_counted(count, kind)}: {text}{reason}")
    return tuple(why.lines)


def _explain_scene(scene: Scene, why: _Explanation) -> None:
    _explain_geometry(scene, why)
    materials = scene.materials
    kinds = [
        k.__name__.lower() for k in (Diffuse, Conductor, Dielectric) if materials.has(k)
    ]
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
    missing = [
        k.__name__.lower() for k in (Diffuse, Conductor, Dielectric) if not materials.has(k)
    ]
    if missing:
        why.say("left out", f"{', '.join(missing)}: no shape has it; not compiled")
