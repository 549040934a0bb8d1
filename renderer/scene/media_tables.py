"""The participating media of a scene as tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.records.media import (
    HENYEY_GREENSTEIN,
    ISOTROPIC,
    NO_BOUNDARY,
    RAYLEIGH,
    TABULATED,
    VACUUM,
    Media,
)
from renderer.plugins.media.majorants import cell_bounds, world_box
from renderer.plugins.media.volumes import grid_tables
from renderer.plugins.textures.kind import LUMINANCE
from renderer.scene_file.description import SceneDescription
from renderer.scene_file.media_description import (
    BlendedPhase,
    ConstantVolume,
    GridVolume,
    HenyeyGreenstein,
    Medium,
    Phase,
    RayleighPhase,
    TabulatedPhase,
    Volume,
)


def media_of(description: SceneDescription | None) -> list[Medium]:
    """Return the media that the sensor and shapes refer to, in the order of their ids."""
    if description is None:
        return []
    sides = [(shape.interior, shape.exterior) for shape in description.every_shape]
    named = [description.camera.medium, *(medium for both in sides for medium in both)]
    return list({id(medium): medium for medium in named if medium is not None}.values())


def media_tables(description: SceneDescription | None) -> Media:
    """Return the media that shapes and the sensor refer to; None: none at all."""
    found = media_of(description)
    ids = {id(medium): k for k, medium in enumerate(found)}

    def number(medium: Medium | None) -> int:
        return int(VACUUM) if medium is None else ids[id(medium)]

    camera = number(description.camera.medium if description else None)
    sides = []
    for shape in description.every_shape if description else ():
        boundary = shape.interior is not None or shape.exterior is not None
        inside, outside = number(shape.interior), number(shape.exterior)
        sides.append((inside, outside) if boundary else (int(NO_BOUNDARY),) * 2)
    interior, exterior = np.array(sides or [(int(NO_BOUNDARY),) * 2], np.int32).T
    phases = [list(_leaves(medium.phase, 1.0)) for medium in found]
    flat = [leaf for leaves in phases for leaf in leaves]
    volumes = [volume for m in found for volume in (m.sigma_t, m.albedo)]
    grids = list({id(v): v for v in volumes if isinstance(v, GridVolume)}.values())
    place = {id(grid): k for k, grid in enumerate(grids)}
    weight_grids = {id(grid): grid for leaf in flat for grid, _ in leaf.weights}
    place_of_weight = {key: len(grids) + k for k, key in enumerate(weight_grids)}
    grids += map(_one_channel, weight_grids.values())
    tables = [_table(leaf.phase) for leaf in flat]
    weights = [
        (place_of_weight[id(grid)], of) for leaf in flat for grid, of in leaf.weights
    ]
    bounds = [cell_bounds(medium) for medium in found]
    sizes = [size for size, _ in bounds] or [np.ones(3, np.int64)]
    return Media(
        len(found),
        camera,
        np.ascontiguousarray(interior),
        np.ascontiguousarray(exterior),
        _columns([_sigma_t(medium) for medium in found], 3),
        _columns([_factor(m.albedo) for m in found], 3),
        _numbers([_majorant(medium) for medium in found], np.float32),
        _numbers([place.get(id(m.sigma_t), -1) for m in found], np.int32),
        _numbers([place.get(id(m.albedo), -1) for m in found], np.int32),
        _columns([world_box(medium.sigma_t.to_world) for medium in found], 6),
        np.ascontiguousarray(np.transpose(sizes), np.int32),
        _ends([part.shape[1] for _, part in bounds])[:-1] if found else np.zeros(1, "i4"),
        np.concatenate([*(part for _, part in bounds), np.zeros((2, 16))], axis=1).astype(
            np.float32
        ),
        _ends(map(len, phases)),
        _numbers([_kind(leaf.phase) for leaf in flat], np.int32),
        _numbers([leaf.share for leaf in flat], np.float32),
        _ends(len(leaf.weights) for leaf in flat),
        np.array(weights or [(0, 0)], np.int32).T.copy(),
        _numbers([getattr(leaf.phase, "g", 0.0) for leaf in flat], np.float32),
        _ends(table.shape[1] for table in tables),
        np.concatenate([*tables, np.zeros((2, 16))], axis=1).astype(np.float32),
        grid_tables(grids),
    )


def _numbers(values: Sequence[Any], dtype: Any) -> NDArray[Any]:
    return np.array([*values, 0] if not values else values, dtype)


def _columns(rows: Sequence[Any], size: int) -> NDArray[np.float32]:
    table = np.array(rows or [np.zeros(size)], np.float64)
    return np.ascontiguousarray(table.T, np.float32)


def _ends(counts: Any) -> NDArray[np.int32]:
    return np.cumsum([0, *counts]).astype(np.int32)


def _factor(volume: Volume) -> Any:
    return volume.rgb if isinstance(volume, ConstantVolume) else (1.0, 1.0, 1.0)


def _sigma_t(medium: Medium) -> Any:
    """Return the extinction, or the factor of a grid; 0 if nothing ever collides.

    A product of two float32, as in Mitsuba. For a homogeneous medium it equals the
    majorant bit by bit, so that no collision is a null collision.
    """
    nothing = medium.plugin != "homogeneous" and np.float32(_majorant(medium)) == 0.0
    scale = np.float32(0.0 if nothing else medium.scale)
    return scale * np.array(_factor(medium.sigma_t), np.float32)


def _majorant(medium: Medium) -> float:
    if medium.plugin == "homogeneous":
        return 0.0
    # above every interpolated value, which rounding may increase by some units
    return medium.scale * medium.sigma_t.maximum * (1.0 + 2.0**-20)


# ---------------------------------------------------------------------- phase functions


class _Leaf(NamedTuple):
    """One phase function of a mixture."""

    phase: Phase
    share: float  # product of the constant weights, in (0, 1]
    weights: tuple[tuple[GridVolume, int], ...]  # grids, as in `Media.weights`


def _leaves(
    phase: Phase, share: float, weights: tuple[tuple[GridVolume, int], ...] = ()
) -> Iterator[_Leaf]:
    """Yield the leaves of a mixture with their weights, without weights of 0."""
    if isinstance(phase, BlendedPhase):
        weight = phase.weight
        if isinstance(weight, GridVolume):
            yield from _leaves(phase.first, share, (*weights, (weight, 0)))
            yield from _leaves(phase.second, share, (*weights, (weight, 1)))
        else:
            yield from _leaves(phase.first, share * (1.0 - weight), weights)
            yield from _leaves(phase.second, share * weight, weights)
    elif share > 0.0:
        yield _Leaf(phase, share, weights)


def _one_channel(grid: GridVolume) -> GridVolume:
    """Return a grid of the luminance of colours, as Mitsuba takes it of weights."""
    if grid.values.shape[3] == 1:
        return grid
    return replace(grid, values=grid.values @ np.array(LUMINANCE, np.float32)[:, None])


def _kind(phase: Phase) -> int:
    kinds: dict[type, int] = {
        HenyeyGreenstein: HENYEY_GREENSTEIN,
        RayleighPhase: RAYLEIGH,
        TabulatedPhase: TABULATED,
    }
    return kinds.get(type(phase), ISOTROPIC)


def _table(phase: Phase) -> NDArray[np.float64]:
    """Return the phase function at equally spaced cosines, and its integral up to them."""
    if not isinstance(phase, TabulatedPhase):
        return np.zeros((2, 0))
    values = np.array(phase.values)
    steps = (values[1:] + values[:-1]) / (len(values) - 1.0)
    integral = np.concatenate(([0.0], np.cumsum(steps)))
    return np.stack((values, integral)) / integral[-1]
