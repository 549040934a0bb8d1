"""Emitters as tables, in the order of `renderer.light_order`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.kernel_scene import (
    AREA,
    CONSTANT,
    DIRECTIONAL,
    POINT,
    SPOT,
    AreaLights,
    ConstantLights,
    DirectionalLights,
    Lights,
    PointLights,
    SpotLights,
    TriangleLights,
    TriangleShares,
)
from renderer.light_order import light_order
from renderer.replay.triangle_arithmetic import triangle_areas
from renderer.scene import Scene, emits
from renderer.scene_file.description import (
    ConstantLight,
    DirectionalLight,
    Emitter,
    Mesh,
    PointLight,
    SpotLight,
)

_KIND = {
    PointLight: POINT,
    SpotLight: SPOT,
    DirectionalLight: DIRECTIONAL,
    ConstantLight: CONSTANT,
}


def light_tables(scene: Scene, replay: bool = False) -> Lights | None:
    """Return the kernels' record of all lights, None for a scene without any.

    Parameters
    ----------
    replay
        Whether the triangles of mesh lights are chosen as Mitsuba does it, in a time that
        grows with the logarithm of their number.
    """
    order = light_order(scene.description)
    emitters = scene.description.emitters
    others = dict(zip(order.of_emitters, emitters, strict=True))
    shining = {light: i for i, light in enumerate(order.of_shapes) if light >= 0}
    count = len(shining) + len(others)
    if count == 0:
        return None
    kinds = [_KIND[type(others[i])] if i in others else AREA for i in range(count)]
    # nothing of the scene is farther from any of its points than this
    beyond = 2.0 * float(np.linalg.norm(scene.bounds[1] - scene.bounds[0])) + 1.0
    return Lights(
        count,
        np.array(kinds, np.int32),
        _points(count, _of(others, PointLight)),
        _spots(count, _of(others, SpotLight)),
        _directionals(count, _of(others, DirectionalLight), beyond),
        _constants(count, _of(others, ConstantLight), beyond),
        _areas(count, scene, shining, replay) if shining else None,
    )


def _of(emitters: dict[int, Emitter], kind: type) -> dict[int, Any]:
    return {i: e for i, e in emitters.items() if isinstance(e, kind)}


def _columns(count: int, rows: dict[int, Any]) -> NDArray[np.float32]:
    """Return (3, count) with the given columns, zero elsewhere."""
    table = np.zeros((3, count), np.float32)
    for i, row in rows.items():
        table[:, i] = row
    return table


def _row(count: int, values: dict[int, float]) -> NDArray[np.float32]:
    table = np.zeros(count, np.float32)
    for i, value in values.items():
        table[i] = value
    return table


def _points(count: int, lights: dict[int, PointLight]) -> PointLights | None:
    if not lights:
        return None
    return PointLights(
        _columns(count, {i: e.position for i, e in lights.items()}),
        _columns(count, {i: e.intensity for i, e in lights.items()}),
    )


def _spots(count: int, lights: dict[int, SpotLight]) -> SpotLights | None:
    if not lights:
        return None
    cutoff = {i: np.radians(e.cutoff_angle) for i, e in lights.items()}
    beam = {i: np.radians(e.beam_width) for i, e in lights.items()}
    axes = {
        i: e.to_world[:3, 2] / np.linalg.norm(e.to_world[:3, 2]) for i, e in lights.items()
    }
    widths = {i: cutoff[i] - beam[i] for i in lights}
    return SpotLights(
        _columns(count, {i: e.to_world[:3, 3] for i, e in lights.items()}),
        _columns(count, axes),
        _columns(count, {i: e.intensity for i, e in lights.items()}),
        _row(count, {i: np.cos(a) for i, a in cutoff.items()}),
        _row(count, {i: np.cos(a) for i, a in beam.items()}),
        _row(count, cutoff),
        _row(count, {i: 1.0 / w if w > 0 else 0.0 for i, w in widths.items()}),
    )


def _directionals(
    count: int, lights: dict[int, DirectionalLight], beyond: float
) -> DirectionalLights | None:
    if not lights:
        return None
    to_light = {
        i: -np.array(e.direction) / np.linalg.norm(e.direction) for i, e in lights.items()
    }
    irradiance = {i: e.irradiance for i, e in lights.items()}
    return DirectionalLights(_columns(count, to_light), _columns(count, irradiance), beyond)


def _constants(
    count: int, lights: dict[int, ConstantLight], beyond: float
) -> ConstantLights | None:
    if not lights:
        return None
    return ConstantLights(
        _columns(count, {i: e.radiance for i, e in lights.items()}), beyond
    )


def _areas(count: int, scene: Scene, shining: dict[int, int], replay: bool) -> AreaLights:
    """Return the area lights; `shining` has the shape of each light id."""
    areas, prims, orientation, tables = {}, np.zeros(count, np.int32), {}, {}
    by_shape = np.argsort(scene.shape, kind="stable").astype(np.int32)
    ends = np.searchsorted(
        scene.shape[by_shape], np.arange(len(scene.description.shapes) + 1)
    )
    shapes = scene.description.shapes
    for light, shape_id in shining.items():
        ids = by_shape[ends[shape_id] : ends[shape_id + 1]]
        sizes = np.concatenate(
            [_primitive_areas(scene, kind, ids) for kind in scene.surfaces]
        )
        areas[light] = sizes.sum()
        prims[light] = ids[0]
        orientation[light] = scene.shapes.orientation[shape_id]
        if isinstance(shapes[shape_id], Mesh):
            tables[light] = (ids, sizes)
    return AreaLights(
        _columns(count, {i: shapes[k].radiance for i, k in shining.items()}),
        _row(count, {i: 1.0 / a for i, a in areas.items()}),
        prims,
        _row(count, orientation),
        1 if replay else None,
        _mesh_lights(count, scene, tables, replay) if tables else None,
        *(
            1 if emits(scene, k) else None
            for k in ("rectangles", "disks", "spheres", "cylinders")
        ),
    )


def _primitive_areas(
    scene: Scene, kind: str, ids: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Return the areas of those primitives among `ids` that are of a kind."""
    s = scene.surfaces[kind]
    k = ids[(ids >= s.first) & (ids < s.end)] - s.first
    if kind == "spheres":
        return 4.0 * np.pi * s.radius[k].astype(np.float64) ** 2
    if kind == "cylinders":
        return 2.0 * np.pi * s.radius[k].astype(np.float64) * s.height[k]
    cross = np.cross(s.edge1[:, k].T.astype(np.float64), s.edge2[:, k].T.astype(np.float64))
    factor = {"triangles": 0.5, "rectangles": 1.0, "disks": np.pi}[kind]
    return factor * np.linalg.norm(cross, axis=1)


def _mesh_lights(
    count: int, scene: Scene, tables: dict[int, Any], replay: bool
) -> TriangleLights | TriangleShares:
    if not replay:
        return _triangle_lights(count, tables)
    return _triangle_shares(count, scene, {i: ids for i, (ids, _) in tables.items()})


def _triangle_shares(
    count: int, scene: Scene, meshes: dict[int, NDArray[np.int32]]
) -> TriangleShares:
    """Return the cumulated areas of mesh lights, rounded as Mitsuba does it."""
    triangles = scene.surfaces["triangles"]
    first, number = np.zeros(count, np.int32), np.zeros(count, np.int32)
    area = np.zeros(count, np.float32)
    columns: list[list[NDArray[Any]]] = []
    total = 0
    for light, ids in meshes.items():
        k = ids - triangles.first
        sizes = triangle_areas(triangles.edge1[:, k], triangles.edge2[:, k])
        cumulated = np.cumsum(sizes, dtype=np.float64).astype(np.float32)
        normalization = np.float32(1.0) / cumulated[-1]
        exact = np.append(0.0, cumulated[:-1].astype(np.float64)) * normalization
        below = exact.astype(np.float32)
        first[light], number[light], area[light] = total, len(ids), cumulated[-1]
        lost = (exact - below).astype(np.float32)
        columns.append([cumulated, below, lost, sizes * normalization, ids])
        total += len(ids)
    rows = (np.concatenate(parts) for parts in zip(*columns, strict=True))
    return TriangleShares(first, number, area, *rows)


def _triangle_lights(count: int, tables: dict[int, Any]) -> TriangleLights:
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
