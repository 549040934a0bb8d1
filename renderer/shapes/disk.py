"""Ray against disk (under any affine map an ellipse): the plane, then u^2 + v^2 <= 1."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.jit import kernel
from renderer.lanes.functions import any_of, fabs
from renderer.shapes.patch import (
    Intersection,
    divided,
    grazing,
    meet_plane,
    meet_plane_in_double,
)


class Disks(NamedTuple):
    """Disks: the corner is the centre, the edges are the two half axes."""

    corner: NDArray[np.float32]  # (3, n)
    edge1: NDArray[np.float32]  # (3, n)
    edge2: NDArray[np.float32]  # (3, n)
    normal: NDArray[np.float32]  # (3, n) edge1 x edge2, not normalised
    id: NDArray[np.int32]  # (n,) primitive id in the scene
    count: int  # n without the padding


@kernel
def _doubtful(disk, p, direction):
    around = (fabs(p.u) <= p.scale) & (fabs(p.v) <= p.scale)
    return around & grazing(disk, p, direction)


@kernel
def _within(p, t_max):
    # divided first: the squares of the undivided numbers of a tiny disk would underflow
    x = divided(p, p.scale > 0.0, t_max)
    return Intersection(x.hit & (x.u * x.u + x.v * x.v <= 1.0), x.t, x.u, x.v)


@kernel
def hit_disk(disk, origin, direction, t_max):
    """Intersect; hits have 0 < t <= t_max, u and v are the local x and y."""
    p = meet_plane(disk, origin, direction)
    doubtful = _doubtful(disk, p, direction)
    if any_of(doubtful):
        p = meet_plane_in_double(disk, origin, direction, doubtful, p)
    return _within(p, t_max)
