"""A batch of paths as structure of arrays: the records that the stages hand on.

All arrays are float32 or int32 with one row for each component. A row has room for
`CAPACITY` paths and a padding that is no multiple of a power of two: rows that lie 4 or
8 KB apart fall into the same cache sets, which halved the speed in a trial.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.tally import make_tally

CAPACITY = 1024  # camera rays of a batch: one sample for each pixel of a 32 x 32 tile
PADDING = 48


class Rays(NamedTuple):
    """Rays to be traced, each with the state of its path."""

    origin: NDArray[np.float32]  # (3, n) world
    direction: NDArray[np.float32]  # (3, n) unit
    throughput: NDArray[np.float32]  # (3, n) product of BSDF * cos / pdf so far
    pdf: NDArray[np.float32]  # (n,) [1/sr] of the direction; 0: a mirror or the camera
    eta: NDArray[np.float32]  # (n,) product of relative indices of refraction
    slot: NDArray[np.int32]  # (n,) pixel of the tile that the path belongs to
    # (3, n) surface point that it left, which its origin is slightly off; None: nobody asks
    previous: Any = None
    point: Any = None  # (n,) its column in the batch's surface points; None: nobody asks


class Hits(NamedTuple):
    """The nearest hit of each ray."""

    t: NDArray[np.float32]  # (n,) in: the ray's end; out: the hit's distance
    prim: NDArray[np.int32]  # (n,) primitive id, -1 for a miss
    u: NDArray[np.float32]  # (n,) the primitive's own coordinates
    v: NDArray[np.float32]  # (n,)
    instance: Any = None  # (n,) int32 instance id, -1: none; None: the scene has none


class ShadowRays(NamedTuple):
    """Segments between surface points and lights, with what they carry if unblocked."""

    origin: NDArray[np.float32]  # (3, n) world
    direction: NDArray[np.float32]  # (3, n) unit
    t_max: NDArray[np.float32]  # (n,)
    radiance: NDArray[np.float32]  # (3, n) contribution to the pixel
    slot: NDArray[np.int32]  # (n,)
    blocked: NDArray[np.int32]  # (n,) 1 where something is in between


class SurfacePoints(NamedTuple):
    """Hits that have something to do next, grouped by it, with all that shading needs."""

    position: NDArray[np.float32]  # (3, n) world
    wo: NDArray[np.float32]  # (3, n) unit, back along the ray
    normal: NDArray[np.float32]  # (3, n) geometric, unit
    shading_normal: NDArray[np.float32]  # (3, n) unit
    offset: NDArray[np.float32]  # (n,) how far off the surface new rays start
    uv: NDArray[np.float32]  # (2, n)
    shape: NDArray[np.int32]  # (n,)
    prim: NDArray[np.int32]  # (n,)
    t: NDArray[np.float32]  # (n,)
    throughput: NDArray[np.float32]  # (3, n)
    pdf: NDArray[np.float32]  # (n,)
    eta: NDArray[np.float32]  # (n,)
    slot: NDArray[np.int32]  # (n,)
    tangent: Any = None  # (3, n) dp/du in world, not unit; None: nobody asks
    previous: Any = None  # (3, n) surface point before on the path; None: nobody asks


class Workspace(NamedTuple):
    """All arrays that one thread works in."""

    rays: Rays
    hits: Hits
    shadow_rays: ShadowRays
    points: SurfacePoints
    order: NDArray[np.int32]  # (n,) hits sorted by what they need next
    radiance: NDArray[np.float32]  # (channels, n) of each pixel of the tile
    waiting: NDArray[np.int64]  # (depths,) rays that wait at each depth of Whitted's tree
    tally: NDArray[np.int32] | None  # (ROWS, n) work of each ray; None: nobody counts


def _rows(count: int, capacity: int) -> NDArray[np.float32]:
    return np.zeros((count, capacity + PADDING), np.float32)


def _row(capacity: int, dtype: type = np.float32) -> NDArray:
    return np.zeros(capacity + PADDING, dtype)


def make_workspace(
    *,
    ray_capacity: int,
    shadow_capacity: int,
    channels: int,
    depths: int,
    counted: bool = False,
    instances: bool = False,
    replay: bool = False,
) -> Workspace:
    """Allocate for one thread.

    Parameters
    ----------
    ray_capacity : int
        Rays that can wait: `CAPACITY` for a path, more for Whitted's tree.
    shadow_capacity : int
        Shadow rays of one batch for one light.
    channels : int
        Numbers for each pixel: 3, and those of the AOVs.
    depths : int
        Generations of rays that can wait at the same time.
    counted : bool
        Whether the work of the rays is counted.
    instances : bool
        Whether the scene has any.
    replay : bool
        Whether what only a replay of Mitsuba asks for is kept: dp/du, previous points.
    """
    rays = Rays(
        _rows(3, ray_capacity),
        _rows(3, ray_capacity),
        _rows(3, ray_capacity),
        _row(ray_capacity),
        _row(ray_capacity),
        _row(ray_capacity, np.int32),
        _rows(3, ray_capacity) if replay else None,
        _row(ray_capacity, np.int32) if replay else None,
    )
    hits = Hits(
        _row(ray_capacity),
        _row(ray_capacity, np.int32),
        _row(ray_capacity),
        _row(ray_capacity),
        _row(ray_capacity, np.int32) if instances else None,
    )
    shadow_rays = ShadowRays(
        _rows(3, shadow_capacity),
        _rows(3, shadow_capacity),
        _row(shadow_capacity),
        _rows(3, shadow_capacity),
        _row(shadow_capacity, np.int32),
        _row(shadow_capacity, np.int32),
    )
    # a two-sided shape with two kinds of BSDF puts its hits in two groups
    points = 2 * CAPACITY
    surface_points = SurfacePoints(
        _rows(3, points),
        _rows(3, points),
        _rows(3, points),
        _rows(3, points),
        _row(points),
        _rows(2, points),
        _row(points, np.int32),
        _row(points, np.int32),
        _row(points),
        _rows(3, points),
        _row(points),
        _row(points),
        _row(points, np.int32),
        _rows(3, points) if replay else None,
        _rows(3, points) if replay else None,
    )
    order = _row(points, np.int32)
    radiance = _rows(channels, CAPACITY)
    waiting = np.zeros(depths, np.int64)
    tally = make_tally(ray_capacity) if counted else None
    return Workspace(
        rays, hits, shadow_rays, surface_points, order, radiance, waiting, tally
    )
