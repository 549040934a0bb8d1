"""The plan in words: lines with a topic and a text, for `--explain` and the report.

They tell what is rendered, what is left out and why. No decision is made here.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field

from renderer.accelerators.choice import RayCounts, choose_structures
from renderer.accelerators.non_occluders import find_non_occluders
from renderer.integrators.registry import INTEGRATORS
from renderer.plugins.bsdfs.registry import BSDFS
from renderer.plugins.lights.registry import LIGHTS, plugin_of
from renderer.plugins.sampling.sobol import net_digits
from renderer.process import memory
from renderer.rendering.planning.plan import Plan
from renderer.scene.light_properties import has_textured_lights, sampled_lights
from renderer.scene.scene import KINDS, Scene, counted
from renderer.scene_file.description import (
    Integrator,
    Sampler,
)
from renderer.scene_file.media_description import (
    BlendedPhase,
    GridVolume,
    HenyeyGreenstein,
    Medium,
    Phase,
    TabulatedPhase,
    Volume,
)

TOPIC_WIDTH = 14  # characters before the text

_ALONE = {
    "lights": "light samples alone",
    "bsdfs": "BSDF samples that hit a light, alone; points and directions are never hit",
}
_PATTERNS = {
    "stratified": "a square number",
    "multijitter": "the cells of a grid",
    "orthogonal": "the square of a prime",
    "ldsampler": "a power of 4",
}
_ACCELERATORS = {
    "brute": "brute force",
    "boxes": "boxes around objects",
    "bvh": "a bounding volume hierarchy by the surface area heuristic",
    "bvh-median": "a bounding volume hierarchy, split at the median",
    "bvh-middle": "a bounding volume hierarchy, split in the middle",
    "wide": "a bounding volume hierarchy of eight children a node",
    "bsp": "a binary space partitioning tree with planes taken from the polygons",
    "grid": "a uniform grid",
    "grid-without-mailboxes": "a uniform grid without mailboxes",
    "grid-nested": "grids in the cells of a grid that hold many",
    "grid-clusters": "a grid of clusters that have grids of their own",
    "kd-middle": "a kd-tree, split in the middle",
    "kd-median": "a kd-tree, split at the median",
    "kd-sah": "a kd-tree by the surface area heuristic",
    "octree": "an octree",
}


@dataclass
class Explanation:
    """Lines in the order of the decisions."""

    lines: list[str] = field(default_factory=list)

    def say(self, topic: str, text: str) -> None:
        """Add a line; the topic "left out" is for what is not done."""
        self.lines.append(f"{topic:<{TOPIC_WIDTH}}{text}")


def describe_integrator(requested: Integrator) -> str:
    """Return the integrator's name and the properties that it has."""
    text = requested.name
    if requested.moments is not None:
        text = f"the moments of {text}"
    for name in INTEGRATORS[requested.name].described:
        value = getattr(requested, name)
        text += f", {name} {'no limit' if value < 0 else value}"
    if requested.nested is not None:
        text += f", and the colours of {describe_integrator(requested.nested)}"
    return text


def explain_geometry(scene: Scene, why: Explanation) -> None:
    """Add the number of primitives, and the kinds that the scene does not have."""
    shapes = (counted(count, kind) for kind, count in _primitives(scene).items())
    listed = list(shapes)
    if scene.placements is not None:
        listed.append(_instances(scene))
    why.say("geometry", ", ".join(listed) or "nothing")
    missing = [kind for kind in KINDS if kind not in scene.surfaces]
    if scene.placements is None:
        missing.append("instances")
    _leave_out(missing, "the scene has none", why)


def explain_accelerators(
    scene: Scene, requested: str, rays: RayCounts, why: Explanation
) -> None:
    """Add how the nearest hit is found, for each kind of primitive.

    Parameters
    ----------
    scene : Scene
        Scene with the primitives.
    requested : str
        An accelerator's name, or "auto".
    rays : RayCounts
        Expected numbers of rays.
    """
    counts = _primitives(scene)
    kinds: dict[str, list[str]] = {}
    reasons: dict[str, str] = {}
    for kind, choice in choose_structures(scene, requested, rays).items():
        kinds.setdefault(choice.name, []).append(kind)
        most = max(kinds[choice.name], key=counts.__getitem__)
        if kind == most:
            reasons[choice.name] = choice.reason
    for name, members in kinds.items():
        listed = ", ".join(counted(counts[kind], kind) for kind in members)
        why.say("accelerator", f"{listed}: {_ACCELERATORS[name]}; {reasons[name]}")
    if scene.placements is not None:
        text = f"{_ACCELERATORS['bvh']} over their boxes, and one for each group"
        if requested == "brute":
            text = "each of them, and each primitive of its group, tested by every ray"
        why.say("accelerator", f"{_instances(scene)}: {text}")


def explain_shadow_rays(
    scene: Scene,
    requested: str,
    rays: RayCounts,
    finds_sky: bool,
    offsets: tuple[float, float],
    why: Explanation,
) -> None:
    """Add what shadow rays are not tested against, see `explain_accelerators`."""
    lights = sampled_lights(scene.description, finds_sky)
    left_out = find_non_occluders(scene, requested, rays, lights, offsets)
    kinds = {
        kind: int(left_out[surfaces.first : surfaces.first + scene.starts[kind][0]].sum())
        for kind, surfaces in scene.surfaces.items()
    }
    listed = ", ".join(counted(count, kind) for kind, count in kinds.items() if count)
    if listed:
        why.say("shadow rays", f"pass by {listed}: never between a surface and a light")


def explain_materials_and_lights(scene: Scene, why: Explanation) -> None:
    """Add the BSDFs and lights, and those kinds that the scene does not have."""
    materials = scene.materials
    used = {leaf.name for kind in materials.kinds for leaf in kind.leaves}
    why.say("BSDFs", ", ".join(kind.name for kind in materials.kinds) or "none")
    lights = _lights(scene)
    listed = ", ".join(f"{count} {kind}" for kind, count in lights.items() if count)
    why.say("lights", listed or "none")
    if not materials.textured and not has_textured_lights(scene.description):
        why.say("left out", "textures and uv: no BSDF looks at them; not compiled")
    _leave_out([name for name in BSDFS if name not in used], "no shape has it", why)
    if listed:
        absent = [kind for kind, count in lights.items() if not count]
        _leave_out(absent, "the scene has no such light", why)
    else:
        _leave_out(["lights of any kind"], "the scene has none", why)


def explain_media(scene: Scene, why: Explanation) -> None:
    """Add for each medium its shapes, its scattering, and the size of its grids."""
    described = scene.description
    found = [(described.camera.medium, "around the camera")]
    for shape in described.every_shape:
        found += [(shape.interior, "inside of"), (shape.exterior, "outside of")]
    places: dict[Medium, Counter[str]] = {}
    for medium, place in found:
        if medium is not None:
            places.setdefault(medium, Counter())[place] += 1
    for medium, counts in places.items():
        where = [
            place if place.endswith("camera") else f"{place} {counted(count, 'shapes')}"
            for place, count in counts.items()
        ]
        told = [_free_path(medium), _albedo(medium.albedo), _phase(medium.phase)]
        grids = (v for v in (medium.sigma_t, medium.albedo) if isinstance(v, GridVolume))
        told += map(_grid, grids)
        why.say("medium", f"{medium.plugin}, {', '.join(where)}: {'; '.join(told)}")


def explain_light_choice(plan: Plan, count: int, why: Explanation) -> None:
    """Add how one of `count` lights is selected at a point."""
    if plan.every_light or not plan.samples_lights or count < 2:
        return
    how = "all equally often, as in Mitsuba"
    if plan.by_importance:
        how = "by what it can give there: power, distance, orientation"
    why.say("choice", f"one of {count} lights at each point, {how}")


def explain_weights(plan: Plan, scene: Scene, extended: bool, why: Explanation) -> None:
    """Add whether light samples and BSDF samples get MIS weights, and why.

    Parameters
    ----------
    plan : Plan
        The decisions.
    scene : Scene
        Its materials and lights.
    extended : bool
        Whether a ray can hit a light.
    why : Explanation
        Gets the lines.
    """
    what = "multiple importance sampling"
    if plan.finds_sky:
        why.say("sky", "found by BSDF samples alone: it is the same from everywhere")
    if plan.weigh:
        by = "light samples and BSDF samples that hit a light, by the power heuristic"
        if plan.strategy == "lights":
            what, by = "light samples alone", "BSDF samples count where they find nothing"
        why.say("weights", f"{what}: {by}")
        return
    if plan.strategy == "bsdfs" and plan.finds_sky:
        why.say("left out", f"{what}, light samples: there is no light but the sky")
        return
    if plan.strategy != "both":
        origin = "simplified" if plan.light_samples else "requested"
        why.say("weights", f"{_ALONE[plan.strategy]}, as {origin}")
        return
    if plan.finds_sky:
        reason = "no other light can be hit"
    elif not extended:
        what += ", emission at hits"
        lights = bool(scene.description.emitters)
        reason = "all lights are points or directions" if lights else "there is no light"
    elif plan.max_depth <= 1:
        reason = "with max_depth 1 only what shines is seen"
    elif scene.materials.smooth:
        reason = "diffuse surfaces send no rays on"
    else:
        reason = "no surface is diffuse"
    why.say("left out", f"{what}: {reason}")


def explain_roulette(plan: Plan, why: Explanation) -> None:
    """Add the segment at which Russian roulette begins, or why there is none."""
    if plan.roulette_depth is not None:
        text = f"Russian, from segment {plan.roulette_depth} on"
        if plan.dim_depth is not None:
            least = f"1/{plan.survival_scale:.0f}"
            text += f"; a path of less throughput than {least} may end before"
        why.say("roulette", text)
    else:
        why.say("left out", f"Russian roulette: {plan.no_roulette}")


def explain_samples(
    sampler: Sampler, requested: int, random: bool, why: Explanation, *, replay: bool
) -> None:
    """Add the number and pattern of samples, and why the number differs from the request.

    Parameters
    ----------
    sampler : Sampler
        With the number that is used.
    requested : int
        The requested number.
    random : bool
        Whether more than the position in the pixel is random.
    replay : bool
        Whether the random numbers are Mitsuba's own.
    """
    count, name = sampler.sample_count, sampler.name
    text = f"{count} per pixel"
    if name != "stratified" or sampler.jitter:
        text += f", {name}"
    else:
        side = math.isqrt(count)
        text += ", at its centre" if count == 1 else f", on a fixed grid of {side} x {side}"
        if not random:
            text += ": nothing is random"
    if requested != count:
        needs = f"the sampler needs {_PATTERNS[name]}, as in Mitsuba"
        text += f" ({requested} requested; {needs})"
    if name in ("orthogonal", "ldsampler") and not replay:
        text += " (by correlated multi-jittering, of the same order of convergence)"
    if name == "independent" and random and count >= 16 and not replay:
        text += " (`--sampler sobol` is mostly faster: 1.6 times to the same error)"
    if name == "sobol" and count.bit_count() > 1:
        bits = count.bit_length()
        if net_digits(bits) is not None:
            text += f" ({1 << bits} would be a net, of less error for its time)"
    why.say("samples", text)


def _leave_out(kinds: list[str], reason: str, why: Explanation) -> None:
    """Add the kinds that are not compiled, if there are any."""
    if kinds:
        why.say("left out", f"{', '.join(kinds)}: {reason}; not compiled")


def _lights(scene: Scene) -> dict[str, int]:
    """Return the number of lights of each kind, including zeros."""
    lights = dict.fromkeys(LIGHTS, 0)
    for emitter in scene.description.emitters:
        lights[plugin_of(emitter).name] += 1
    lights["area"] = sum(shape.radiance is not None for shape in scene.description.shapes)
    return lights


def _primitives(scene: Scene) -> dict[str, int]:
    """Return the number of primitives of each kind outside of groups."""
    return {kind: int(starts[0]) for kind, starts in scene.starts.items() if starts[0]}


def _instances(scene: Scene) -> str:
    """Return "10000 instances of 1 group (320 triangles, 1 sphere)"."""
    inside = {kind: int(s[-1] - s[0]) for kind, s in scene.starts.items()}
    held = ", ".join(counted(count, kind) for kind, count in inside.items() if count)
    copies = counted(len(scene.description.instances), "instances")
    groups = counted(len(scene.description.groups), "groups")
    return f"{copies} of {groups} ({held})"


# -------------------------------------------------------------------------------- media


def _free_path(medium: Medium) -> str:
    """Return the mean free path, for all colours, or of a grid."""
    volume, scale = medium.sigma_t, medium.scale
    if isinstance(volume, GridVolume):
        densest = _inverse(scale * volume.maximum)
        mean = _inverse(scale * float(volume.values.mean()))
        return f"mean free path {densest} where densest, {mean} on average"
    ends = (_inverse(scale * sigma) for sigma in (max(volume.rgb), min(volume.rgb)))
    return f"mean free path {' to '.join(dict.fromkeys(ends))}"


def _inverse(sigma: float) -> str:
    return f"{1.0 / sigma:.3g}" if sigma > 0.0 else "infinite"


def _albedo(volume: Volume) -> str:
    if isinstance(volume, GridVolume):
        return f"albedo {volume.values.min():.3g} to {volume.maximum:.3g}"
    colors = volume.rgb if len(set(volume.rgb)) > 1 else volume.rgb[:1]
    return f"albedo {', '.join(f'{color:.3g}' for color in colors)}"


def _phase(phase: Phase) -> str:
    """Return the name and the parameters of a phase function."""
    if isinstance(phase, BlendedPhase):
        first, second = _phase(phase.first), _phase(phase.second)
        if isinstance(phase.weight, GridVolume):
            return f"a blend by {_grid(phase.weight)} of {first} and {second}"
        share = phase.weight
        return f"a blend of {first} ({1.0 - share:.3g}) and {second} ({share:.3g})"
    if isinstance(phase, HenyeyGreenstein):
        return f"hg of g {phase.g:g}"
    if isinstance(phase, TabulatedPhase):
        return f"tabphase of {len(phase.values)} values"
    return phase.plugin


def _grid(volume: GridVolume) -> str:
    z, y, x, channels = volume.values.shape
    colors = " colours" if channels == 3 else ""
    return f"a grid of {x} x {y} x {z}{colors} ({memory.shown(volume.values.nbytes)})"
