"""The same questions of every volume: `VOLUMES` for Python, `hits_volume` for kernels."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from renderer.accelerators.bounding_volumes.aabb import (
    Aabb,
    area_aabb,
    contains_aabb,
    fit_aabb,
    hits_aabb,
)
from renderer.accelerators.bounding_volumes.k_dop import (
    KDop,
    area_k_dop,
    contains_k_dop,
    fit_k_dop,
    hits_k_dop,
)
from renderer.accelerators.bounding_volumes.obb import (
    Obb,
    area_obb,
    contains_obb,
    fit_obb,
    hits_obb,
)
from renderer.accelerators.bounding_volumes.sphere import (
    BoundingSphere,
    area_sphere,
    contains_sphere,
    fit_sphere,
    hits_sphere,
)
from renderer.kernels.jit import entry_kernel, record_class
from renderer.kernels.lanes.functions import first_lanes, select, splat_i32
from renderer.kernels.lanes.memory import load_row, store_row
from renderer.kernels.lanes.vectors import load3


class Volume(NamedTuple):
    """What one kind of volume can do, outside of kernels."""

    fit: Callable[..., Any]  # (points (3, n), radius (n,) or a number) -> record
    area: Callable[[Any], float]  # of a record
    contains: Callable[..., NDArray[np.bool_]]  # (record, points, radius) -> (n,)


def _k_dop(directions: int) -> Volume:
    fit = partial(fit_k_dop, directions=directions)
    return Volume(fit, area_k_dop, contains_k_dop)


VOLUMES = {
    "sphere": Volume(fit_sphere, area_sphere, contains_sphere),
    "AABB": Volume(fit_aabb, area_aabb, contains_aabb),
    "OBB": Volume(fit_obb, area_obb, contains_obb),
    "6-DOP": _k_dop(6),
    "10-DOP": _k_dop(10),
    "14-DOP": _k_dop(14),
}
_HITS = {BoundingSphere: hits_sphere, Aabb: hits_aabb, Obb: hits_obb, KDop: hits_k_dop}


def hits_volume(volume: Any, origin: Any, direction: Any, t_max: Any) -> Any:
    """Return whether rays meet a volume of any kind; one ray, or 16 in lanes."""
    raise TypeError("inside kernels only")


@overload(hits_volume)
def _hits_volume(volume, origin, direction, t_max):
    hits = _HITS.get(record_class(volume))
    if hits is None:
        return None
    return lambda volume, origin, direction, t_max: hits(volume, origin, direction, t_max)


@entry_kernel
def which_hit(volume, origin, direction, t_max, count, found):
    """Set `found` (n,) to 1 for those of the first `count` rays that hit a volume, else 0.

    Origins and directions (3, n), all arrays with room for 16 rays more.
    """
    for i in range(0, count, 16):
        t = load_row(t_max, 0, i)
        hit = hits_volume(volume, load3(origin, i), load3(direction, i), t)
        hit = hit & first_lanes(count - i)
        store_row(found, 0, i, select(hit, splat_i32(1), splat_i32(0)))
