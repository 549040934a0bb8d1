"""What a kind of shape is: its description, its tables, and the kernels that read them."""

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

LANES = 16  # columns behind the last primitive of a group, so that 16 can be loaded of any


def flipped(shape: Any) -> float:
    """Return the orientation of shapes whose normals only the file turns around."""
    return -1.0 if shape.flip_normals else 1.0


def one_face(shape: Any) -> NDArray[np.int64]:
    """Return the numbers of the primitives of a shape that is one."""
    return np.zeros(1, np.int64)


def no_area(surfaces: Any, columns: Any) -> NDArray[np.float64]:
    """Return zeros, for kinds that cannot be lamps."""
    return np.zeros(len(columns))


@dataclass(frozen=True, kw_only=True)
class ShapeKind:
    """One kind of shape. `registry.register_shape` makes it known.

    Its kernels are implementations of interfaces, which say what they are given and return.

    Parameters
    ----------
    name
        Of its primitives, in the plural.
    plugins
        Name in scene files -> what makes the description from the properties of a file and
        the fields that all shapes have.
    description
        The class of the scene's description.
    record
        The class of the table of its primitives: a NamedTuple with `first` and `end`, the
        primitive ids, and arrays.
    surfaces
        (shapes, first primitive id) -> the table of all these shapes.
    primitive
        The class of one primitive, whose fields are annotated as `kernels.lanes.fields`
        says: what an accelerator holds. None: rays are intersected with one primitive at a
        time, in double precision, see `scalar_shapes`.
    numbers
        (table, columns) -> the fields of the primitives as arrays (3, n) or (n,). None: the
        table has arrays of these names.
    fill
        (table, columns, rows): writes these fields to the first columns of rows (numbers of
        a primitive, n). None: by `numbers`.
    intersect
        Kernel, `primitives.intersect`; without a `primitive`, that of `intersect_scalar`.
    point
        Kernel, `scalar_shapes.point_alone`; only without a `primitive`.
    surface_point, tangent, sample, pdf, point_at_uv
        Kernels, see `surface`. Without `sample` it cannot be a lamp, without `point_at_uv`
        not one whose radiance is a texture.
    corners
        table -> arrays (3, n) of points whose box holds each primitive.
    boxes
        table -> lower and upper corners (3, n), padded (`extents.primitive_bounds`). None:
        by `corners`.
    hull
        (table, columns) -> points (3, 4, n), radius (n,) and normal (3, n): a primitive
        lies in the hull of the points, grown by the radius, and in the plane across the
        normal (0 where it is not flat).
    areas
        (table, columns) -> surface areas (n,), float64.
    uv_axes
        Kernel, see `uv.uv_derivatives`: dp/du and dp/dv at a local point, for bumps.
    derivatives
        (table, its shapes) -> the record of `uv_derivatives`. None: by `uv_axes`; without
        that, bumps do not displace such shapes.
    orientation
        shape -> -1 where its normal is opposite to the one that the kernels compute.
    other_textured_side
        shape -> the same where a texture that shines is sampled. None: it is the same.
    faces
        shape -> the number of each of its primitives within the shape, (n,).
    mesh
        Whether a shape has many primitives: a lamp then chooses one of them by a table.
    prepared
        (table, with_uv, with_tangents) -> the table with what the kernels will look at.
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
        """Whether eight primitives can lie side by side in a leaf."""
        return self.primitive is not None

    def textured_side(self, shape: Any) -> float:
        """Return the orientation of a shape where a texture that shines is sampled."""
        return (self.other_textured_side or self.orientation)(shape)

    def corners_of(self, shape: Any) -> list[NDArray[np.float32]]:
        """Return points whose box holds a shape, and perhaps others within `FARTHEST`."""
        if self.mesh:  # the tables of a large one take a while
            near = np.abs(shape.vertices).max(initial=0.0) < FARTHEST
            return [shape.vertices if near else shape.vertices[shape.faces]]
        return self.corners(self.surfaces([shape], 0))

    def group(self, surfaces: Any, columns: NDArray[np.int64]) -> Any:
        """Return the primitives in these columns as an accelerator holds them."""
        n = len(columns)
        ids = np.zeros(n + LANES, np.int32)
        ids[:n] = columns + surfaces.first
        if self.primitive is None:
            # -1 is no surface: lanes beyond the last are not worth a search for roots
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
        """Return the record of `uv_derivatives`; `shapes` are all of the table."""
        otherwise = no_derivatives if self.uv_axes is None else derivatives_by_place
        return (self.derivatives or otherwise)(surfaces, shapes)

    def register_kernels(self) -> None:
        """Implement the interfaces for the classes of this kind."""
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
    """A plugin of scene files, and the kind that its shapes are of."""

    kind: ShapeKind
    make: Callable[[Any, dict[str, Any]], Any]

    def read(self, properties: Any, common: dict[str, Any]) -> Any:
        """Return the description; `common` are the fields of `description.Shape`."""
        return self.make(properties, common)
