"""The record of a scene's participating media."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

VACUUM = np.int32(-1)
NO_BOUNDARY = np.int32(-2)  # in place of a medium: the surface is not a boundary

# kinds of phase functions
ISOTROPIC, HENYEY_GREENSTEIN, RAYLEIGH, TABULATED = 0, 1, 2, 3


class Grids(NamedTuple):
    """Volumes that vary; columns by grid id."""

    # (12 n,) of each grid a matrix and a translation: the world in coordinates of cells
    to_cells: NDArray[np.float32]
    size: NDArray[np.int32]  # (3, n) cells along x, y, z
    channels: NDArray[np.int32]  # (n,) 1 or 3
    begin: NDArray[np.int32]  # (n,) of its numbers
    nearest: NDArray[np.int32]  # (n,) 1: the cell's own number, 0: trilinear
    wrap: NDArray[np.int32]  # (n,) beyond the cube: 0 clamp, 1 repeat, 2 mirror
    values: NDArray[np.float32]  # (m,) channels fastest, then x, z slowest


class Media(NamedTuple):
    """Columns by medium id."""

    count: int
    camera: int  # that of the sensor, or VACUUM
    interior: NDArray[np.int32]  # (shapes,) medium id, VACUUM or NO_BOUNDARY
    exterior: NDArray[np.int32]  # (shapes,)
    sigma_t: NDArray[np.float32]  # (3, n) [1/length]; of a grid its factor
    albedo: NDArray[np.float32]  # (3, n)
    majorant: NDArray[np.float32]  # (n,) of a grid; 0: the same sigma_t everywhere
    sigma_grid: NDArray[np.int32]  # (n,) grid id, -1: constant
    albedo_grid: NDArray[np.int32]  # (n,)
    box: NDArray[np.float32]  # (6, n) where a heterogeneous medium is: two corners
    # the box is divided into cells, x fastest; those of medium k begin at begin[k]
    cells_along: NDArray[np.int32]  # (3, n)
    cells_begin: NDArray[np.int32]  # (n,)
    cells: NDArray[np.float32]  # (2, m) largest and smallest sigma_t of any colour
    # mixtures of phase functions: those of medium k are begin[k] to begin[k + 1] - 1
    phase_begin: NDArray[np.int32]  # (n + 1,)
    phase_kind: NDArray[np.int32]  # (m,)
    # (m,) sums to 1 in a medium, but where grids of weights multiply it: those of phase
    # function k are columns weight_begin[k] to weight_begin[k + 1] - 1
    phase_share: NDArray[np.float32]
    weight_begin: NDArray[np.int32]  # (m + 1,)
    # (2, k) grid id, and 1: the share is multiplied by the weight, 0: by 1 - weight
    weights: NDArray[np.int32]
    phase_g: NDArray[np.float32]  # (m,) of HENYEY_GREENSTEIN
    table_begin: NDArray[np.int32]  # (m + 1,) of TABULATED
    # (2, k) densities per cosine, and their integrals from -1 up to there
    table: NDArray[np.float32]
    grids: Grids
