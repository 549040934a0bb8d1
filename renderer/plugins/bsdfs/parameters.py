"""Parameters of BSDFs: annotations of a kind's fields, and their loading at points.

The parameters of a kind are a NamedTuple class. Each field is annotated with one of the
classes below; `parameters_at` loads the fields for 16 surface points at once.
"""

from __future__ import annotations

import functools
import typing
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from renderer.kernels.jit import kernel
from renderer.kernels.jit.records import record_class
from renderer.kernels.lanes.memory import gather_row, load_row
from renderer.kernels.lanes.vectors import load3, vec3


@functools.cache  # a scene calls this a dozen times for each BSDF, 20 us each
def hints_of(parameters: type) -> Mapping[str, Any]:
    """Return the annotations of a kind's parameters by name."""
    return MappingProxyType(typing.get_type_hints(parameters))


class Color:
    """Annotation of a parameter: linear RGB in 16 lanes, constant or from a texture."""


class Float:
    """Annotation of a parameter: a number in 16 lanes, constant or from a texture."""


class Table:
    """Annotation of a parameter: an array of numbers for each BSDF; see `entry_of`."""


class Rows(NamedTuple):
    """A `Table` as kernels see it; in the kind's record `first` has one entry per BSDF."""

    numbers: Any  # (1, entries of all BSDFs), concatenated
    first: Any  # index of the first entry of each point's BSDF


class Nested:
    """Annotation of a parameter that is a nested BSDF, as in `mask`."""


class Gradient:
    """Annotation of a parameter: the derivatives of a texture's luminance by u and v."""


class Derivatives:
    """Annotation of a parameter from the surface point: dp/du and dp/dv."""


class ShadingNormal:
    """Annotation of a parameter from the surface point: world space shading normal."""


class GeometricNormal:
    """Annotation of a parameter from the surface point: world space geometric normal."""


@kernel
def _color(table, points, row, i):
    return rows3(points.parameters, row, i)


@kernel
def _float(table, points, row, i):
    return load_row(points.parameters, row, i)


@kernel
def _gradient(table, points, row, i):
    return load_row(points.parameters, row, i), load_row(points.parameters, row + 1, i)


@kernel
def _derivatives(table, points, row, i):
    return rows3(points.parameters, row, i), rows3(points.parameters, row + 3, i)


@kernel
def _table(table, points, row, i):
    bsdf = load_row(points.bsdf, 0, i)
    return Rows(table.numbers, gather_row(table.first, 0, bsdf, bsdf >= 0))


@kernel
def _shading_normal(table, points, row, i):
    return load3(points.shading_normal, i)


@kernel
def _geometric_normal(table, points, row, i):
    return load3(points.normal, i)


# annotation -> its number of rows of `points.parameters`, and the function that loads them
_LOADED: dict[Any, tuple[int, Any]] = {
    Color: (3, _color),
    Gradient: (2, _gradient),
    Float: (1, _float),
    Derivatives: (6, _derivatives),
    Table: (0, _table),
    ShadingNormal: (0, _shading_normal),
    GeometricNormal: (0, _geometric_normal),
}
ROWS = {annotation: rows for annotation, (rows, _) in _LOADED.items()}


@kernel
def rows3(rows, first, i):
    """Load columns i to i + 15 of three rows as a vector of lanes."""
    return vec3(
        load_row(rows, first, i), load_row(rows, first + 1, i), load_row(rows, first + 2, i)
    )


@kernel
def entry_of(table, i):
    """Return entry i of each point's table, lane by lane."""
    return gather_row(table.numbers, 0, table.first + i, i >= 0)


@intrinsic
def parameters_at(typingctx: Any, form: Any, points: Any, i: Any) -> Any:
    """Return the parameters of points i to i + 15, as a record of the kind's class."""
    loaded, load, _ = _loader(typingctx, form, (points, types.int64, i), 0)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return load(context, builder, *args)

    return loaded(form, points, i), codegen


def _loader(typingctx: Any, form: Any, given: Any, row: int) -> tuple[Any, Any, int]:
    """Return the type of a record, the generator of code that loads it, and the next row.

    Parameters
    ----------
    form
        Numba type of the kind's record.
    given
        Numba types of the points, of a row number and of the first point.
    row
        First row of the record.
    """
    cls = record_class(form)
    assert cls is not None
    fields: list[tuple[str, Any, Callable[..., Any]]] = []
    for name, annotation in hints_of(cls).items():
        part = typingctx.resolve_getattr(form, name)
        if annotation is Nested:
            loaded, load, row = _loader(typingctx, part, given, row)
        else:
            rows, kernel_of = _LOADED[annotation]
            loaded, load = _field_loader(typingctx, kernel_of, part, given, row)
            row += rows
        fields.append((name, loaded, load))
    record = types.BaseTuple.from_types(tuple(loaded for _, loaded, _ in fields), cls)

    def load_all(context: Any, builder: Any, value: Any, points: Any, i: Any) -> Any:
        values = []
        for name, _, load in fields:
            part = context.get_getattr(form, name)(context, builder, form, value, name)
            values.append(load(context, builder, part, points, i))
        return context.make_tuple(builder, record, values)

    return record, load_all, row


def _field_loader(
    typingctx: Any, load: Any, part: Any, given: Any, row: int
) -> tuple[Any, Any]:
    """Return the type of a field, and the generator of the call that loads it."""
    function = typingctx.resolve_value_type(load)
    signature = typingctx.resolve_function_type(function, (part, *given), {})

    def call(context: Any, builder: Any, value: Any, points: Any, i: Any) -> Any:
        # a cached kernel of another process has its signature, but is not compiled here yet
        context.typing_context.resolve_function_type(function, signature.args, {})
        place = ir.Constant(ir.IntType(64), row)
        code = context.get_function(function, signature)
        return code(builder, (value, points, place, i))

    return signature.return_type, call
