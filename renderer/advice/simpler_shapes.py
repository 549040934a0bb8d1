"""Simpler lights and instances of a description."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.plugins.lights.registry import plugin_of
from renderer.scene_file.description import Group, Instance, Mesh, SceneDescription, Shape

# ------------------------------------------------------------------------------- lights
# The lights of a scene by name, and scenes without one of them.

Light = tuple[str, int]  # the field of the description, and the index in it


def lights_by_name(description: SceneDescription) -> dict[str, Light]:
    """Return all lights by name, in the order of the file.

    The name of an area light is its shape's id, or its class and line. Other lights are
    named by plugin and number: `point-1`.
    """
    lights: dict[str, Light] = {}
    shapes = shape_names(description)
    for index, shape in enumerate(description.shapes):
        if shape.radiance is not None:
            lights[shapes[index]] = "shapes", index
    names = description.emitter_names or _counted(description)
    for index, name in enumerate(names):
        lights[_unused(name, {*shapes, *lights})] = "emitters", index
    return lights


def _counted(description: SceneDescription) -> tuple[str, ...]:
    count: Counter[str] = Counter()
    names = []
    for emitter in description.emitters:
        plugin = plugin_of(emitter).name
        count[plugin] += 1
        names.append(f"{plugin}-{count[plugin]}")
    return tuple(names)


def shape_names(description: SceneDescription) -> list[str]:
    """Return the name of every shape: its id, or its class and line.

    Shapes that are not lights have names too, so that removing a light renames no other
    shape.
    """
    names: dict[str, None] = {}
    met: Counter[str] = Counter()  # many shapes may be on one line
    for index, shape in enumerate(description.every_shape):
        place = shape.location.line or index + 1  # a dictionary has no lines
        name = shape.id or f"{type(shape).__name__.lower()}:{place}"
        names[_unused(name + met[name] * "'", names)] = None
        met[name] += 1
    return list(names)


def _unused(name: str, taken: Collection[str]) -> str:
    """Return the name, extended if it is taken: two shapes may be on one line."""
    while name in taken:
        name += "'"
    return name


def without_light(description: SceneDescription, light: Light) -> SceneDescription:
    """Return the scene without a light; the shape of an area light stays."""
    field, gone = light
    if field == "shapes":
        shapes = list(description.shapes)
        shapes[gone] = dataclasses.replace(shapes[gone], radiance=None)
        return dataclasses.replace(description, shapes=tuple(shapes))
    kept = [index for index in range(len(description.emitters)) if index != gone]
    places = description.emitter_places
    names = description.emitter_names or _counted(description)
    return dataclasses.replace(
        description,
        emitters=tuple(description.emitters[index] for index in kept),
        emitter_places=tuple(places[index] for index in kept) if places else (),
        emitter_names=tuple(names[index] for index in kept),
    )


# ---------------------------------------------------------------------------- instances
# Instances copied to plain shapes: more memory, but no BVH over instances.
#
# Meshes allow any transform; all copies of one become one mesh. Other shapes keep their
# formulas only under rotation, translation and uniform scale. Copies with another scale, a
# shear or a reflection stay instances.

MOST_FACES = 20_000_000  # of all copies: about 5 GB with their BVH
ROUNDING = 1e-6  # relative difference of scales that counts as uniform
Matrix = NDArray[np.float64]


def with_copies(description: SceneDescription) -> SceneDescription:
    """Return the scene with its instances replaced by copies.

    Raises
    ------
    SceneError
        If there would be more than `MOST_FACES`.
    """
    faces = sum(
        len(shape.faces)
        for instance in description.instances
        for shape in description.groups[instance.group].shapes
        if isinstance(shape, Mesh)
    )
    if faces > MOST_FACES:
        raise SceneError(
            f"{description.source}: simplification instances=flat: the copies have "
            f"{faces} faces in all; at most {MOST_FACES} are possible"
        )
    shapes: list[Shape] = list(description.shapes)
    groups: list[Group] = []
    kept: list[Instance] = []
    for number, group in enumerate(description.groups):
        placed = [one for one in description.instances if one.group == number]
        meshes = [shape for shape in group.shapes if isinstance(shape, Mesh)]
        others = tuple(shape for shape in group.shapes if not isinstance(shape, Mesh))
        for mesh in meshes:
            shapes += _copies(mesh, [instance.to_world for instance in placed])
        for instance in placed if others else ():
            if _keeps_forms(instance.to_world):
                shapes += [_moved(shape, instance.to_world) for shape in others]
            else:
                kept.append(dataclasses.replace(instance, group=len(groups)))
        if kept and kept[-1].group == len(groups):
            groups.append(dataclasses.replace(group, shapes=others))
    kept.sort(key=lambda instance: instance.place)
    instances = (  # in the order of the file, behind all shapes
        dataclasses.replace(instance, place=place)
        for place, instance in enumerate(kept, start=len(shapes))
    )
    return dataclasses.replace(
        description, shapes=tuple(shapes), groups=tuple(groups), instances=tuple(instances)
    )


def _copies(mesh: Mesh, places: Sequence[Matrix]) -> list[Mesh]:
    """Return all copies of a mesh: one mesh, and one for reflected copies."""
    mirrored = [bool(np.linalg.det(place[:3, :3]) < 0.0) for place in places]
    copies = []
    for side in (False, True):
        chosen = [p for p, turned in zip(places, mirrored, strict=True) if turned == side]
        if chosen:
            # a reflection reverses e1 x e2 but not an instance's normal, as in Mitsuba
            flipped = mesh.flip_normals != side
            copies.append(dataclasses.replace(_merged(mesh, chosen), flip_normals=flipped))
    return copies


def _merged(mesh: Mesh, places: Sequence[Matrix]) -> Mesh:
    count, vertices = len(places), len(mesh.vertices)
    points = [mesh.vertices @ place[:3, :3].T + place[:3, 3] for place in places]
    first = np.repeat(np.arange(count) * vertices, len(mesh.faces))
    ids = np.arange(len(mesh.faces)) if mesh.face_ids is None else mesh.face_ids
    normals = mesh.normals
    if normals is not None:
        # The lengths of a copy's normals keep their ratios: an instance interpolates the
        # group's unit normals first, and transforms them to world space afterwards.
        turned = [normals @ np.linalg.inv(place[:3, :3]) for place in places]
        longest = [np.linalg.norm(copy, axis=1).max() for copy in turned]
        normals = _float32(
            np.concatenate(
                [copy / most for copy, most in zip(turned, longest, strict=True)]
            )
        )
    return dataclasses.replace(
        mesh,
        vertices=_float32(np.concatenate(points)),
        faces=(np.tile(mesh.faces, (count, 1)) + first[:, None]).astype(np.int32),
        normals=normals,
        uvs=None if mesh.uvs is None else np.tile(mesh.uvs, (count, 1)),
        face_ids=np.tile(ids, count).astype(np.int32),
        attributes={n: np.tile(v, (count, 1)) for n, v in mesh.attributes.items()},
    )


def _keeps_forms(place: Matrix) -> bool:
    """Return whether a transform is a rotation, translation and uniform scale."""
    linear = place[:3, :3]
    square = linear @ linear.T
    scale = np.trace(square) / 3.0
    same = np.abs(square - scale * np.eye(3)).max() <= ROUNDING * scale
    return bool(same and np.linalg.det(linear) > 0.0)


def _moved(shape: Shape, place: Matrix) -> Shape:
    to_world = place @ shape.to_world  # type: ignore[attr-defined]
    return dataclasses.replace(shape, to_world=to_world)  # type: ignore[call-arg]


def _float32(values: NDArray[np.float64]) -> NDArray[np.float32]:
    return values.astype(np.float32)
