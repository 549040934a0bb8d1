"""Stage 3 in a replay: surface points with Mitsuba's rounding.

A mirror ball multiplies the distance of two paths by ten at each bounce, and (u, v) on a
floor of 140 x 140 is known to 8e-6. With other rounding a path would leave Mitsuba's path
after a few bounces. So hits are rounded as by Mitsuba and Embree. The fused operations and
the order of sums were found by trial; a test (tests/renderer/replay/test_replay_hits.py)
compares bits.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import renderer.replay.hits  # noqa: F401  (it implements `exact_hit`)
from renderer.integrators.stages.surface import Previous, keep_previous_points
from renderer.kernels.jit import kernel, method_kernel
from renderer.kernels.lanes.vectors import column, dot
from renderer.plugins.shapes.registry import kind_of_shape
from renderer.replay.exact_hits import EXACT, exact_hit, instance_matrices
from renderer.replay.hits import (
    embree_ray,
    mitsuba_ray,
    placed_normal,
    placed_point,
    placed_vector,
)
from renderer.scene_file.description import SceneDescription

_ZERO = np.float32(0.0)
_ONE = np.float32(1.0)
# A larger difference is not rounding: our value is kept, so that a replay shows it. The
# largest difference in our scenes is 1e-5, on a floor 140 wide.
ROUNDING = np.float32(1e-4)


class Rounding(NamedTuple):
    """The data of the rounded surface points of one kind of shape."""

    first: int  # the kind's primitives have the ids first .. end - 1
    end: int
    shapes: Any  # Mitsuba's numbers for the kind, see `exact_hit`
    instances: NDArray[np.float32]  # (24, n), see `instance_matrices`


def hooks_of_hits(
    description: SceneDescription, surfaces: dict[str, Any]
) -> list[tuple[Any, Any]]:
    """Return (kernel, record) of the hooks that run after the surface points are found."""
    instances = instance_matrices(description.instances)
    hooks: list[tuple[Any, Any]] = [(keep_previous_points, Previous())]
    for kind, table in surfaces.items():
        if (exact := EXACT.get(type(table))) is not None:
            shapes = [s for s in description.every_shape if kind_of_shape(s).name == kind]
            rounding = Rounding(table.first, table.end, exact(table, shapes), instances)
            hooks.append((round_surface_points, rounding))
    return hooks


@kernel
def _instance_number(placements, numbers, ray):
    if placements.group.size == 0:
        return np.int32(-1)
    return numbers[ray]


@kernel
def _round(rows, i, a):
    """Replace the vector in column i by `a` if they differ by rounding only."""
    old = column(rows, i)
    limit = ROUNDING * (_ONE + max(abs(old.x), max(abs(old.y), abs(old.z))))
    x, y, z = abs(a.x - old.x), abs(a.y - old.y), abs(a.z - old.z)
    if x <= limit and y <= limit and z <= limit:
        rows[0, i], rows[1, i], rows[2, i] = a.x, a.y, a.z


@kernel
def _replace_tangent(tangents, i, a):
    """Replace a tangent if it differs by rounding only in direction; lengths may differ."""
    old = column(tangents, i)
    scale = np.sqrt(dot(old, old) / dot(a, a))
    limit = ROUNDING * np.sqrt(dot(old, old))
    x, y, z = abs(a.x * scale - old.x), abs(a.y * scale - old.y), abs(a.z * scale - old.z)
    if x <= limit and y <= limit and z <= limit:
        tangents[0, i], tangents[1, i], tangents[2, i] = a.x, a.y, a.z


@kernel
def _round_uv(uv, i, u, v):
    if u is None:
        return
    apart = max(abs(uv[0, i] - u), abs(uv[1, i] - v))
    if apart <= ROUNDING * (_ONE + max(abs(u), abs(v))):
        uv[0, i], uv[1, i] = u, v


@kernel
def _round_normal(rows, i, a):
    """Replace the unit normal in column i, keeping its side of the surface."""
    if dot(column(rows, i), a) < _ZERO:
        a = -a
    _round(rows, i, a)


@method_kernel
def round_surface_points(rounding, placements, rays, hits, order, count, points):
    """Recompute position, normals and uv of hits in Mitsuba's order of operations.

    Only hits on one kind of shape are changed.
    """
    matrices = rounding.instances
    for i in range(count):
        ray = order[i]
        prim = hits.prim[ray]
        if prim < rounding.first or prim >= rounding.end:
            continue
        instance = _instance_number(placements, hits.instance, ray)
        o, d = column(rays.origin, ray), column(rays.direction, ray)
        found = exact_hit(
            rounding.shapes,
            prim - rounding.first,
            hits.u[ray],
            hits.v[ray],
            embree_ray(matrices, instance, o, d),
            mitsuba_ray(matrices, instance, o, d),
            instance >= 0,
        )
        _round(points.position, i, placed_point(placements, instance, found.position))
        _round_uv(points.uv, i, found.u, found.v)
        _round_normal(points.normal, i, placed_normal(matrices, instance, found.normal))
        normal = placed_normal(matrices, instance, found.vertex_normal)
        _round_normal(points.shading_normal, i, normal)
        tangent = placed_vector(placements, instance, found.tangent)
        _replace_tangent(points.tangent, i, tangent)
