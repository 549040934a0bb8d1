"""Scene: a SceneDescription as flat arrays, one group for each kind of primitive.

Primitive ids are assigned by kind in the order of `registry.SHAPES` (triangles first), and
within a kind in the order of the file. Later stages use only primitive ids and shape ids.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.records.kernel_scene import (
    Placements,
    Shapes,
)
from renderer.plugins.shapes.extents import primitive_bounds
from renderer.plugins.shapes.primitives import float32
from renderer.plugins.shapes.registry import KINDS as KINDS
from renderer.plugins.shapes.registry import SHAPES, kind_of_shape
from renderer.scene.materials import MaterialTables
from renderer.scene.panes import panes
from renderer.scene.placed_groups import (
    check_attributes,
    check_placements,
    group_boxes,
    place,
    placed_boxes,
    shape_numbers,
)
from renderer.scene_file.coordinate_limits import FARTHEST
from renderer.scene_file.description import SceneDescription

# tables may contain copies of textures, or additional numbers for each triangle
RECENT = {"plan": 32, "structures": 32, "tables": 2}


def counted(count: int, kind: str) -> str:
    """Return such as "1 sphere" or "3 triangles"."""
    return f"{count} {kind.removesuffix('s') if count == 1 else kind}"


@dataclass(frozen=True, eq=False, repr=False)
class Scene:
    """All data of a scene that does not depend on the render options."""

    description: SceneDescription
    surfaces: dict[
        str, Any
    ]  # kind -> record of renderer.plugins.shapes, present kinds only
    shape: NDArray[np.int32]  # (primitives,) shape id
    face: NDArray[np.int32]  # (primitives,) index within the file's mesh
    stages: NDArray[np.int32]  # (primitives,) bits of renderer.kernels.records.kernel_scene
    shapes: Shapes
    materials: MaterialTables
    # kind -> (groups + 1,) columns of its record where each group begins, and the end.
    # Primitives before the first group are in world space; the others belong to instances.
    starts: dict[str, NDArray[np.int64]]
    placements: Placements | None  # None: there are no instances

    def __repr__(self) -> str:
        """Return one line: the fields would be pages of arrays."""
        film = self.description.camera.film
        counts = {kind: int(starts[-1]) for kind, starts in self.starts.items()}
        counts["instances"] = len(self.description.instances)
        held = ", ".join(counted(count, kind) for kind, count in counts.items() if count)
        size = f"{film.crop_width} x {film.crop_height}"
        return f"<Scene {self.description.source}: {size}, {held or 'empty'}>"

    @functools.cached_property
    def _built(self) -> dict[Any, Any]:
        return {}

    @functools.cached_property
    def _recent(self) -> dict[str, dict[Any, Any]]:
        return {}

    def __getstate__(self) -> dict[str, Any]:
        """Exclude cached values from pickles: tables contain addresses of this process."""
        return {name: value for name, value in vars(self).items() if name != "_recent"}

    def once(self, key: Any, build: Callable[..., Any], *arguments: Any) -> Any:
        """Return `build(*arguments)`, computed once for each key and then cached.

        Used for example for accelerators, which all renders of the scene share.
        """
        if key not in self._built:
            self._built[key] = build(*arguments)
        return self._built[key]

    def recently(
        self, what: str, key: Any, build: Callable[..., Any], *arguments: Any
    ) -> Any:
        """Return `build(*arguments)` as `once`, but cache only the most recent results.

        Used for results that depend on the render options, of which there may be many
        variants: the last `RECENT[what]` are kept.
        """
        kept = self._recent.setdefault(what, {})
        found = kept.pop(key, None)  # may be changed by other threads
        if found is None:
            found = build(*arguments)
        kept[key] = found  # at the end: most recent
        for oldest in list(kept)[: -RECENT[what]]:
            kept.pop(oldest, None)
        return found

    @functools.cached_property
    def bounds(self) -> NDArray[np.float64]:
        """Lower and upper corner of the world, (2, 3); a point at 0 for an empty scene."""
        boxes: list[Any] = []
        if self.instance_boxes is not None:
            boxes.append(self.instance_boxes)
        for kind, surfaces in self.surfaces.items():
            top_level = self.starts[kind][0]
            if top_level > 0:
                low, high = primitive_bounds(kind, surfaces)
                boxes.append((low[:, :top_level], high[:, :top_level]))
        if not boxes:
            return np.zeros((2, 3))
        lower = np.min([box[0].min(axis=1) for box in boxes], axis=0)
        upper = np.max([box[1].max(axis=1) for box in boxes], axis=0)
        return np.array([lower, upper], dtype=np.float64)

    @functools.cached_property
    def instance_boxes(self) -> NDArray[np.float64] | None:
        """Lower and upper corners of the instances in the world, (2, 3, n)."""
        if self.placements is None:
            return None
        primitives = [
            (primitive_bounds(kind, surfaces), self.starts[kind])
            for kind, surfaces in self.surfaces.items()
        ]
        return placed_boxes(self.placements, group_boxes(primitives))


def primitives_of_shapes(scene: Scene) -> list[NDArray[np.int32]]:
    """Return the primitive ids of each shape that is not in a group."""
    by_shape = np.argsort(scene.shape, kind="stable").astype(np.int32)
    shapes = np.arange(len(scene.description.shapes) + 1)
    ends = np.searchsorted(scene.shape[by_shape], shapes)
    return [by_shape[a:b] for a, b in itertools.pairwise(ends)]


def build_scene(description: SceneDescription) -> Scene:
    """Turn a description into flat arrays.

    Raises
    ------
    SceneError
        If an instance has coordinates too large for single precision; the reader has
        checked the shapes.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        return _build_scene(description)


def _build_scene(description: SceneDescription) -> Scene:
    every_shape = description.every_shape
    kinds = [kind_of_shape(shape).name for shape in every_shape]
    members = {
        kind: [(k, shape) for k, shape in enumerate(every_shape) if kinds[k] == kind]
        for kind in SHAPES
    }
    materials = MaterialTables.of(description)
    group_of = _groups_of_shapes(description)
    check_attributes(every_shape, materials, group_of)
    surfaces: dict[str, Any] = {}
    starts: dict[str, NDArray[np.int64]] = {}
    shape_ids, faces = [], []
    first = 0
    for kind, entries in members.items():
        if not entries:
            continue
        shapes = [shape for _, shape in entries]
        record = surfaces[kind] = SHAPES[kind].surfaces(shapes, first)
        for index, shape in entries:
            faces.append(SHAPES[kind].faces(shape))
            shape_ids.append(np.full(len(faces[-1]), index, np.int32))
        columns = [ids.size for ids in shape_ids[-len(entries) :]]
        groups = group_of[[index for index, _ in entries]]
        sizes = np.bincount(groups, columns, minlength=group_of[-1] + 1)
        starts[kind] = np.cumsum(sizes).astype(np.int64)
        first = record.end

    shape_of = np.concatenate([*shape_ids, np.zeros(0, np.int32)])
    stages = materials.stages(every_shape)
    orientation = [kind_of_shape(s).orientation(s) for s in every_shape] or [1.0]
    scene = Scene(
        description,
        surfaces,
        shape_of,
        np.concatenate([*faces, np.zeros(0, np.int32)], dtype=np.int32),
        stages[shape_of],
        Shapes(
            materials.front,
            materials.back,
            materials.light,
            float32(orientation),
            shape_numbers(description),
            panes(description),
        ),
        materials,
        starts,
        place(description.instances),
    )
    check_placements(description, scene.placements, scene.bounds, FARTHEST)
    return scene


def _groups_of_shapes(description: SceneDescription) -> NDArray[np.int64]:
    """Return 0 for shapes outside of groups, k + 1 for those of group k; ends with K."""
    sizes = [len(description.shapes), *(len(g.shapes) for g in description.groups)]
    return np.append(np.repeat(np.arange(len(sizes)), sizes), len(sizes) - 1)
