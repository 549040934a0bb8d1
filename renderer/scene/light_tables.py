"""Tables of the lights of a scene, for light samples and for emission that rays hit.

Also the bounds of position, direction and power of each light, by light id.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.plugins.bsdfs.kind import BsdfKind
from renderer.plugins.lights.area import AreaLights
from renderer.plugins.lights.environment import environment_light
from renderer.plugins.lights.importance import ANY_NORMAL, BOTH_SIDES, IN_FRONT
from renderer.plugins.lights.kind import SphereAround, number_column, vector_columns
from renderer.plugins.lights.light_tree import LightBounds, on_surface
from renderer.plugins.lights.registry import LIGHTS, plugin_of
from renderer.plugins.lights.texel_choice import uv_choice
from renderer.plugins.lights.textured_area import TexturedAreas
from renderer.plugins.lights.textures import LightTextures, light_textures
from renderer.plugins.shapes.kind import ShapeKind
from renderer.plugins.shapes.registry import SHAPES, kind_of_shape
from renderer.plugins.shapes.triangle import TriangleLights
from renderer.plugins.shapes.uv import uv_chart
from renderer.plugins.textures.registry import kind_of_texture, mean_of
from renderer.scene.light_order import light_order
from renderer.scene.materials import table_of
from renderer.scene.scene import Scene, primitives_of_shapes


def light_bounds(scene: Scene) -> list[LightBounds]:
    """Return the bounds of all lights."""
    order = light_order(scene.description)
    found: dict[int, LightBounds] = {}
    for light, emitter in zip(order.of_emitters, scene.description.emitters, strict=True):
        describe = plugin_of(emitter).bounds
        assert describe is not None
        found[light] = describe(emitter)
    primitives = primitives_of_shapes(scene)
    for shape, light in enumerate(order.of_shapes):
        if light >= 0:
            found[light] = _of_shape(scene, shape, primitives[shape])
    return [found[light] for light in sorted(found)]


def _of_shape(scene: Scene, number: int, primitives: NDArray[np.int32]) -> LightBounds:
    shape = scene.description.shapes[number]
    kind = kind_of_shape(shape)
    surfaces = scene.surfaces[kind.name]
    columns = primitives - surfaces.first
    points, margin, normals = kind.hull(surfaces, columns)
    radiance = shape.radiance
    mean = float(np.mean(radiance)) if isinstance(radiance, tuple) else mean_of(radiance)
    side = float(scene.shapes.orientation[number])
    if not isinstance(radiance, tuple) and kind.textured_side(shape) != side:
        side = 0.0  # light samples use one side, emission is on the other
    return on_surface(
        np.asarray(points, np.float64),
        np.asarray(margin, np.float64),
        np.asarray(normals, np.float64) * side,
        kind.areas(surfaces, columns),
        mean,
    )


def lit_sides(kind: BsdfKind) -> int:
    """Return the sides of a surface on which its BSDF scatters light.

    IN_FRONT, BOTH_SIDES or ANY_NORMAL, see `LightChoice.sides`.
    """
    if _turns_normals(kind):
        return ANY_NORMAL
    return BOTH_SIDES if kind.transmits else IN_FRONT


def _turns_normals(kind: BsdfKind) -> bool:
    return kind.normal is not None or any(map(_turns_normals, kind.inside))


# ------------------------------------------------------------------------- light tables
# Emitters as tables, in the order of `renderer.scene.light_order`.

# (number of lights, triangle table, {light id: (primitive ids, areas)}) -> sampling table
MeshChoice = Callable[[int, Any, dict[int, Any]], Any]


@dataclass(frozen=True)
class LightTables:
    """All lights of a scene: one table for each kind that occurs."""

    count: int
    kind: NDArray[np.int32]  # (count,) index in `tables`, by light id
    tables: list[Any]  # records, columns by light id

    @property
    def kind_of_sky(self) -> int:
        """Index of the environment in `tables`."""
        return [environment_light.has(type(table)) for table in self.tables].index(True)

    def with_table(self, kind: int, table: Any) -> LightTables:
        """Return a copy with another table for one kind."""
        tables = [*self.tables[:kind], table, *self.tables[kind + 1 :]]
        return replace(self, tables=tables)


def light_tables(
    scene: Scene, surfaces: dict[str, Any], mesh_choice: MeshChoice
) -> LightTables:
    """Return the tables of all lights.

    Parameters
    ----------
    scene
        Its description has the lights.
    surfaces
        Its surface tables, as the kernels read them.
    mesh_choice
        Makes the table that selects a triangle of a mesh light.
    """
    order = light_order(scene.description)
    others = dict(zip(order.of_emitters, scene.description.emitters, strict=True))
    shining = {light: i for i, light in enumerate(order.of_shapes) if light >= 0}
    count = len(shining) + len(others)
    low, high = scene.bounds
    radius = float(np.linalg.norm(high - low)) + 0.5
    around = SphereAround((0.5 * (low + high)).astype(np.float32), radius)
    kind = np.zeros(max(count, 1), np.int32)
    tables: list[Any] = []

    def add(ids: Iterable[int], table: Any) -> None:
        kind[list(ids)] = len(tables)
        tables.append(table)

    for plugin in LIGHTS.values():
        mine = {i: e for i, e in others.items() if plugin_of(e) is plugin}
        for lights, textures in _by_texture(count, scene, mine, plugin.texture):
            further = (textures,) if plugin.texture else ()
            assert plugin.table is not None
            add(lights, plugin.table(count, lights, around, *further))
    of_shapes = primitives_of_shapes(scene)
    primitives = {light: of_shapes[shape] for light, shape in shining.items()}
    shapes = scene.description.shapes
    for name, of_kind in scene.surfaces.items():
        lamps = {
            light: shapes[shining[light]]
            for light, ids in primitives.items()
            if of_kind.first <= ids[0] < of_kind.end
        }
        for lights, textures in _by_texture(count, scene, lamps, "radiance"):
            lit = _Lit(
                SHAPES[name],
                of_kind,
                surfaces[name],
                {light: primitives[light] for light in lights},
                lights,
            )
            if textures is None:
                add(lights, _areas(count, lit, mesh_choice))
            else:
                add(lights, _textured_areas(count, lit, textures))
    return LightTables(count, kind, tables)


def _by_texture(
    count: int, scene: Scene, lights: dict[int, Any], name: str
) -> list[tuple[dict[int, Any], LightTextures | None]]:
    """Return the lights in groups: textures `name` of a group can be in one table."""
    groups: dict[Any, dict[int, Any]] = {}
    for light, described in lights.items():
        texture = getattr(described, name, None)
        of = None if kind_of_texture(texture) is None else table_of(texture)
        groups.setdefault(of, {})[light] = described
    packed: list[tuple[dict[int, Any], LightTextures | None]] = []
    for of, mine in groups.items():
        textures = {
            light: getattr(described, name, None) for light, described in mine.items()
        }
        packed.append(
            (mine, None if of is None else light_textures(count, of[0], textures, scene))
        )
    return packed


class _Lit(NamedTuple):
    """The area lights of one table by light id, and the kind of shape they are on."""

    kind: ShapeKind
    all_surfaces: Any  # table of all shapes of the kind
    surfaces: Any  # the same, as the kernels read it
    ids: dict[int, NDArray[np.int32]]  # primitive ids by light id
    shapes: dict[int, Any]

    def first_primitives(self, count: int) -> NDArray[np.int32]:
        """Return the first primitive of each of `count` lights."""
        prims = np.zeros(count, np.int32)
        for light, ids in self.ids.items():
            prims[light] = ids[0]
        return prims

    def radiances(self) -> dict[int, Any]:
        """Return the radiance of each light."""
        return {light: shape.radiance for light, shape in self.shapes.items()}


def _areas(count: int, lit: _Lit, mesh_choice: MeshChoice) -> AreaLights:
    """Return the area lights on one kind of shape."""
    kind, every = lit.kind, lit.all_surfaces
    sizes = {i: kind.areas(every, ids - every.first) for i, ids in lit.ids.items()}
    by_primitive = {i: (ids, sizes[i]) for i, ids in lit.ids.items()}
    return AreaLights(
        vector_columns(count, lit.radiances()),
        number_column(count, {i: 1.0 / sizes[i].sum() for i in lit.ids}),
        lit.first_primitives(count),
        number_column(count, {i: kind.orientation(s) for i, s in lit.shapes.items()}),
        lit.surfaces,
        mesh_choice(count, every, by_primitive) if kind.mesh else None,
    )


def _textured_areas(count: int, lit: _Lit, textures: LightTextures) -> TexturedAreas:
    """Return the area lights with textures on one kind of shape."""
    kind = lit.kind
    return TexturedAreas(
        textures,
        uv_choice(count, lit.radiances()),
        lit.first_primitives(count),
        number_column(count, {i: kind.textured_side(s) for i, s in lit.shapes.items()}),
        lit.surfaces,
        uv_chart(count, lit.surfaces, lit.ids) if kind.mesh else None,
    )


def alias_tables(count: int, surfaces: Any, tables: dict[int, Any]) -> TriangleLights:
    """Return alias tables by area for mesh lights: (primitive ids, areas) by light."""
    first, number = np.zeros(count, np.int32), np.zeros(count, np.int32)
    keeps, aliases, prims = [], [], []
    total = 0
    for light, (ids, sizes) in tables.items():
        keep, alias = alias_table(sizes)
        first[light], number[light] = total, len(ids)
        keeps.append(keep)
        aliases.append(alias + total)
        prims.append(ids)
        total += len(ids)
    return TriangleLights(
        first,
        number,
        np.concatenate(keeps).astype(np.float32),
        np.concatenate(aliases).astype(np.int32),
        np.concatenate(prims).astype(np.int32),
    )


def alias_table(
    weights: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return (keep, alias) for drawing indices in proportion to `weights` in constant time.

    Draw a column uniformly; stay with probability keep, else go to alias [Walker1977],
    built with Vose's two stacks [Vose1991].
    """
    n = len(weights)
    scaled = np.asarray(weights, np.float64) * (n / np.sum(weights))
    keep, alias = np.ones(n), np.arange(n)
    small = [i for i in range(n) if scaled[i] < 1.0]
    large = [i for i in range(n) if scaled[i] >= 1.0]
    while small and large:
        low, high = small.pop(), large[-1]
        keep[low], alias[low] = scaled[low], high
        scaled[high] -= 1.0 - scaled[low]
        if scaled[high] < 1.0:
            small.append(large.pop())
    return keep, alias
