"""Make the grids of the scenes here: `python tests/plugins/make_grids.py`.

The files are committed; they are of as few points as show every case.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent / "grids"


def places(nx: int, ny: int, nz: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return x, y and z in [0, 1] of all points, (nz, ny, nx) each."""
    axes = [np.linspace(0.0, 1.0, n) for n in (nz, ny, nx)]
    z, y, x = np.meshgrid(*axes, indexing="ij")
    return x, y, z


def torus(nx: int, ny: int, nz: int) -> np.ndarray:
    """Return distances to a torus around y, which is inside of the grid."""
    x, y, z = (a - 0.5 for a in places(nx, ny, nz))
    return np.hypot(np.hypot(x, z) - 0.3, y) - 0.14


def waves(nx: int, ny: int, nz: int) -> np.ndarray:
    """Return a wavy floor, which leaves the grid through its sides, in a fat ball."""
    x, y, z = places(nx, ny, nz)
    floor = y - 0.5 - 0.2 * np.sin(7.0 * x) * np.cos(5.0 * z + x)
    ball = np.sqrt((x - 0.6) ** 2 + (y - 0.5) ** 2 + (z - 0.4) ** 2) - 0.62
    return np.maximum(floor, ball)


def grid_file(numbers: np.ndarray, **changes: object) -> bytes:
    """Return a file; `changes` are what its header says instead of the truth."""
    nz, ny, nx, *channels = numbers.shape
    said = {"mark": b"VOL", "version": 3, "kind": 1, "nx": nx, "ny": ny, "nz": nz}
    said |= {"channels": (*channels, 1)[0], "box": (0, 0, 0, 1, 1, 1), **changes}
    box = said.pop("box")
    header = struct.pack("<3sB5i6f", *said.values(), *box)
    return header + numbers.astype("<f4").tobytes()


if __name__ == "__main__":
    HERE.mkdir(exist_ok=True)
    (HERE / "torus.vol").write_bytes(grid_file(torus(13, 9, 13)))
    (HERE / "waves.vol").write_bytes(grid_file(waves(12, 12, 12)))
    smoke = np.random.default_rng(5).uniform(0.0, 1.0, (3, 4, 5)) ** 3.0
    (HERE / "smoke.vol").write_bytes(grid_file(smoke))
    # beyond 1 it is clamped, between the points and not at them
    weights = np.random.default_rng(6).uniform(0.0, 1.6, (4, 3, 3))
    (HERE / "weights.vol").write_bytes(grid_file(weights))
    colors = np.random.default_rng(4).uniform(0.05, 0.95, (2, 3, 4, 3))
    (HERE / "colors.vol").write_bytes(grid_file(colors))
