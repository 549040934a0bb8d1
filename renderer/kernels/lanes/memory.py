"""Lanes to and from arrays: loads and stores, gathers and scatters, compressing stores.

Arrays are `(n,)`, or `(k, n)` with one row per component, selected by `row`. Rows are
contiguous (structure of arrays), except in the column-major tables of `jit.records`.
There are no bounds checks: arrays that lanes are stored to are padded by one lane width.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.errors import TypingError
from numba.core.typing.templates import signature
from numba.extending import intrinsic
from numba.np.arrayobj import make_array

from renderer.kernels.lanes import avx2
from renderer.kernels.lanes.functions import _suffix
from renderer.kernels.lanes.masks import HAS_AVX2_ONLY, MASKS, call, joined_values, part
from renderer.kernels.lanes.types import Lanes, Mask, lanes_of, llvm_vector, splat_value

_I64 = ir.IntType(64)


def _require_rows(array: Any) -> None:
    if not isinstance(array, types.Array) or array.ndim > 2 or array.layout != "C":
        raise TypingError(f"lanes live in C-ordered arrays of 1 or 2 dimensions: {array}")


def _require_elements(array: Any) -> None:
    if getattr(array, "layout", "") == "F":
        require_columns(array)
    else:
        _require_rows(array)


def require_columns(array: Any) -> None:
    """Raise TypingError unless the array is a column-major table."""
    if not isinstance(array, types.Array) or array.ndim != 2 or array.layout != "F":
        raise TypingError(f"{array} has no columns that lie in memory one by one")
    if array.dtype.bitwidth != 32:
        raise TypingError(f"columns are gathered from 32-bit numbers, not from {array}")


def _lanes_in(array: Any) -> Lanes:
    _require_rows(array)
    return lanes_of(array.dtype)


def _lanes_into(array: Any, x: Any) -> Lanes:
    lanes = _lanes_in(array)
    fits = isinstance(x, Lanes) and x.element == lanes.element
    if not fits or not array.mutable:
        raise TypingError(f"cannot store {x} in {array}")
    return x


def _row_start(context: Any, builder: Any, array: Any, value: Any, row: Any) -> Any:
    """Return the pointer to the first element of a row."""
    struct = make_array(array)(context, builder, value)
    if array.ndim == 1:
        return struct.data
    stride = cgutils.unpack_tuple(builder, struct.strides)[0]
    bytes_before = builder.mul(row, stride)
    start = builder.bitcast(struct.data, ir.IntType(8).as_pointer())
    return builder.bitcast(builder.gep(start, [bytes_before]), struct.data.type)


def element_at(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    """Return a pointer to `[row, i]`; args are array, row, i, ..."""
    row, i = (as_i64(context, builder, args[k], sig.args[k]) for k in (1, 2))
    if sig.args[0].layout == "F":
        start, place = in_columns(context, builder, sig.args[0], args[0], row, i)
        return builder.gep(start, [place])
    return builder.gep(_row_start(context, builder, sig.args[0], args[0], row), [i])


def _vector_at(context: Any, builder: Any, sig: Any, args: Any, lanes: Lanes) -> Any:
    """Return a pointer to the lanes from `[row, i]` on."""
    start = element_at(context, builder, sig, args)
    return builder.bitcast(start, llvm_vector(lanes).as_pointer())


def as_i64(context: Any, builder: Any, value: Any, given: Any) -> Any:
    """Convert an integer of type `given` to 64 bits."""
    return context.cast(builder, value, given, types.int64)


def _loading(width: int | None, doc: str) -> Any:
    @intrinsic
    def load(typingctx: Any, array: Any, row: Any, i: Any) -> Any:
        whole = _lanes_in(array)
        lanes = Lanes(whole.element, width or whole.width)

        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            pointer = _vector_at(context, builder, sig, args, lanes)
            return builder.load(pointer, align=array.dtype.bitwidth // 8)

        return signature(lanes, array, row, i), codegen

    load.__doc__ = doc
    return load


load_row = _loading(None, "Load `array[row, i : i + 16]` (8 elements of 64 bits).")
load_four = _loading(4, "Load `array[row, i : i + 4]`.")
load_eight = _loading(8, "Load `array[row, i : i + 8]`.")


@intrinsic
def load_bytes(typingctx: Any, array: Any, row: Any, i: Any) -> Any:
    """Load `array[row, i : i + 16]`, unsigned bytes, as f32x16."""
    _require_rows(array)
    if array.dtype != types.uint8:
        raise TypingError(f"bytes are loaded from arrays of uint8, not from {array}")
    lanes = Lanes(types.float32, 16)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        start = element_at(context, builder, sig, args)
        octets = ir.VectorType(ir.IntType(8), 16)
        loaded = builder.load(builder.bitcast(start, octets.as_pointer()), align=1)
        wide = builder.zext(loaded, ir.VectorType(ir.IntType(32), 16))
        return builder.sitofp(wide, llvm_vector(lanes))

    return signature(lanes, array, row, i), codegen


@intrinsic
def load_one(typingctx: Any, array: Any, row: Any, i: Any) -> Any:
    """Return `array[row, i]` for non-negative indices.

    Numba's own indexing tests whether each index is negative: three more instructions for
    every load of a traversal.
    """
    _require_elements(array)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.load(element_at(context, builder, sig, args))

    return signature(array.dtype, array, row, i), codegen


@intrinsic
def store_one(typingctx: Any, array: Any, row: Any, i: Any, x: Any) -> Any:
    """Set `array[row, i]` for non-negative indices."""
    _require_elements(array)
    if not array.mutable:
        raise TypingError(f"cannot store in {array}")

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        value = context.cast(builder, args[3], x, array.dtype)
        builder.store(value, element_at(context, builder, sig, args))
        return context.get_dummy_value()

    return signature(types.void, array, row, i, x), codegen


@intrinsic
def prefetch(typingctx: Any, array: Any, row: Any, i: Any) -> Any:
    """Prefetch the cache line of `array[row, i]`."""
    _require_rows(array)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        start = element_at(context, builder, sig, args)
        pointer = builder.bitcast(start, ir.IntType(8).as_pointer())
        # for reading, into all cache levels, data cache
        how = [ir.Constant(ir.IntType(32), n) for n in (0, 3, 1)]
        call(builder, "llvm.prefetch.p0", ir.VoidType(), pointer, *how)
        return context.get_dummy_value()

    return signature(types.void, array, row, i), codegen


@intrinsic
def store_row(typingctx: Any, array: Any, row: Any, i: Any, x: Any) -> Any:
    """Store x to `array[row, i : i + 16]`, or as many elements as x has."""
    lanes = _lanes_into(array, x)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        pointer = _vector_at(context, builder, sig, args, lanes)
        builder.store(args[3], pointer, align=array.dtype.bitwidth // 8)
        return context.get_dummy_value()

    return signature(types.void, array, row, i, x), codegen


@intrinsic
def store_where(typingctx: Any, array: Any, row: Any, i: Any, x: Any, mask: Any) -> Any:
    """Store the masked lanes of x to `array[row, i : i + 16]`.

    Unmasked elements may be rewritten with their old values, so no other thread may write
    there.
    """
    lanes = _lanes_into(array, x)
    if mask != Mask(lanes.width):
        raise TypingError(f"cannot store {x} under {mask}")

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        pointer = _vector_at(context, builder, sig, args, lanes)
        if HAS_AVX2_ONLY:  # AVX2's masked store is microcoded on AMD processors
            before = builder.load(pointer, align=array.dtype.bitwidth // 8)
            after = MASKS.chosen(builder, args[4], args[3], before)
            builder.store(after, pointer, align=array.dtype.bitwidth // 8)
            return context.get_dummy_value()
        align = ir.Constant(ir.IntType(32), array.dtype.bitwidth // 8)
        name = f"llvm.masked.store.{_suffix(lanes)}.p0"
        call(builder, name, ir.VoidType(), args[3], pointer, align, args[4])
        return context.get_dummy_value()

    return signature(types.void, array, row, i, x, mask), codegen


@intrinsic
def gather_row(typingctx: Any, array: Any, row: Any, indices: Any, mask: Any) -> Any:
    """Load `array[row, indices]`; lanes outside the mask are 0 and touch no memory."""
    by_columns = getattr(array, "layout", "") == "F"
    if by_columns:
        require_columns(array)
    lanes = lanes_of(array.dtype) if by_columns else _lanes_in(array)
    whole = isinstance(indices, Lanes) and isinstance(indices.element, types.Integer)
    if not whole or mask != Mask(lanes.width) or indices.width != lanes.width:
        raise TypingError(f"{array} is gathered by {indices} under {mask}")

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        r, places = as_i64(context, builder, args[1], row), args[2]
        if by_columns:
            base, places = in_columns(context, builder, array, args[0], r, places)
        else:
            base = _row_start(context, builder, array, args[0], r)
        if HAS_AVX2_ONLY and avx2.can_gather(lanes, indices):
            return avx2.gathered(builder, base, places, args[3])
        pointers = _lane_pointers(builder, base, places, lanes)
        name = f"llvm.masked.gather.{_suffix(lanes)}.v{lanes.width}p0"
        align = ir.Constant(ir.IntType(32), array.dtype.bitwidth // 8)
        zero = ir.Constant(llvm_vector(lanes), None)
        bits = MASKS.to_bits(builder, args[3])
        return call(builder, name, zero.type, pointers, align, bits, zero)

    return signature(lanes, array, row, indices, mask), codegen


def in_columns(
    context: Any, builder: Any, array: Any, value: Any, row: Any, indices: Any
) -> tuple[Any, Any]:
    """Return a pointer to a row of a column-major array, and offsets of the indices."""
    struct = make_array(array)(context, builder, value)
    rows = cgutils.unpack_tuple(builder, struct.shape)[0]
    if isinstance(indices.type, ir.VectorType):
        if rows.type != indices.type.element:
            rows = builder.trunc(rows, indices.type.element)
        rows = splat_value(builder, rows, indices.type)
    return builder.gep(struct.data, [row]), builder.mul(indices, rows)


@intrinsic
def scatter_row(typingctx: Any, array: Any, row: Any, indices: Any, x: Any, m: Any) -> Any:
    """Store the lanes of x in the mask m to `array[row, indices]`."""
    by_columns = getattr(array, "layout", "") == "F"
    if by_columns:
        require_columns(array)
        if x != lanes_of(array.dtype) or not array.mutable:
            raise TypingError(f"cannot store {x} in {array}")
    lanes = x if by_columns else _lanes_into(array, x)
    whole = isinstance(indices, Lanes) and isinstance(indices.element, types.Integer)
    if not whole or m != Mask(lanes.width) or indices.width != lanes.width:
        raise TypingError(f"{x} is scattered to {array} by {indices} under {m}")

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        r, places = as_i64(context, builder, args[1], row), args[2]
        if by_columns:
            base, places = in_columns(context, builder, array, args[0], r, places)
        else:
            base = _row_start(context, builder, array, args[0], r)
        pointers = _lane_pointers(builder, base, places, lanes)
        name = f"llvm.masked.scatter.{_suffix(lanes)}.v{lanes.width}p0"
        align = ir.Constant(ir.IntType(32), array.dtype.bitwidth // 8)
        bits = MASKS.to_bits(builder, args[4])
        call(builder, name, ir.VoidType(), args[3], pointers, align, bits)
        return context.get_dummy_value()

    return signature(types.void, array, row, indices, x, m), codegen


def _lane_pointers(builder: Any, base: Any, index: Any, lanes: Any) -> Any:
    """Return base + index for each lane.

    llvmlite types every `gep` as a single pointer; with a vector index it is a vector of
    pointers. Going through integers instead would lose the gather with 32-bit indices.
    """
    one = ir.Constant(index.type.element, 0)
    instruction = ir.instructions.GEPInstr(builder.block, base, [one], False, "")
    instruction.indices = [index]
    instruction.operands[1:] = [index]
    instruction.type = ir.VectorType(base.type, lanes.width)
    builder._insert(instruction)
    return instruction


@intrinsic
def append_row(typingctx: Any, array: Any, row: Any, i: Any, x: Any, mask: Any) -> Any:
    """Store the masked lanes of x contiguously from `array[row, i]` on.

    Overwrites as many elements as x has, so append in ascending order only. The lanes are
    compacted in a register first: a compressing store to memory is microcoded on AMD
    processors.
    """
    lanes = _lanes_into(array, x)
    if mask != Mask(lanes.width):
        raise TypingError(f"cannot append {x} under {mask}")

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        pointer = _vector_at(context, builder, sig, args, lanes)
        if HAS_AVX2_ONLY and avx2.can_pack(lanes):
            avx2.store_packed(builder, pointer, args[3], args[4])
            return context.get_dummy_value()
        name = f"llvm.experimental.vector.compress.{_suffix(lanes)}"
        undefined = ir.Constant(llvm_vector(lanes), ir.Undefined)
        bits = MASKS.to_bits(builder, args[4])
        packed = call(builder, name, undefined.type, args[3], bits, undefined)
        builder.store(packed, pointer, align=array.dtype.bitwidth // 8)
        return context.get_dummy_value()

    return signature(types.void, array, row, i, x, mask), codegen


# ------------------------------------------------------------------------------ columns
# Column-major tables: the numbers of one item are contiguous.
#
# A gather of 16 lanes takes 16 loads for one number per item. If several numbers per item
# are needed, one load gives four of them, and the loads of four items are transposed. An
# item that is not in the cache is waited for once (docs/performance.md, Without AVX-512).


@intrinsic
def gather_columns(typingctx: Any, array: Any, row: Any, indices: Any, mask: Any) -> Any:
    """Load `array[row : row + 4, indices]`: four rows, as lanes each.

    Lanes outside the mask read column 0, which `by_columns` ensures to exist.
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
    """Store four values of 16 lanes to `array[row : row + 4, i : i + 16]`."""
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
    """Return the four rows of a list of columns of four."""
    return _four_by_four(
        builder, *(joined_values(builder, columns[j::4]) for j in range(4))
    )


def _four_by_four(builder: Any, a: Any, b: Any, c: Any, d: Any) -> list[Any]:
    """Transpose each 4 x 4 block of the lanes of a to d."""
    width = a.type.count

    def mixed(x: Any, y: Any, *order: int) -> Any:
        """Take elements 0 to 3 of x and 4 to 7 of y, in each group of four lanes."""
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
