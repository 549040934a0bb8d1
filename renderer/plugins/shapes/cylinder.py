"""Ray against open cylinder: the sphere's stable quadratic, perpendicular to the axis."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.fields import Number, Vector
from renderer.kernels.lanes.functions import select, splat_f32
from renderer.kernels.lanes.mathematics import sincos
from renderer.kernels.lanes.memory import gather_row
from renderer.kernels.lanes.vectors import dot, gather3, gather_rows3, normalize, vec3
from renderer.plugins.sampling.numbers_and_warps import TWO_PI
from renderer.plugins.shapes.flat import ZERO
from renderer.plugins.shapes.kind import ShapeKind
from renderer.plugins.shapes.primitives import Intersection, float32
from renderer.plugins.shapes.sphere import meet_round
from renderer.plugins.shapes.surface import (
    ROUNDING,
    LightPoint,
    SurfacePoint,
    around_axis,
    magnitude,
    nowhere,
    turn,
)
from renderer.scene_file import transforms
from renderer.scene_file.description import Cylinder as Description
from renderer.scene_file.objects.objects import STRETCH, placed


class Cylinder(NamedTuple):
    """One cylinder without caps, or 16 in lanes."""

    base: Vector  # centre of the lower end
    axis: Vector  # unit
    radius: Number
    height: Number


@kernel
def hit_cylinder(cylinder, origin, direction, t_max):
    """Intersect; hits have 0 < t <= t_max, v is the height as a fraction, u is 0.

    The nearer root is the hit if it lies between the ends, otherwise the farther one: the
    ray may enter through an open end.
    """
    f = origin - cylinder.base
    f_axis = dot(f, cylinder.axis)
    d_axis = dot(direction, cylinder.axis)
    f_across = f - cylinder.axis * f_axis
    d_across = direction - cylinder.axis * d_axis
    discriminant, first, second = meet_round(f_across, d_across, cylinder.radius)
    h_first = f_axis + first * d_axis
    h_second = f_axis + second * d_axis
    near = (first > 0.0) & (h_first >= 0.0) & (h_first <= cylinder.height)
    far = (second > 0.0) & (h_second >= 0.0) & (h_second <= cylinder.height)
    t = select(near, first, second)
    hit = (discriminant >= 0.0) & (near | far) & (t <= t_max)
    return Intersection(hit, t, t * ZERO, select(near, h_first, h_second) / cylinder.height)


# ------------------------------------------------------------------ surface and light


class CylinderSurfaces(NamedTuple):
    """Cylinders with primitive ids first .. end - 1."""

    first: int
    end: int
    base: NDArray[np.float32]  # (3, n)
    radius: NDArray[np.float32]  # (n,)
    height: NDArray[np.float32]  # (n,)
    frame: NDArray[np.float32]  # (9, n) unit local x, y, z axes in world space

    @property
    def axis(self) -> NDArray[np.float32]:
        """(3, n) unit, from the lower to the upper end."""
        return self.frame[6:9]


@kernel
def _point_on_cylinder(cylinders, index, mask, u, height, hit_point, with_uv):
    """Return the point; its texture coordinates are (angle / 2 pi, height)."""
    base = gather3(cylinders.base, index, mask)
    axis = gather_rows3(cylinders.frame, 6, index, mask)
    radius = gather_row(cylinders.radius, 0, index, mask)
    length = gather_row(cylinders.height, 0, index, mask)
    from_base = hit_point - base
    along = dot(from_base, axis)
    normal = normalize(from_base - axis * along)
    position = base + axis * along + normal * radius
    offset = (magnitude(base) + radius + length) * ROUNDING
    angle = height
    if with_uv != 0:
        x = dot(gather_rows3(cylinders.frame, 0, index, mask), normal)
        y = dot(gather_rows3(cylinders.frame, 3, index, mask), normal)
        angle = turn(x, y)
    return SurfacePoint(position, normal, normal, nowhere(mask), offset, angle, height)


@kernel
def _sample_cylinder(cylinders, kind, light, mask, position, x, y, z):
    """Choose a point of the lateral surface, uniformly by area."""
    areas = kind.lights
    index = gather_row(areas.prim, 0, light, mask) - cylinders.first
    sine, cosine = sincos(TWO_PI * y)
    frame = cylinders.frame
    local_x = gather_rows3(frame, 0, index, mask)
    local_y = gather_rows3(frame, 3, index, mask)
    axis = gather_rows3(frame, 6, index, mask)
    n = local_x * cosine + local_y * sine
    along = axis * (gather_row(cylinders.height, 0, index, mask) * x)
    point = gather3(cylinders.base, index, mask) + along
    point = point + n * gather_row(cylinders.radius, 0, index, mask)
    side = n * gather_row(areas.orientation, 0, light, mask)
    return LightPoint(point - position, n, side)


@kernel
def _uv_axes(cylinders, q, radius):
    none = splat_f32(0.0)
    return vec3(-q.y, q.x, none) * TWO_PI, vec3(none, none, splat_f32(1.0))


# ---------------------------------------------------------------------------- tables


def read(properties: Any, common: dict[str, Any]) -> Description:
    """Read the properties of a `cylinder`."""
    p0 = np.array(properties.vector("p0", (0.0, 0.0, 0.0)))
    p1 = np.array(properties.vector("p1", (0.0, 0.0, 1.0)))
    radius = properties.number("radius", 1.0, above=0.0)
    axis = p1 - p0
    length = float(np.linalg.norm(axis))
    if not length > 0.0:
        properties.fail("p1", "the same point as p0", "another point")
    to_world = properties.transform("to_world")
    local = transforms.translate(*p0) @ transforms.z_to(axis)
    full = placed(properties, to_world @ local @ transforms.scale(radius, radius, length))
    lengths = transforms.column_lengths(full)
    if (
        transforms.has_shear(full)
        or abs(lengths[0] - lengths[1]) > STRETCH * lengths[:2].max()
    ):
        properties.fail(
            "to_world",
            "a transform that makes the tube elliptic or slanted",
            "a rotation, translation and uniform scale",
        )
    radiance = common["radiance"]
    if radiance is not None and not isinstance(radiance, tuple):
        raise SceneError(
            f"{properties.location}: {properties.element} emits a texture, whose points "
            "Mitsuba puts in wrong places on a cylinder; expected one colour"
        )
    if radiance is not None and transforms.mirrors(to_world):
        properties.fail(
            "to_world",
            "a mirrored cylinder that emits, whose two sides Mitsuba confuses",
            "a transform without reflection",
        )
    flip = properties.boolean("flip_normals", False)
    return Description(**common, to_world=full, flip_normals=flip)


def surfaces(shapes: list[Description], first: int) -> CylinderSurfaces:
    """Return the surfaces of shapes with primitive ids from `first` on."""
    matrices = np.array([shape.to_world for shape in shapes])
    lengths = np.linalg.norm(matrices[:, :3, :3], axis=1)  # of the three columns of each
    frame = matrices[:, :3, :3] / lengths[:, None, :]
    return CylinderSurfaces(
        first,
        first + len(shapes),
        float32(matrices[:, :3, 3].T),
        float32(lengths[:, 0]),
        float32(lengths[:, 2]),
        float32(frame.transpose(0, 2, 1).reshape(-1, 9).T),
    )


def _corners(s: Any) -> list[NDArray[np.float32]]:
    axis = s.axis
    x, y, z = axis  # not sqrt(1 - axis^2), which is 0 for a slightly tilted axis
    reach = s.radius * np.hypot([y, z, x], [z, x, y])
    top = s.base + axis * s.height
    return [s.base - reach, s.base + reach, top - reach, top + reach]


def _hull(s: Any, order: Any) -> tuple[Any, Any, Any]:
    base, axis = s.base[:, order], s.axis[:, order]
    top = base + axis * s.height[order]
    points = np.stack([base, top, base, top], 1)
    return points, s.radius[order], np.zeros((3, len(order)), np.float32)


def _areas(s: Any, k: Any) -> NDArray[np.float64]:
    return 2.0 * np.pi * s.radius[k].astype(np.float64) * s.height[k]


CYLINDERS = ShapeKind(
    name="cylinders",
    plugins={"cylinder": read},
    description=Description,
    record=CylinderSurfaces,
    surfaces=surfaces,
    primitive=Cylinder,
    intersect=hit_cylinder,
    surface_point=_point_on_cylinder,
    tangent=around_axis,
    sample=_sample_cylinder,
    uv_axes=_uv_axes,
    corners=_corners,
    hull=_hull,
    areas=_areas,
)
