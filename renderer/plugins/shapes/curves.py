"""Code shared by both kinds of curves: reader, tables, angle around the axis.

Only front faces are hit, as in Mitsuba, where Embree culls the back faces of curves. So a
ray that starts inside of a curve leaves it without a hit: curves of glass do not refract.
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
    """Pieces of curves by primitive id; base class of the records of both kinds."""

    first: int  # the primitive ids are first .. end - 1
    end: int
    numbers: NDArray[np.float32]  # (k, n) the fields of the kind's primitive
    place: NDArray[np.float32]  # (2, n) v at the start of a piece, and its range of v


@kernel
def unit_or(a, otherwise):
    """Return a / |a|, or `otherwise` where a is 0."""
    square = dot(a, a)
    inverse = 1.0 / sqrt(select(square > 0.0, square, 1.0))
    return select3(square > 0.0, a * inverse, otherwise)


@kernel
def upwards(x):
    """Return the unit vector z in as many lanes as x has."""
    return vec3(x * 0.0, x * 0.0, x * 0.0 + 1.0)


@kernel
def angle_around(axis, q):
    """Return the angle of q around a unit axis as a fraction of a turn in [0, 1).

    The angle is 1/4 for the projection of z perpendicular to the axis; of y if the axis
    is z.
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
    """Read the properties of a curve, which needs at least `least` control points."""
    refuse_lamp(properties, common)
    data: CurveData = properties.file(
        "the curves",
        "the path of a text file with x, y, z and radius of a control point in each line",
        lambda path: read_curve_file(path, least),
    )
    to_world = properties.transform("to_world")  # applies to the points, not to the radii
    with np.errstate(over="ignore", invalid="ignore"):  # the reader reports overflow
        placed = place_points(to_world, data.points[:, :3])
    points = np.column_stack([placed, data.points[:, 3].astype(np.float32)])
    return description(**common, points=points, starts=data.starts)


def first_points(shape: Curves, width: int) -> NDArray[np.int64]:
    """Return the index of the first of the `width` control points of each segment."""
    count = len(shape.points)
    ends = np.append(shape.starts[1:], count)
    points = np.arange(count)
    of_curve = np.repeat(ends, ends - shape.starts)
    return points[points + width <= of_curve]


def record(kind: Any, first: int, numbers: list[Any], places: list[Any]) -> Any:
    """Return the table of a kind from numbers (n, k) and places (n, 2) of its shapes."""
    rows = np.concatenate(numbers)
    place = np.concatenate(places).T
    return kind(
        first,
        first + len(rows),
        by_columns(rows.T),
        np.ascontiguousarray(place, np.float32),
    )
