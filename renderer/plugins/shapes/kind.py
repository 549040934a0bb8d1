"""`ShapeKind`: the description, tables and kernels that a kind of shape consists of."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.lanes.fields import form_of, size_of
from renderer.plugins.shapes.primitives import Group, intersect
from renderer.plugins.shapes.scalar_shapes import (
    ScalarGroup,
    intersect_scalar,
    point_alone,
)
from renderer.plugins.shapes.surface import (
    pdf_by_area,
    pdf_shape,
    point_at_uv,
    sample_shape,
    surface_point,
    tangent_at,
)
from renderer.plugins.shapes.uv import derivatives_by_place, no_derivatives, uv_axes
from renderer.scene_file.coordinate_limits import FARTHEST

LANES = 16  # columns of padding in a group: 16 lanes can be loaded from any primitive


def flipped(shape: Any) -> float:
    """Return the orientation of shapes whose normal is flipped by `flip_normals` alone."""
    return -1.0 if shape.flip_normals else 1.0


def one_face(shape: Any) -> NDArray[np.int64]:
    """Return the primitive numbers of a shape that is a single primitive."""
    return np.zeros(1, np.int64)


def no_area(surfaces: Any, columns: Any) -> NDArray[np.float64]:
    """Return zeros, for kinds that cannot be area lights."""
    return np.zeros(len(columns))


@dataclass(frozen=True, kw_only=True)
class ShapeKind:
    """One kind of shape, made available by `registry.register_shape`.

    Its kernels implement the interfaces named below, which document arguments and results.

    Parameters
    ----------
    name
        Name of the kind, in the plural.
    plugins
        Plugin name in scene files -> function of (properties of the file, the fields
        that all shapes have) that returns the description.
    description
        Class of the scene description.
    record
        Class of the table of its primitives: a NamedTuple with primitive ids `first`
        and `end`, and arrays.
    surfaces
        (shapes, first primitive id) -> the table of these shapes.
    primitive
        Class of one primitive as an accelerator stores it; its fields are annotated as
        described in `kernels.lanes.fields`. None: rays are intersected with one
        primitive at a time, in double precision, see `scalar_shapes`.
    numbers
        (table, columns) -> the fields of the primitives as arrays (3, n) or (n,). None:
        they are the table's arrays of the same names.
    fill
        (table, columns, rows): writes these fields to the first columns of `rows`,
        (numbers of a primitive, n). None: done with `numbers`.
    intersect
        Kernel, `primitives.intersect`; without a `primitive`, `intersect_scalar`.
    point
        Kernel, `scalar_shapes.point_alone`; used only without a `primitive`.
    surface_point, tangent, sample, pdf, point_at_uv
        Kernels, see `surface`. Without `sample` the kind cannot be an area light,
        without `point_at_uv` not one with textured radiance.
    corners
        table -> arrays (3, n); the box of these points contains each primitive.
    boxes
        table -> lower and upper corners (3, n), padded (`extents.primitive_bounds`).
        None: computed from `corners`.
    hull
        (table, columns) -> points (3, 4, n), radius (n,) and normal (3, n). A primitive
        lies in the convex hull of its points, grown by the radius. A flat primitive
        lies in the plane with this normal; the normal is 0 if it is not flat.
    areas
        (table, columns) -> surface areas (n,), float64.
    uv_axes
        Kernel, see `uv.uv_derivatives`: dp/du and dp/dv at a local point, for bump
        maps.
    derivatives
        (table, its shapes) -> the record for `uv_derivatives`. None: made with
        `uv_axes`. If both are None, bump maps have no effect on such shapes.
    orientation
        shape -> -1 if its normal is opposite to the one that the kernels compute, else
        1.
    other_textured_side
        shape -> the same for sampling textured radiance. None: `orientation`.
    faces
        shape -> the number of each primitive within the shape, (n,).
    mesh
        Whether a shape has many primitives: an area light then selects one by a table.
    prepared
        (table, with_uv, with_tangents) -> the table, reduced to what the kernels read.
    """

    name: str
    plugins: Mapping[str, Callable[[Any, dict[str, Any]], Any]]
    description: type
    record: type
    surfaces: Callable[[list[Any], int], Any]
    primitive: type | None
    numbers: Callable[[Any, Any], Any] | None = None
    fill: Callable[[Any, Any, Any], None] | None = None
    intersect: Any
    point: Any = None
    surface_point: Any
    tangent: Any
    sample: Any = None
    pdf: Any = pdf_by_area
    point_at_uv: Any = None
    uv_axes: Any = None
    corners: Callable[[Any], list[NDArray[np.float32]]]
    boxes: Callable[[Any], tuple[Any, Any]] | None = None
    hull: Callable[[Any, Any], tuple[Any, Any, Any]]
    areas: Callable[[Any, Any], NDArray[np.float64]] = no_area
    derivatives: Callable[[Any, Any], Any] | None = None
    orientation: Callable[[Any], float] = flipped
    other_textured_side: Callable[[Any], float] | None = None
    faces: Callable[[Any], NDArray[Any]] = one_face
    mesh: bool = False
    prepared: Callable[..., Any] = lambda table, **_: table

    @property
    def wide(self) -> bool:
        """Whether eight primitives can be stored as a block in a leaf."""
        return self.primitive is not None

    def textured_side(self, shape: Any) -> float:
        """Return the orientation of a shape for sampling textured radiance."""
        return (self.other_textured_side or self.orientation)(shape)

    def corners_of(self, shape: Any) -> list[NDArray[np.float32]]:
        """Return points whose box contains a shape, perhaps with unused vertices."""
        if self.mesh:  # building the tables of a large mesh takes long
            near = np.abs(shape.vertices).max(initial=0.0) < FARTHEST
            return [shape.vertices if near else shape.vertices[shape.faces]]
        return self.corners(self.surfaces([shape], 0))

    def group(self, surfaces: Any, columns: NDArray[np.int64]) -> Any:
        """Return the primitives of these columns as a group of an accelerator."""
        n = len(columns)
        ids = np.zeros(n + LANES, np.int32)
        ids[:n] = columns + surfaces.first
        if self.primitive is None:
            # column -1 is never hit: no root is searched in lanes beyond the last primitive
            column = np.full(n + LANES, -1, np.int32)
            column[:n] = columns
            return ScalarGroup(column, surfaces, ids, n)
        rows = np.zeros((size_of(self.primitive), n + LANES), np.float32)
        if self.fill is not None:
            self.fill(surfaces, columns, rows)
            return Group(form_of(self.primitive), rows, ids, n)
        names = self.primitive._fields  # type: ignore[attr-defined]
        parts = (
            (getattr(surfaces, name)[..., columns] for name in names)
            if self.numbers is None
            else self.numbers(surfaces, columns)
        )
        np.concatenate([np.atleast_2d(part) for part in parts], out=rows[:, :n])
        return Group(form_of(self.primitive), rows, ids, n)

    def derivatives_of(self, surfaces: Any, shapes: Any) -> Any:
        """Return the record for `uv_derivatives`; `shapes` are all shapes of the table."""
        otherwise = no_derivatives if self.uv_axes is None else derivatives_by_place
        return (self.derivatives or otherwise)(surfaces, shapes)

    def register_kernels(self) -> None:
        """Register this kind's kernels for the classes of its records."""
        scalar = self.primitive is None
        (intersect_scalar if scalar else intersect).by(
            self.record if scalar else self.primitive
        )(self.intersect)
        for interface, implementation in (
            (point_alone, self.point),
            (surface_point, self.surface_point),
            (tangent_at, self.tangent),
            (sample_shape, self.sample),
            (pdf_shape, self.pdf),
            (point_at_uv, self.point_at_uv),
            (uv_axes, self.uv_axes),
        ):
            if implementation is not None:
                interface.by(self.record)(implementation)


@dataclass(frozen=True)
class ShapePlugin:
    """A plugin of scene files, and the kind of shape that it creates."""

    kind: ShapeKind
    make: Callable[[Any, dict[str, Any]], Any]

    def read(self, properties: Any, common: dict[str, Any]) -> Any:
        """Return the description; `common` has the fields of `description.Shape`."""
        return self.make(properties, common)
