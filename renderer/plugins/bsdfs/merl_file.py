"""Reader of measured BSDFs in the format of the MERL database, with sampling tables.

A `.binary` file [Matusik2003] has three integers, the numbers of cells in theta_h, theta_d
and phi_d (90, 90, 180 in the database), and then for red, green and blue one double per
cell, phi_d fastest. The angles are those of [Rusinkiewicz1998]: of the half vector to the
normal, and of a direction to the half vector. Cells of theta_h are denser at the highlight:
cell k of n begins at (k / n)^2 pi / 2.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.process.whole_file import write_whole

HEADER = 12  # bytes
SCALES = np.array([1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0])
"""Scale factors of the stored red, green and blue, defined by the format."""

MOST_CELLS = (1 << 24) // 3
"""Largest number of cells; the database has 1.5 million. float32 is exact below 2^24."""

_LUMINANCE = np.array([0.212671, 0.715160, 0.072169])


@dataclass(frozen=True, eq=False)
class MeasuredTable:
    """An isotropic BSDF, measured for all pairs of directions."""

    f: NDArray[np.float32]
    """[1/sr], (3, theta_h, theta_d, phi_d), at the centres of the cells."""

    @property
    def share_of_half_vectors(self) -> NDArray[np.float64]:
        """Return the probability of each cell of theta_h, for sampling half vectors.

        It is proportional to the light reflected by the cell for wo along the normal: the
        luminance of f, averaged over the directions around a half vector, times the
        projected solid angle of the reflected directions.
        """
        counts = self.f.shape
        theta_d = (np.arange(counts[2]) + 0.5) / counts[2] * np.pi / 2
        luminance = np.tensordot(_LUMINANCE, self.f, 1).mean(axis=2, dtype=np.float64)
        mean = luminance @ np.sin(2 * theta_d) / np.sin(2 * theta_d).sum()
        light = mean * _shares_by_cosine(counts[1])
        # dark cells need a positive probability: interpolation reaches into them
        light = light + 1e-3 * light.mean() + np.finfo(float).tiny
        return np.asarray(light / light.sum())

    @property
    def share_of_cosine(self) -> float:
        """Return the probability of sampling a direction by its cosine.

        It is the overlap between the half vectors of such directions, for wo along the
        normal, and those of the table: near 1 for a wall, small for polished metal.
        """
        by_cosine = _shares_by_cosine(self.f.shape[1])
        overlap = np.minimum(by_cosine, self.share_of_half_vectors).sum()
        return float(np.clip(overlap, 0.1, 0.9))


def edges_of_half_vectors(count: int) -> NDArray[np.float64]:
    """Return the bounds of the cells of theta_h [rad], (count + 1,)."""
    return np.asarray((np.arange(count + 1) / count) ** 2 * np.pi / 2)


def _shares_by_cosine(count: int) -> NDArray[np.float64]:
    """Return cell probabilities of the half vectors of the normal and cosine samples."""
    return np.asarray(
        np.diff(np.sin(2 * np.minimum(edges_of_half_vectors(count), np.pi / 4)) ** 2)
    )


def read_merl(path: Path) -> MeasuredTable:
    """Read a `.binary` file.

    Cells that could not be measured are negative in the database; they are black here.

    Raises
    ------
    SceneError
        If it cannot be read, its size does not match its header, or it has infinities.
    """
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            header = file.read(HEADER)
            counts = np.frombuffer(header[: len(header) // 4 * 4], "<i4").tolist()
            cells = _cells(path, counts, size)
            values = np.frombuffer(file.read(24 * cells), "<f8")
    except OSError as error:
        raise SceneError(f"{path.name}: {error.strerror or error}") from None
    # values beyond float32 become infinite; the cast warns of a signalling NaN
    with np.errstate(over="ignore", invalid="ignore"):
        f = np.maximum(values.reshape(3, -1) * SCALES[:, None], 0.0).astype(np.float32)
    if not (np.isfinite(values).all() and np.isfinite(f).all()):
        raise SceneError(f"{path.name}: a reflectance is infinite or not a number")
    return MeasuredTable(f.reshape(3, *counts))


def _cells(path: Path, counts: list[int], size: int) -> int:
    """Return the number of cells in the header, if it matches the size of the file."""
    if len(counts) != 3 or not all(2 <= n <= 4096 for n in counts):
        raise SceneError(
            f"{path.name}: begins with {counts}, no MERL file; expected the counts of "
            "theta_h, theta_d and phi_d, as 90, 90, 180"
        )
    cells = counts[0] * counts[1] * counts[2]
    if cells > MOST_CELLS:
        raise SceneError(f"{path.name}: {cells} cells; at most {MOST_CELLS} are possible")
    if size != (expected := HEADER + 24 * cells):
        shown = " x ".join(map(str, counts))
        raise SceneError(
            f"{path.name}: {size} bytes; three colours of {shown} cells are {expected}"
        )
    return cells


def write_merl(path: Path, f: NDArray[np.float64]) -> None:
    """Write reflectances [1/sr], (3, theta_h, theta_d, phi_d), as a `.binary` file."""
    values = (f.reshape(3, -1) / SCALES[:, None]).astype("<f8")
    write_whole(path, np.array(f.shape[1:], "<i4").tobytes() + values.tobytes())


def cell_centres(
    counts: tuple[int, int, int],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return theta_h, theta_d and phi_d [rad] at cell centres, as broadcastable arrays."""
    half, difference, turn = ((np.arange(n) + 0.5) / n for n in counts)
    return (
        half[:, None, None] ** 2 * np.pi / 2,
        difference[None, :, None] * np.pi / 2,
        turn[None, None, :] * np.pi,
    )
