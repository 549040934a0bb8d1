"""Small arrays on the processor's stack, for traversals: no allocation, no counting."""

from __future__ import annotations

import math
from typing import Any

from llvmlite import ir
from numba.core import types
from numba.core.errors import TypingError
from numba.core.typing.templates import signature
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array

_CACHE_LINE = 64  # bytes, as many as sixteen lanes: none of their loads touches two lines


def _reserve(builder: ir.IRBuilder, whole: ir.Type) -> ir.Value:
    """Take room in the function's frame, uninitialised.

    Numba's `alloca_once` stores zeros there, as one value of thousands of elements: LLVM
    worked at that for 2.8 of the 20.7 s that the wide hierarchy and its scene compiled.
    """
    with builder.goto_entry_block():
        memory = builder.alloca(whole)
    memory.align = _CACHE_LINE
    return memory


def _array_of(context: Any, builder: Any, array: types.Array, shape: Any) -> Any:
    """Return an array of a constant shape in the function's frame."""
    item = context.get_data_type(array.dtype)
    memory = _reserve(builder, ir.ArrayType(item, math.prod(shape)))
    bytes_each = context.get_abi_sizeof(item)
    before = [
        shape[k + 1 :] if array.layout == "C" else shape[:k] for k in range(len(shape))
    ]
    strides = [bytes_each * math.prod(sizes) for sizes in before]
    struct = make_array(array)(context, builder)
    word = context.get_constant
    populate_array(
        struct,
        data=builder.bitcast(memory, item.as_pointer()),
        shape=[word(types.intp, size) for size in shape],
        strides=[word(types.intp, stride) for stride in strides],
        itemsize=word(types.intp, bytes_each),
        meminfo=None,
    )
    return struct._getvalue()


def _local_array(element: types.Number) -> Any:
    @intrinsic
    def local_array(typingctx: Any, size: Any) -> Any:
        if not isinstance(size, types.IntegerLiteral):
            raise TypingError("the size of a local array must be a constant")
        array = types.Array(element, 1, "C")

        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return _array_of(context, builder, array, (size.literal_value,))

        return signature(array, size), codegen

    return local_array


def _local_rows(element: types.Number, layout: str = "C") -> Any:
    @intrinsic
    def local_rows(typingctx: Any, rows: Any, size: Any) -> Any:
        if not all(isinstance(n, types.IntegerLiteral) for n in (rows, size)):
            raise TypingError("the shape of a local array must be constant")
        array = types.Array(element, 2, layout)

        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            shape = (rows.literal_value, size.literal_value)
            return _array_of(context, builder, array, shape)

        return signature(array, rows, size), codegen

    return local_rows


# `local_i32(64)` is 64 uninitialised numbers that live as long as the function; a constant
# size only. Not to be returned.
local_i32 = _local_array(types.int32)
local_i64 = _local_array(types.int64)
local_f32 = _local_array(types.float32)
local_f64 = _local_array(types.float64)

# `local_rows_f32(3, 64)` is three rows of them: one value of seven fields to hand to every
# kernel, where three arrays are 21.
local_rows_i32 = _local_rows(types.int32)
local_rows_f32 = _local_rows(types.float32)
# the same shape, one column of `rows` numbers after the other
local_columns_f32 = _local_rows(types.float32, "F")
