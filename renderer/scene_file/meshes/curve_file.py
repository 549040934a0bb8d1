"""Files of curves: a control point `x y z radius` per line, an empty line between curves.

Numbers are separated by blanks and tabs; anything after the fourth is ignored.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.scene_file.meshes.mesh_data import (
    first_not_finite,
    parse_numbers,
    read_mesh_bytes,
    require_for_words,
    show_numbers,
)

_BYTES_A_WORD = 100  # at the peak: texts, lists and numbers


class CurveData(NamedTuple):
    """The control points of all curves of a file."""

    points: NDArray[np.float64]  # (n, 4) x, y, z, radius; finite, radii are not negative
    starts: NDArray[np.int64]  # (curves,) ascending: the first point of each


def read_curve_file(path: Path, least: int) -> CurveData:
    """Read a file of curves with at least `least` control points each.

    Raises
    ------
    SceneError
        With file and line: missing or unreadable file, fewer than four numbers or something
        else in a line, a number that is not finite, a radius below 0, a curve of too few
        points, no points.
    """
    content = read_mesh_bytes(path, "curve")
    require_for_words(content, _BYTES_A_WORD, path, "curve")
    texts: list[str] = []
    lines: list[int] = []
    starts: list[int] = []
    begins = True
    # latin-1 decodes every byte, so that messages can show it
    for number, line in enumerate(content.decode("latin-1").split("\n"), start=1):
        words = line.split()
        if not words:
            begins = True
            continue
        if len(words) < 4:
            raise SceneError(
                f"{path}:{number}: a control point needs x, y, z and a radius, found "
                f"`{line.strip()[:40]}`"
            )
        if begins:
            starts.append(len(lines))
            begins = False
        texts += words[:4]
        lines.append(number)
    if not lines:
        raise SceneError(f"{path}: no control points; expected lines of x, y, z and radius")
    points = parse_numbers(texts, lines, 4, "a control point", path)
    _check(points, starts, lines, least, path)
    return CurveData(points, np.array(starts, np.int64))


def _check(
    points: NDArray[np.float64], starts: list[int], lines: list[int], least: int, path: Path
) -> None:
    wrong = first_not_finite(points)
    if wrong >= 0:
        shown = show_numbers(points[wrong])
        raise SceneError(f"{path}:{lines[wrong]}: control point {shown} is not finite")
    if (points[:, 3] < 0.0).any():
        wrong = int(np.argmax(points[:, 3] < 0.0))
        raise SceneError(
            f"{path}:{lines[wrong]}: the radius {points[wrong, 3]:g} is negative; 0 or "
            "more is possible"
        )
    counts = np.diff([*starts, len(lines)])
    if (counts < least).any():
        short = int(np.argmax(counts < least))
        raise SceneError(
            f"{path}:{lines[starts[short]]}: a curve of {counts[short]} control points "
            f"begins here; it needs at least {least}"
        )
