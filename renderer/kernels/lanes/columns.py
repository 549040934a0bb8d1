"""Tables that lie in memory column by column: what belongs to one thing is side by side.

A gather of 16 lanes takes 16 loads for one number of each thing. Where several numbers of
each are needed, four of them are one load, and the loads of four things are transposed; a
thing that is not in the cache is waited for once (docs/performance.md, Without AVX-512).
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.errors import TypingError
from numba.core.typing.templates import signature
from numba.extending import intrinsic
from numba.np.arrayobj import make_array

from renderer.kernels.lanes.masks import MASKS, joined_values, part
from renderer.kernels.lanes.memory import as_i64, element_at, in_columns, require_columns
from renderer.kernels.lanes.types import Lanes, Mask, lanes_of


@intrinsic
def gather_columns(typingctx: Any, array: Any, row: Any, indices: Any, mask: Any) -> Any:
    """Load `array[row : row + 4, indices]`: four rows, as lanes each.

    Lanes outside the mask are of column 0, which `by_columns` sees to be there.
    """
    require_columns(array)
    lanes = lanes_of(array.dtype)
    if indices != Lanes(types.int32, lanes.width) or mask != Mask(lanes.width):
        raise TypingError(f"{array} is gathered by {indices} under {mask}")
    four = types.UniTuple(lanes, 4)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        first = as_i64(context, builder, args[1], row)
        there = MASKS.chosen(builder, args[3], args[2], ir.Constant(args[2].type, None))
        start, places = in_columns(context, builder, array, args[0], first, there)
        quad = ir.VectorType(start.type.pointee, 4)
        columns = []
        for k in range(lanes.width):
            place = builder.extract_element(places, ir.IntType(32)(k))
            at = builder.gep(start, [builder.sext(place, ir.IntType(64))])
            at = builder.bitcast(at, quad.as_pointer())
            columns.append(builder.load(at, align=4))
        return context.make_tuple(builder, four, _as_rows(builder, columns))

    return signature(four, array, row, indices, mask), codegen


@intrinsic
def store_columns(
    typingctx: Any, array: Any, row: Any, i: Any, a: Any, b: Any, c: Any, d: Any
) -> Any:
    """Store four lanes to `array[row : row + 4, i : i + 16]`."""
    require_columns(array)
    if {a, b, c, d} != {lanes_of(array.dtype)} or not array.mutable:
        raise TypingError(f"cannot store {a}, {b}, {c}, {d} in {array}")

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        first = element_at(context, builder, sig, args)
        struct = make_array(array)(context, builder, args[0])
        rows = cgutils.unpack_tuple(builder, struct.shape)[0]
        for k, column in enumerate(_as_columns(builder, list(args[3:]))):
            at = builder.gep(first, [builder.mul(rows, rows.type(k))])
            builder.store(column, builder.bitcast(at, column.type.as_pointer()), align=4)
        return context.get_dummy_value()

    return signature(types.void, array, row, i, a, b, c, d), codegen


def _as_columns(builder: Any, rows: list[Any]) -> list[Any]:
    """Return the columns of four rows."""
    quads = _four_by_four(builder, *rows)
    return [part(builder, quads[k % 4], k - k % 4, 4) for k in range(rows[0].type.count)]


def _as_rows(builder: Any, columns: list[Any]) -> list[Any]:
    """Return the four rows of so many columns of four."""
    return _four_by_four(
        builder, *(joined_values(builder, columns[j::4]) for j in range(4))
    )


def _four_by_four(builder: Any, a: Any, b: Any, c: Any, d: Any) -> list[Any]:
    """Transpose each four of the lanes of a to d."""
    width = a.type.count

    def mixed(x: Any, y: Any, *order: int) -> Any:
        """Take numbers 0 to 3 of x and 4 to 7 of y, in each four of their lanes."""
        places = [
            four + k if k < 4 else width + four + k - 4
            for four in range(0, width, 4)
            for k in order
        ]
        return builder.shuffle_vector(x, y, ir.VectorType(ir.IntType(32), width)(places))

    low, high = mixed(a, b, 0, 4, 1, 5), mixed(a, b, 2, 6, 3, 7)
    low_of_others, high_of_others = mixed(c, d, 0, 4, 1, 5), mixed(c, d, 2, 6, 3, 7)
    return [
        mixed(low, low_of_others, 0, 1, 4, 5),
        mixed(low, low_of_others, 2, 3, 6, 7),
        mixed(high, high_of_others, 0, 1, 4, 5),
        mixed(high, high_of_others, 2, 3, 6, 7),
    ]
