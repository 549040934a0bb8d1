"""MeshData: triangles as a mesh file gives them, before any transform."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.process import memory

_BLANKS = bytes(b for b in range(256) if chr(b).isspace())  # between words of latin-1


@dataclass(frozen=True, eq=False)
class MeshData:
    """Triangles in local coordinates, checked: finite, and every index in range."""

    vertices: NDArray[np.float64]  # (V, 3) finite
    faces: NDArray[np.int32]  # (F, 3) in [0, V), F >= 1; degenerate ones still in
    normals: NDArray[np.float64] | None = None  # (V, 3), any length; a NaN row: not given
    uvs: NDArray[np.float64] | None = None  # (V, 2) finite
    source: str = "<memory>"  # for messages: the file
    warnings: tuple[str, ...] = ()  # for the log
    # "vertex_..." (V, size) and "face_..." (F, size), finite
    attributes: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)


def read_mesh_bytes(path: Path) -> bytes:
    """Read a whole mesh file, or say in one line why that is not possible."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise SceneError(f"{path}: no such mesh file") from None
    except OSError as error:
        raise SceneError(f"{path}: cannot read it: {error.strerror}") from None
    if not content:
        raise SceneError(f"{path}: the mesh file is empty")
    return content


def require_for_words(content: bytes, each: int, path: Path) -> None:
    """Refuse a text of more words than there is memory, `each` bytes for one at the peak.

    Raises
    ------
    NotAllowed
        With both numbers.
    """
    gaps = len(content) - len(content.translate(None, _BLANKS))
    memory.require(each * gaps + 3 * len(content), f"{path}: the mesh")


def first_not_finite(rows: NDArray[np.float64]) -> int:
    """Return the first row with a value that float32 cannot hold (NaN, infinite), or -1.

    Parameters
    ----------
    rows
        (N, K) values, about to become float32.
    """
    # Written with <= so that a NaN, which compares false, counts as bad.
    good = (np.abs(rows) <= np.finfo(np.float32).max).all(axis=1)
    return -1 if good.all() else int(np.argmin(good))


def first_out_of_range(faces: NDArray[np.float64], vertex_count: int) -> int:
    """Return the first face with an index not among 0, 1, ..., vertex_count - 1, or -1."""
    good = ((faces >= 0) & (faces < vertex_count) & (faces == np.floor(faces))).all(axis=1)
    return -1 if good.all() else int(np.argmin(good))


def clear_zero_normals(
    normals: NDArray[np.float64], faces: NDArray[np.int32], source: Path | str
) -> None:
    """Refuse normals without direction where a face needs them; NaN ("none") elsewhere."""
    zero = ~normals.any(axis=1)
    used = np.zeros(len(normals), dtype=bool)
    used[faces] = True
    if (zero & used).any():
        raise SceneError(
            f"{source}: normal (0, 0, 0) of vertex {int(np.argmax(zero & used))} "
            "has no direction"
        )
    normals[zero] = np.nan


def show_numbers(values: Sequence[float] | NDArray[np.float64]) -> str:
    """Return `(1, nan, 0.5)`, the form of a point in messages."""
    return "(" + ", ".join(f"{value:.9g}" for value in values) + ")"
