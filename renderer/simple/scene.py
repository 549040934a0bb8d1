"""The scene of the simple path tracer: a list of surfaces and a list of lights."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from renderer.errors import SceneError
from renderer.scene.light_order import light_order
from renderer.scene_file.description import (
    CheckerboardTexture,
    ConstantLight,
    MeshAttributeTexture,
    SceneDescription,
    SunSky,
    VolumeTexture,
)
from renderer.scene_file.media_description import GridVolume
from renderer.simple.bsdfs import Bsdf, BsdfSample, Lobe
from renderer.simple.camera import Vector
from renderer.simple.lights import EMITTERS, Light, pdf_light, power_heuristic
from renderer.simple.materials import BSDFS, NESTED
from renderer.simple.shapes import UNIT_SHAPES, Group, Hit, Surface
from renderer.simple.sky import Sky

# A ray ignores hits at t <= epsilon, so it does not hit the surface that it leaves. This is
# far above the rounding of double precision in scenes of up to 100,000 units. A shadow ray
# ends by this fraction before its light.
EPSILON = 1e-9
BLOCKS_PER_BOUNCE = 1 << 20  # of four random numbers, see `path_tracer`
Draw = Callable[[int], Sequence[float]]  # those of a block, for one sample of one pixel

INTEGRATORS = ("path", "direct", "whitted", "volpath")
# depth of a ray tree without a limit in the file, and the maximum; as in the kernels
USUAL_TREE, DEEPEST_TREE = 8, 256

# `transmittance` of `volume_path` lets shadow rays through `null` alone
BLOCKED_IN_MEDIA = (
    "mask",
    "thindielectric",
    "blendbsdf",
    "polarizer",
    "circular",
    "retarder",
)


class Scene:
    """The scene description, checked and converted for the integrators.

    Parameters
    ----------
    description
        The scene file.
    integrator
        Name of an integrator, "" for that of the file.

    Raises
    ------
    SceneError
        For features that only the kernels support.
    """

    def __init__(self, description: SceneDescription, integrator: str = "") -> None:
        settings = description.integrator
        self.integrator = integrator or settings.name
        _check(description, self.integrator)
        self.max_depth, self.rr_depth = settings.max_depth, settings.rr_depth
        self.cutoff = settings.cutoff
        if self.integrator == "direct":
            self.max_depth = 2 if self.max_depth < 0 else min(self.max_depth, 2)
        if self.integrator == "whitted":
            deep = USUAL_TREE if self.max_depth < 0 else self.max_depth
            self.max_depth = min(deep, DEEPEST_TREE)
        # per point, for `direct`
        self.emitter_samples = settings.emitter_samples
        self.bsdf_samples = settings.bsdf_samples
        self.surfaces = [Surface(shape) for shape in description.shapes]
        kinds = {type(shape): None for shape in description.shapes}
        self.groups = [
            Group([one for one in self.surfaces if type(one.shape) is kind])
            for kind in kinds
        ]
        order = light_order(description)
        emitters = [Sky(e) if isinstance(e, SunSky) else e for e in description.emitters]
        numbered: dict[int, Light] = dict(zip(order.of_emitters, emitters, strict=True))
        numbered |= dict(zip(order.of_shapes, self.surfaces, strict=True))
        self.lights = [numbered[i] for i in sorted(numbered) if i >= 0]
        skies = [e for e in emitters if isinstance(e, ConstantLight | Sky)]
        self.environment = skies[0] if skies else None
        self.medium = description.camera.medium


def _check(description: SceneDescription, name: str) -> None:
    """Refuse features without a formula in this renderer.

    Raises
    ------
    SceneError
        With the feature, its place in the file, and what is possible.
    """

    def refuse(what: str, where: object = description.source) -> None:
        raise SceneError(f"{where}: the simple path tracer has no {what}")

    integrator, rfilter = description.integrator, description.camera.film.rfilter
    if name not in INTEGRATORS:
        listed = ", ".join(map(repr, INTEGRATORS[:-1]))
        possible = f"{listed} and {INTEGRATORS[-1]!r}"
        refuse(f"integrator {name!r}; possible are {possible}")
    if name == integrator.name and integrator.refusal:
        raise SceneError(integrator.refusal)
    if integrator.moments is not None:
        refuse("integrator 'moment'; possible is the one inside of it")
    if integrator.hide_emitters:
        refuse("hide_emitters; possible is false")
    if integrator.strategy != "both" or not integrator.caustics:
        refuse("paths without caustics, or with one way to find light; possible are all")
    if rfilter.name != "box":
        refuse(f"rfilter {rfilter.name!r}; possible is 'box'")
    if description.instances:
        refuse("instances; possible are shapes alone")
    for shape in description.shapes:
        if type(shape) not in UNIT_SHAPES:
            possible = ", ".join(kind.__name__.lower() for kind in UNIT_SHAPES)
            refuse(
                f"shape {type(shape).__name__.lower()!r}; possible are {possible}",
                shape.location,
            )
        if shape.radiance is not None and not isinstance(shape.radiance, tuple):
            refuse("textures on lights; possible is one colour", shape.location)
        bsdfs = list(_with_nested(shape.bsdf))
        for bsdf in bsdfs:
            if bsdf.plugin not in BSDFS:
                possible = ", ".join(BSDFS)
                refuse(f"bsdf {bsdf.plugin!r}; possible are {possible}", shape.location)
            others = {MeshAttributeTexture: "mesh_attribute", VolumeTexture: "volume"}
            for what in (others.get(type(t)) for t in _textures(bsdf)):
                if what is not None:
                    possible = "bitmap and checkerboard"
                    refuse(f"texture {what}; possible are {possible}", shape.location)
        for bsdf in bsdfs if name == "whitted" else ():
            if not _has_all_branches(bsdf):
                refuse(
                    f"branches for the bsdf {bsdf.plugin!r}; possible are the integrators "
                    "path and direct, or whitted without it",
                    shape.location,
                )
    if name == "volpath":
        _check_media(description, refuse)
    for emitter in description.emitters:
        if not isinstance(emitter, EMITTERS):
            possible = "point, spot, directional, constant, sunsky and area"
            refuse(f"emitter {getattr(emitter, 'plugin', '')!r}; possible are {possible}")
        if getattr(emitter, "texture", None) is not None:
            refuse("textures on lights; possible is one colour")


def _check_media(description: SceneDescription, refuse: Callable[..., None]) -> None:
    """Refuse heterogeneous media, and transparent surfaces other than `null`."""
    shapes = description.shapes
    media: list[tuple[Any, object]] = [(description.camera.medium, description.source)]
    media += [(m, s.location) for s in shapes for m in (s.interior, s.exterior)]
    for medium, where in media:
        if medium is None:
            continue
        if medium.plugin != "homogeneous" or isinstance(medium.albedo, GridVolume):
            refuse("media that vary; possible are homogeneous ones without grids", where)
        if medium.phase.plugin not in ("isotropic", "hg"):
            possible = "'isotropic' and 'hg'"
            refuse(f"phase {medium.phase.plugin!r}; possible are {possible}", where)
    for shape in shapes:
        for bsdf in _with_nested(shape.bsdf):
            through = bsdf.plugin in BLOCKED_IN_MEDIA
            if through or (bsdf.plugin == "null" and bsdf is not shape.bsdf):
                what = f"shadow rays through {bsdf.plugin!r}"
                refuse(f"{what}; possible is 'null'", shape.location)


def _with_nested(bsdf: Any) -> Iterator[Any]:
    """Yield a BSDF of the description, and all BSDFs nested in it."""
    yield bsdf
    for name in NESTED.get(bsdf.plugin, ()):
        yield from _with_nested(getattr(bsdf, name))


def _has_all_branches(bsdf: Any) -> bool:
    """Return whether `branches` of a BSDF gives all its delta lobes.

    Of the BSDFs with nested ones, only `twosided` returns those of the nested BSDFs.
    """
    inside = [BSDFS[one.plugin].branches for one in _with_nested(bsdf)]
    delta = any(branches is not Bsdf.branches for branches in inside)
    own = BSDFS[bsdf.plugin].branches is not Bsdf.branches
    return own or not (delta or bsdf.plugin == "mask")


def _textures(record: Any) -> Iterator[Any]:
    """Yield the parameters of a BSDF or a checkerboard that may be textures."""
    for value in getattr(record, "values", vars(record)).values():
        yield value
        if isinstance(value, CheckerboardTexture):
            yield from _textures(value)


def closest_hit(scene: Scene, p: Vector, d: Vector, near: float, far: float) -> Hit | None:
    """Return the hit of smallest t > epsilon, by testing every surface (brute force)."""
    closest = None
    for group in scene.groups:
        hit = group.hit(p, d, near + EPSILON, far if closest is None else closest.t)
        closest = hit or closest
    return closest


def visible(scene: Scene, p: Vector, d: Vector, distance: float) -> bool:
    """Return the visibility V of a shadow ray: whether it has no hit."""
    far = distance * (1.0 - EPSILON)
    return not any(group.blocks(p, d, EPSILON, far) for group in scene.groups)


def emission(
    scene: Scene,
    p: Vector,
    d: Vector,
    hit: Hit | None,
    came_by: BsdfSample | None,
    share: float = 1.0,
) -> Vector:
    """Return L_e of the hit of the ray p + t d, with its MIS weight.

    Only a direction from a smooth lobe has a weight, since a light sample could have chosen
    it too. `share` is the number of light samples per BSDF sample.
    """
    light = scene.environment if hit is None else hit.light
    if light is None:
        return np.zeros(3)
    weight = 1.0
    if came_by is not None and came_by.lobe is Lobe.SMOOTH:
        weight = power_heuristic(came_by.pdf, pdf_light(light, p, d, hit) * share)
    radiance = light.radiance(d) if isinstance(light, Sky) else np.array(light.radiance)
    return weight * radiance
