"""The record of a scene's participating media."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

VACUUM = np.int32(-1)
NO_BOUNDARY = np.int32(-2)  # instead of a medium id: the surface is not a boundary

# kinds of phase functions
ISOTROPIC, HENYEY_GREENSTEIN, RAYLEIGH, TABULATED = 0, 1, 2, 3


class Grids(NamedTuple):
    """Volumes on grids; columns by grid id."""

    # (12 n,) per grid a matrix and a translation: from the world to cell coordinates
    to_cells: NDArray[np.float32]
    size: NDArray[np.int32]  # (3, n) cells along x, y, z
    channels: NDArray[np.int32]  # (n,) 1 or 3
    begin: NDArray[np.int32]  # (n,) index of its first number in `values`
    nearest: NDArray[np.int32]  # (n,) 1: nearest cell, 0: trilinear
    wrap: NDArray[np.int32]  # (n,) outside the cube: 0 clamp, 1 repeat, 2 mirror
    values: NDArray[np.float32]  # (m,) channels fastest, then x, z slowest


class Media(NamedTuple):
    """Media; columns by medium id."""

    count: int
    camera: int  # medium of the sensor, or VACUUM
    interior: NDArray[np.int32]  # (shapes,) medium id, VACUUM or NO_BOUNDARY
    exterior: NDArray[np.int32]  # (shapes,)
    sigma_t: NDArray[np.float32]  # (3, n) [1/length]; with a grid, the grid's factor
    albedo: NDArray[np.float32]  # (3, n)
    majorant: NDArray[np.float32]  # (n,) of a grid; 0: homogeneous
    sigma_grid: NDArray[np.int32]  # (n,) grid id, -1: constant
    albedo_grid: NDArray[np.int32]  # (n,)
    box: NDArray[np.float32]  # (6, n) bounds of a heterogeneous medium: two corners
    # the box is divided into cells, x fastest; the first cell of medium k is cells_begin[k]
    cells_along: NDArray[np.int32]  # (3, n)
    cells_begin: NDArray[np.int32]  # (n,)
    cells: NDArray[np.float32]  # (2, m) largest and smallest sigma_t over the colours
    # mixtures of phase functions: medium k has phase_begin[k] to phase_begin[k + 1] - 1
    phase_begin: NDArray[np.int32]  # (n + 1,)
    phase_kind: NDArray[np.int32]  # (m,)
    # (m,) weights, which sum to 1 in a medium unless grids multiply them: phase function k
    # has columns weight_begin[k] to weight_begin[k + 1] - 1 of `weights`
    phase_share: NDArray[np.float32]
    weight_begin: NDArray[np.int32]  # (m + 1,)
    # (2, k) grid id, and 1: multiply by the weight, 0: by 1 - weight
    weights: NDArray[np.int32]
    phase_g: NDArray[np.float32]  # (m,) of HENYEY_GREENSTEIN
    table_begin: NDArray[np.int32]  # (m + 1,) of TABULATED
    # (2, k) densities per cosine, and their integrals from -1 to that cosine
    table: NDArray[np.float32]
    grids: Grids
