"""Gathers and compressing stores for AVX2 without AVX-512.

Where AVX2 has no instruction, or one that LLVM avoids, LLVM scalarises the operation: a
branch and a load per gathered lane, a store and an addition per appended lane.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir

from renderer.kernels.lanes.masks import MASKS, call, joined_values, part
from renderer.kernels.lanes.types import Lanes

_I8, _I32, _I64, _F32 = ir.IntType(8), ir.IntType(32), ir.IntType(64), ir.FloatType()
_EIGHT, _EIGHT_FLOATS = ir.VectorType(_I32, 8), ir.VectorType(_F32, 8)
_TABLE = "lightproof.places_of_set_bits"


def can_pack(lanes: Lanes) -> bool:
    """Return whether `store_packed` supports these lanes."""
    return lanes.element.bitwidth == 32 and lanes.width % 8 == 0


def can_gather(lanes: Lanes, indices: Lanes) -> bool:
    """Return whether `gathered` supports these lanes and indices."""
    return can_pack(lanes) and indices.element.bitwidth == 32 and indices.element.signed


def gathered(builder: ir.IRBuilder, base: Any, indices: Any, mask: Any) -> ir.Value:
    """Return the 32-bit elements at `base + indices`; 0 outside the mask."""
    count = indices.type.count
    signs = builder.bitcast(mask, ir.VectorType(_F32, count))
    memory = builder.bitcast(base, _I8.as_pointer())
    zero, size = ir.Constant(_EIGHT_FLOATS, None), _I8(4)
    parts = []
    for first in range(0, count, 8):
        where, which = part(builder, indices, first, 8), part(builder, signs, first, 8)
        name = "llvm.x86.avx2.gather.d.ps.256"
        parts.append(call(builder, name, zero.type, zero, memory, where, which, size))
    element = base.type.pointee
    return builder.bitcast(joined_values(builder, parts), ir.VectorType(element, count))


def store_packed(builder: ir.IRBuilder, pointer: Any, x: Any, mask: Any) -> None:
    """Store the masked 32-bit lanes contiguously.

    Eight lanes at a time: a permutation moves the masked ones to the front, and the next
    eight overwrite the rest.
    """
    count = x.type.count
    bits = builder.zext(MASKS.packed(builder, mask), _I64)
    whole = builder.bitcast(x, ir.VectorType(_I32, count))
    start = builder.bitcast(pointer, _I32.as_pointer())
    for first in range(0, count, 8):
        wanted = builder.and_(builder.lshr(bits, _I64(first)), _I64(255))
        eight, places = part(builder, whole, first, 8), _places(builder, wanted)
        packed = call(builder, "llvm.x86.avx2.permd", _EIGHT, eight, places)
        builder.store(packed, builder.bitcast(start, _EIGHT.as_pointer()), align=4)
        start = builder.gep(start, [call(builder, "llvm.ctpop.i64", _I64, wanted)])


def _places(builder: ir.IRBuilder, bits: Any) -> Any:
    """Return the indices of a byte's set bits, in order: the permutation."""
    table = builder.module.globals.get(_TABLE) or _table(builder.module)
    octets = ir.VectorType(_I8, 8)
    row = builder.gep(table, [_I64(0), bits], inbounds=True)
    loaded = builder.load(builder.bitcast(row, octets.as_pointer()), align=8)
    return builder.zext(loaded, _EIGHT)


def _table(module: ir.Module) -> ir.GlobalVariable:
    rows = [[k for k in range(8) if byte >> k & 1] for byte in range(256)]
    row_type = ir.ArrayType(_I8, 8)
    table_type = ir.ArrayType(row_type, 256)
    table = ir.GlobalVariable(module, table_type, _TABLE)
    table.linkage, table.global_constant, table.align = "internal", True, 64
    table.initializer = table_type([row_type(row + [0] * (8 - len(row))) for row in rows])
    return table
