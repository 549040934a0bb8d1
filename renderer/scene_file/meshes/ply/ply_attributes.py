"""Attributes of PLY meshes: the fields that are no positions, put together by their names.

As Mitsuba's `ply` plugin does it: `r g b` or `red green blue` are the attribute
`vertex_color`; others are a name, `_` and a letter or digit, in the order of one of the
sequences below: `heat_x` is `vertex_heat`, but of letters of a colour `vertex_heat_color`.
"""

from __future__ import annotations

from itertools import takewhile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.scene_file.meshes.ply.ply_records import Columns

_COLORS = (("r", "g", "b", "a"), ("red", "green", "blue", "alpha"))
_SEQUENCES = ("xyz", "rgb", "012", "123")
_KNOWN = {"x", "y", "z", "nx", "ny", "nz", "u", "v", "s", "t", "texture_u", "texture_v"}


def ply_attributes(
    columns: Columns, element: str, path: Path
) -> tuple[dict[str, NDArray[np.float64]], list[str]]:
    """Return the attributes of the vertices or faces, (records, size), and warnings."""
    fields = [name for name, column in columns.items() if column.ndim == 1]
    found: dict[str, list[str]] = {}
    for color in _COLORS:
        if set(color[:3]) <= set(fields):
            found[f"{element}_color"] = [name for name in color if name in fields]
            break
    taken = {name for names in found.values() for name in names}
    left = [name for name in fields if name not in taken | _KNOWN]
    warnings = []
    while left:
        run = _next_run(left)
        left = left[len(run) :]
        name = _name_of(run, element)
        if name is None or name in found:
            listed = ", ".join(f"`{field}`" for field in run)
            warnings.append(f"{path}: {element} fields {listed} make no attribute")
        else:
            found[name] = run
    attributes = {}
    for name, names in found.items():
        values = np.column_stack([columns[field] for field in names])
        largest = np.nanmax(values, initial=0.0)
        if name.endswith("_color") and largest > 1.0:
            warnings.append(
                f"{path}: {name} is up to {largest:g}; as in Mitsuba it is not "
                "divided by 255"
            )
        attributes[name] = values
    return attributes, warnings


def _next_run(fields: list[str]) -> list[str]:
    """Return the first fields that have one name before `_`, if a sequence begins there."""
    prefix, _, letter = fields[0].rpartition("_")
    if not prefix or letter not in {sequence[0] for sequence in _SEQUENCES}:
        return fields[:1]
    same = (field.rpartition("_")[0] == prefix for field in fields)
    return [field for field, _ in zip(fields, takewhile(bool, same), strict=False)]


def _name_of(run: list[str], element: str) -> str | None:
    """Return the attribute that fields make, or None if they make no attribute."""
    prefix = run[0].rpartition("_")[0]
    letters = "".join(field.rpartition("_")[2] for field in run)
    possible = [s for s in _SEQUENCES if letters in (s, s[:1])]
    if not prefix or not possible or len(letters) != len(run):
        return None
    return f"{element}_{prefix}" + ("_color" if possible[0] == "rgb" else "")
