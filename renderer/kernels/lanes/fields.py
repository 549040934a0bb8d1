"""Named tuples of vectors and numbers, loaded from tables by their annotations.

    class Sphere(NamedTuple):
        center: Vector
        radius: Number

is four numbers of a table, in this order. Other records refer to the class by an instance
whose fields are all None (`form_of`), which takes no memory there.
"""

from __future__ import annotations

import functools
from typing import Any, get_type_hints

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typing.templates import signature
from numba.extending import intrinsic

from renderer.kernels.jit.records import record_class
from renderer.kernels.lanes.memory import as_i64, load_eight, load_one, load_row
from renderer.kernels.lanes.vectors import Vec3Type


class Vector:
    """Annotation of a field: three numbers, a `vec3` in kernels."""


class Number:
    """Annotation of a field: one number."""


class Derived:
    """Annotation of a number that follows from the other fields.

    It is stored after them. Row tables hold it; blocks do not: there it loads as None and
    kernels compute it.
    """


class Bound:
    """Annotation of a number that is an upper bound and need not be tight.

    It is stored last. Row tables have one per record, blocks one for all eight.
    """


_SIZES = {Vector: 3, Number: 1, Derived: 1, Bound: 1}
_IN_BLOCKS = (Vector, Number)


@functools.cache
def _fields(record: type) -> tuple[type, ...]:
    return tuple(get_type_hints(record).values())


def size_of(record: type) -> int:
    """Return how many numbers a record takes in a row table."""
    return sum(_SIZES[kind] for kind in _fields(record))


def size_in_block(record: type) -> int:
    """Return how many numbers a record takes in a block: all but derived and bounds."""
    return sum(_SIZES[kind] for kind in _fields(record) if kind in _IN_BLOCKS)


def bounds_of(record: type) -> int:
    """Return how many of a record's numbers are bounds."""
    return _fields(record).count(Bound)


def form_of(record: type) -> Any:
    """Return the instance that stands for a class in other records."""
    return record(*(None for _ in _fields(record)))


def _loading(load: Any, steps: tuple[int, int], in_block: bool, doc: str) -> Any:
    """Return a loader of all fields; `steps` is (row, column) from a number to the next."""

    @intrinsic
    def load_fields(
        typingctx: Any, form: Any, table: Any, bounds: Any, row: Any, column: Any
    ) -> Any:
        def resolved(load: Any, array: Any) -> tuple[Any, Any]:
            loader = typingctx.resolve_value_type(load)
            place = (array, types.int64, types.int64)
            return loader, typingctx.resolve_function_type(loader, place, {})

        loader, loading = resolved(load, table)
        one, one_loading = resolved(load_one, bounds if in_block else table)
        number = loading.return_type
        of_kind = {
            Vector: Vec3Type(number),
            Number: number,
            Derived: types.none if in_block else number,
            Bound: one_loading.return_type if in_block else number,
        }
        cls = record_class(form)
        kinds = _fields(cls)
        made = types.BaseTuple.from_types([of_kind[kind] for kind in kinds], cls)

        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            function = context.get_function(loader, loading)
            bound = context.get_function(one, one_loading)
            first = [as_i64(context, builder, args[k], sig.args[k]) for k in (3, 4)]

            def number_at(k: int) -> Any:
                at = (
                    builder.add(place, ir.Constant(place.type, k * step))
                    for place, step in zip(first, steps, strict=True)
                )
                return function(builder, (args[1], *at))

            values, taken, nth = [], 0, 0
            for kind, part in zip(kinds, made.types, strict=True):
                if part == types.none:
                    values.append(context.get_dummy_value())
                elif in_block and kind is Bound:
                    place = first[0], ir.Constant(first[0].type, nth)
                    values.append(bound(builder, (args[2], *place)))
                    nth += 1
                elif kind is Vector:
                    vector = cgutils.create_struct_proxy(part)(context, builder)
                    for k, name in enumerate("xyz"):
                        setattr(vector, name, number_at(taken + k))
                    values.append(vector._getvalue())
                else:
                    values.append(number_at(taken))
                taken += _SIZES[kind]
            return context.make_tuple(builder, made, values)

        return signature(made, form, table, bounds, row, column), codegen

    load_fields.__doc__ = doc
    return load_fields


one_from_rows = _loading(
    load_one, (1, 0), False, "Load the record in `table[row:, column]` as scalars."
)
lanes_from_rows = _loading(
    load_row, (1, 0), False, "Load 16 records from `table[row:, column]` on as lanes."
)
one_from_block = _loading(
    load_one,
    (0, 8),
    True,
    "Load a record from `table[row, column::8]` as scalars, with `bounds[row]`.",
)
lanes_from_block = _loading(
    load_eight,
    (0, 8),
    True,
    "Load the eight records of `table[row, column:]` as lanes, with `bounds[row]`.",
)
