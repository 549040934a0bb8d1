"""What both kinds of curves share: how they are read, their tables, the angle around them.

Only front faces are hit, as in Mitsuba, whose Embree culls the back faces of curves. So a
ray that starts inside of a curve leaves it without a hit: glass is left unrefracted.
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import by_columns, kernel
from renderer.kernels.lanes.functions import fabs, select, sqrt
from renderer.kernels.lanes.vectors import cross, dot, select3, vec3
from renderer.plugins.shapes.scalar_shapes import refuse_lamp
from renderer.plugins.shapes.surface import turn
from renderer.scene_file.description import Curves
from renderer.scene_file.meshes.curve_file import CurveData, read_curve_file
from renderer.scene_file.transforms import place_points

Description = TypeVar("Description", bound=Curves)


class CurveSurfaces(NamedTuple):
    """Parts of curves, by primitive id; the class of each kind derives from this one."""

    first: int  # the primitive ids are first .. end - 1
    end: int
    numbers: NDArray[np.float32]  # (k, n) the fields of the kind's primitive
    place: NDArray[np.float32]  # (2, n) v where a part begins, and how far v runs along it


@kernel
def unit_or(a, otherwise):
    """Return a / |a|; `otherwise` where a is 0."""
    square = dot(a, a)
    inverse = 1.0 / sqrt(select(square > 0.0, square, 1.0))
    return select3(square > 0.0, a * inverse, otherwise)


@kernel
def upwards(x):
    """Return the unit vector along z in as many lanes as x has."""
    return vec3(x * 0.0, x * 0.0, x * 0.0 + 1.0)


@kernel
def angle_around(axis, q):
    """Return the angle of q around a unit axis as a fraction of a turn in [0, 1).

    It is 1/4 where z, or y around an axis along z, has its part across the axis.
    """
    along_z = fabs(axis.z) >= 1.0
    zero = axis.x * 0.0
    across = axis.x * axis.x + axis.y * axis.y  # 1 - z^2
    quarter = vec3(-axis.x * axis.z, -axis.y * axis.z, across)
    quarter = select3(along_z, vec3(zero, zero + 1.0, zero), quarter)
    return turn(dot(cross(quarter, axis), q), dot(quarter, q))


# ------------------------------------------------------------------------------- tables


def read_curves(
    properties: Any, common: dict[str, Any], description: type[Description], least: int
) -> Description:
    """Read the properties of a file; a curve has `least` control points or more."""
    refuse_lamp(properties, common)
    data: CurveData = properties.file(
        "the curves",
        "the path of a text file with x, y, z and radius of a control point in each line",
        lambda path: read_curve_file(path, least),
    )
    to_world = properties.transform("to_world")  # of the points and not of the radii
    with np.errstate(over="ignore", invalid="ignore"):  # too far is said by the reader
        placed = place_points(to_world, data.points[:, :3])
    points = np.column_stack([placed, data.points[:, 3].astype(np.float32)])
    return description(**common, points=points, starts=data.starts)


def first_points(shape: Curves, width: int) -> NDArray[np.int64]:
    """Return the first control point of each segment, which has `width` of them."""
    count = len(shape.points)
    ends = np.append(shape.starts[1:], count)
    points = np.arange(count)
    of_curve = np.repeat(ends, ends - shape.starts)
    return points[points + width <= of_curve]


def record(kind: Any, first: int, numbers: list[Any], places: list[Any]) -> Any:
    """Return the table of a kind from numbers (n, k) and places (n, 2) of all shapes."""
    rows = np.concatenate(numbers)
    place = np.concatenate(places).T
    return kind(
        first,
        first + len(rows),
        by_columns(rows.T),
        np.ascontiguousarray(place, np.float32),
    )
