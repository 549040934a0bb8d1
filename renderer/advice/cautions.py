"""Checks of a scene for known failures and for long render times."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.advice.closed_shapes import encloses, is_closed
from renderer.plugins.bsdfs.polarizer import FILTERS
from renderer.plugins.shapes.extents import primitive_bounds
from renderer.plugins.textures.registry import mean_of
from renderer.rendering.planning.plan import Plan
from renderer.scene.materials import kind_of, sides
from renderer.scene.scene import Scene
from renderer.scene_file.description import (
    Dielectric,
    Disk,
    Mask,
    Mesh,
    Null,
    PerspectiveCamera,
    PointLight,
    Rectangle,
    Shape,
    Sphere,
    SpotLight,
    ThinDielectric,
    TwoSided,
)
from renderer.scene_file.transforms import mirrors

# ------------------------------------------------------------------------------ caution
# A caution, and the names of shapes in it.

MOST_NAMED = 3


class Caution(NamedTuple):
    """A sentence without its full stop, and where the failure is measured."""

    text: str
    row: str  # name in the atlas of failures

    def __str__(self) -> str:
        """Return the sentence, and the name in the atlas."""
        return f"{self.text} (atlas: {self.row})"


def name_of(shape: Shape) -> str:
    """Return a shape's id, or its line in the file."""
    kind = type(shape).__name__.lower()
    return repr(shape.id) if shape.id else f"the {kind} of line {shape.location.line}"


def listed(names: Sequence[str]) -> str:
    """Return the first few names, and the number of the others."""
    more = len(names) - MOST_NAMED
    return ", ".join(names[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")


# ---------------------------------------------------------------------- far coordinates
# Coordinates for which single precision is coarser than a pixel.

STEP = 2.0**-23  # of float32, relative
SHARE = 0.25  # allowed step in widths of a pixel


def far_coordinates(scene: Scene, plan: Plan) -> Iterator[str]:
    """Find shapes whose coordinates all have steps of more than `SHARE` of a pixel.

    The estimate is conservative: it uses the smallest coordinate and the largest distance
    from the camera that the box of a primitive allows.
    """
    camera = scene.description.camera
    if not isinstance(camera, PerspectiveCamera):
        return
    eye = camera.to_world[:3, 3]
    pixel = 2.0 * np.tan(np.radians(camera.fov_x / 2.0)) / camera.film.width
    shapes = scene.description.shapes
    finest = np.full(len(scene.description.every_shape), np.inf)
    coarsest = np.zeros(len(finest))
    first = 0  # primitive ids continue across the kinds
    for kind, surfaces in scene.surfaces.items():
        count = scene.starts[kind][0]
        low, high = (
            side[:, :count].astype(np.float64) for side in primitive_bounds(kind, surfaces)
        )
        # a box that contains 0 along an axis has arbitrarily small steps there
        least = np.where(low * high > 0.0, np.minimum(abs(low), abs(high)), 0.0).max(axis=0)
        reach = np.maximum(abs(low - eye[:, None]), abs(high - eye[:, None]))
        step = STEP * least / (pixel * np.linalg.norm(reach, axis=0))
        owner = scene.shape[first : first + count]
        np.minimum.at(finest, owner, step)
        np.maximum.at(coarsest, owner, step)
        first += scene.starts[kind][-1]
    far = [k for k in range(len(shapes)) if SHARE < finest[k] < np.inf]
    if far:
        worst = max(coarsest[far])
        found = [name_of(shapes[k]) for k in far]
        yield (
            f"single precision steps by up to {worst:.2g} pixels where these are: "
            f"{listed(found)}; move the scene to the origin"
        )


# --------------------------------------------------------------------------- flat faces
# All flat shapes of a scene as triangles.

Floats = NDArray[np.float64]

_TURNS = 2.0 * np.pi * np.arange(24) / 24
_POLYGON = np.stack([np.cos(_TURNS), np.sin(_TURNS), 0 * _TURNS, 0 * _TURNS + 1], axis=1)
_FAN = np.array([[0, k, k + 1] for k in range(1, len(_POLYGON) - 1)])
_SQUARE = np.array([[-1, -1, 0, 1], [1, -1, 0, 1], [1, 1, 0, 1], [-1, 1, 0, 1]], float)
_HALVES = np.array([[0, 1, 2], [0, 2, 3]])
_BARYCENTRIC = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])


class Faces(NamedTuple):
    """Triangles with an area; a disk is a polygon of 24 corners."""

    corners: Floats  # (n, 3, 3)
    normal: Floats  # (n, 3) unit, on the front of the shape
    turn: Floats  # (n,) -1 where the normal is opposite to (b - a) x (c - a)
    area: Floats  # (n,)
    place: Floats  # (n, 3, 2) uv of each corner; for a disk, local x and y
    owner: NDArray[np.int64]  # (n,) index of the shape


def flat_faces(shapes: tuple[Shape, ...]) -> Faces:
    """Return the faces of the rectangles, disks and meshes among some shapes."""
    corners, place, owner = [np.zeros((0, 3, 3))], [np.zeros((0, 3, 2))], []
    front = np.ones(len(shapes))
    for index, shape in enumerate(shapes):
        if isinstance(shape, Rectangle | Disk):
            outline, faces = (
                (_SQUARE, _HALVES) if isinstance(shape, Rectangle) else (_POLYGON, _FAN)
            )
            corners.append((outline @ shape.to_world.T)[:, :3][faces])
            place.append(outline[:, :2][faces])
            front[index] = -1.0 if mirrors(shape.to_world) != shape.flip_normals else 1.0
        elif isinstance(shape, Mesh):
            faces = shape.faces
            corners.append(shape.vertices[faces].astype(np.float64))
            place.append(
                np.broadcast_to(_BARYCENTRIC, (len(faces), 3, 2))
                if shape.uvs is None
                else shape.uvs[faces].astype(np.float64)
            )
            front[index] = -1.0 if shape.flip_normals else 1.0
        else:
            continue
        owner += [index] * len(faces)
    every, of = np.concatenate(corners), np.array(owner, np.int64)
    normal = np.cross(every[:, 1] - every[:, 0], every[:, 2] - every[:, 0])
    length = np.linalg.norm(normal, axis=1)
    kept = (length > 0.0) & np.isfinite(length)
    normal = normal[kept] / length[kept, None] * front[of[kept], None]
    return Faces(
        every[kept],
        normal,
        front[of[kept]],
        length[kept] / 2.0,
        np.concatenate(place)[kept],
        of[kept],
    )


# -------------------------------------------------------------------------------- glass
# Objects that glass hides: lights inside of it, and everything behind it at low max_depth.

THROUGH_A_SURFACE = 3  # segments: to the glass, to the surface behind it, to its light
THROUGH_A_BODY = 4  # and one to leave the glass


def depth_in_glass(scene: Scene, plan: Plan) -> Iterator[str]:
    """Find glass through which no illuminated surface is visible at the plan's max_depth.

    Each shape is considered separately: glass inside or behind other glass needs more
    segments. Glass in instances counts as a single surface.
    """
    if not plan.kind.sees_lights or plan.kind.first_hit:
        return
    needed = {
        shape: THROUGH_A_SURFACE
        for shape in scene.description.every_shape
        if isinstance(shape.bsdf, Dielectric | ThinDielectric)
    }
    eye = scene.description.camera.to_world[:3, 3]
    if plan.max_depth < THROUGH_A_BODY:
        for shape in scene.description.shapes:
            glass = isinstance(shape.bsdf, Dielectric) and is_closed(shape)
            if glass and not encloses(shape, eye):
                needed[shape] = THROUGH_A_BODY
    dark = [shape for shape in needed if plan.max_depth < needed[shape]]
    if dark:
        yield (
            f"shapes of glass in which paths of {plan.max_depth} segments end: {len(dark)} "
            f"({listed([name_of(shape) for shape in dark])}); they show no lit surface "
            f"behind them, which takes {max(needed[shape] for shape in dark)} segments"
        )


def lamps_in_glass(scene: Scene, plan: Plan) -> Iterator[str]:
    """Find point and spot lights enclosed by smooth glass, null surfaces or masks.

    Rough glass does not count: light samples on its surface find the light. Single spheres
    and meshes are tested, not closed arrangements of several shapes.
    """
    if not plan.samples_lights:
        return
    shapes = scene.description.shapes
    # in scenes with media shadow rays pass everything except glass
    stops = _is_glass if plan.kind.media else _stops
    glass = [shape for shape in shapes if stops(shape.bsdf) and is_closed(shape)]
    lamps, around = 0, []
    for emitter in scene.description.emitters if glass else ():
        if isinstance(emitter, PointLight):
            place = np.array(emitter.position, np.float64)
        elif isinstance(emitter, SpotLight):
            place = emitter.to_world[:3, 3]
        else:
            continue
        inside = [name_of(shape) for shape in glass if encloses(shape, place)]
        lamps += bool(inside)
        around += [name for name in inside if name not in around]
    if lamps:
        yield (
            "point lights that glass, `null`, `mask` or a polarizer is closed around: "
            f"{lamps} (in {listed(around)}); what lies beyond gets nothing of them "
            "directly: shadow rays end there, and no path meets a point by chance"
        )


def _stops(bsdf: Any) -> bool:
    """Return whether light passes a BSDF where shadow rays are blocked."""
    if isinstance(bsdf, Mask):
        return mean_of(bsdf.opacity) < 1.0 or _stops(bsdf.nested)
    straight = isinstance(bsdf, ThinDielectric | Null) or bsdf.plugin in FILTERS
    return straight or isinstance(bsdf, Dielectric)


def _is_glass(bsdf: Any) -> bool:
    return isinstance(bsdf, Dielectric)


# ----------------------------------------------------------------------- surface points
# Points distributed uniformly by area over the surfaces of a scene.

# R2 sequence, a generalization of the golden ratio sequence
_STEPS = np.array([0.7548776662466927, 0.5698402909980532])


class SurfacePoints(NamedTuple):
    """Points, with the normals on the front of their shapes."""

    position: Floats  # (n, 3)
    normal: Floats  # (n, 3) unit
    owner: NDArray[np.int64]  # (n,) index of the shape


def surface_points(shapes: tuple[Shape, ...], count: int) -> SurfacePoints:
    """Return `count` points on the flat shapes and the spheres among some shapes."""
    faces = flat_faces(shapes)
    spheres = {k: shape for k, shape in enumerate(shapes) if isinstance(shape, Sphere)}
    radii = [float(np.linalg.norm(s.to_world[:3, 0])) for s in spheres.values()]
    reached = np.cumsum([*faces.area, *(4.0 * np.pi * r**2 for r in radii)])
    if not len(reached) or not 0.0 < reached[-1] < np.inf:
        return SurfacePoints(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, np.int64))
    chosen = np.searchsorted(reached, (np.arange(count) + 0.5) / count * reached[-1])
    u, v = (np.outer(_STEPS, np.arange(1, count + 1)) % 1.0)[:, :, None]
    flat = chosen < len(faces.area)
    position, normal = np.zeros((count, 3)), np.zeros((count, 3))
    face, root = chosen[flat], np.sqrt(u[flat])
    a, b, c = np.moveaxis(faces.corners[face], 1, 0)
    position[flat] = a + root * (1.0 - v[flat]) * (b - a) + root * v[flat] * (c - a)
    normal[flat] = faces.normal[face]
    z, turn = 1.0 - 2.0 * u[:, 0], 2.0 * np.pi * v[:, 0]
    across = np.sqrt(1.0 - z * z)
    on_ball = np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)
    owner = np.append(faces.owner, np.array([*spheres], np.int64))[chosen]
    for (k, shape), radius in zip(spheres.items(), radii, strict=True):
        here = owner == k
        away = on_ball[here] @ shape.to_world[:3, :3].T
        position[here] = shape.to_world[:3, 3] + away
        normal[here] = away / radius * (-1.0 if shape.flip_normals else 1.0)
    return SurfacePoints(position, normal, owner)


# ------------------------------------------------------------------ undersampled lights
# Lights that are sampled too rarely by uniform selection.

LIMIT = 4.0  # standard deviation over mean of a sample: 25 % error at 256 samples
NEARLY_ALL = 0.9  # of the illuminated area
POINTS = 1024  # at which lights are evaluated
_KNOWN = Disk, Mesh, Rectangle, Sphere


def undersampled_lights(scene: Scene, plan: Plan) -> Iterator[str]:
    """Find scenes where most of the area is illuminated by few of many lights.

    For n lights with contributions f, uniform selection has a relative standard deviation
    of sqrt(n sum f^2 / (sum f)^2 - 1). Selection by importance has nearly none and is not
    checked. Shadows and the visible part of the area are ignored: in a shadow the value may
    be larger or smaller. Area lights, environments, and shapes other than flat ones and
    spheres are not evaluated: a scene with any of them gets no caution.
    """
    emitters = scene.description.emitters
    lamps = [e for e in emitters if isinstance(e, PointLight | SpotLight)]
    count = len(emitters) + sum(s.radiance is not None for s in scene.description.shapes)
    uniform = plan.samples_lights and not plan.every_light and not plan.by_importance
    if not uniform or count < 2 or len(lamps) < count:
        return
    shapes = tuple(s for s in scene.description.every_shape if _asks_lamps(s))
    if scene.description.groups or not all(isinstance(s, _KNOWN) for s in shapes):
        return
    points = surface_points(shapes, POINTS)
    both = np.array([_is_lit_from_behind(s.bsdf) for s in shapes], bool)[points.owner]
    light = np.stack([_irradiance(lamp, points, both) for lamp in lamps])
    total = light.sum(axis=0)
    lit = total > 0.0
    if not lit.any():
        return
    second = count * np.sum(light[:, lit] ** 2, axis=0) / total[lit] ** 2
    spread = np.sqrt(np.maximum(second - 1.0, 0.0))
    if np.mean(spread > LIMIT) > NEARLY_ALL:
        yield (
            f"one of {count} lamps is sampled at a time, all equally often, and few of "
            f"them give most of the light: a sample varies by {np.median(spread):.2g} "
            "times its mean, shadows aside"
        )


def _asks_lamps(shape: Shape) -> bool:
    """Return whether a shape has smooth lobes."""
    return any(side is not None and kind_of(side).smooth for side in sides(shape.bsdf))


def _is_lit_from_behind(bsdf: Any) -> bool:
    return isinstance(bsdf, TwoSided) or bool(kind_of(bsdf).transmits)


def _irradiance(lamp: Any, points: SurfacePoints, both: NDArray[np.bool_]) -> Floats:
    """Return the unshadowed irradiance of a light, 0 outside of a spot's cone.

    Also 0 on the back of the points, except where both sides are illuminated.
    """
    spot = isinstance(lamp, SpotLight)
    away = points.position - (lamp.to_world[:3, 3] if spot else np.array(lamp.position))
    distance = np.maximum(np.linalg.norm(away, axis=1), 1e-30)
    cosine = -np.einsum("ij,ij->i", points.normal, away) / distance
    cosine = np.where(both, np.abs(cosine), np.maximum(cosine, 0.0))
    light = np.asarray(max(lamp.intensity) * cosine / distance**2)
    if not spot:
        return light
    axis = lamp.to_world[:3, 2] / np.linalg.norm(lamp.to_world[:3, 2])
    inside = away @ axis > np.cos(np.radians(lamp.cutoff_angle)) * distance
    return np.where(inside, light, 0.0)
