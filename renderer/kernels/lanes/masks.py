"""Representation of masks: as bits, or on AVX2 as lanes of ones and zeros.

AVX-512 compares into mask registers, which LLVM's comparisons and selects use well
(`Bits`). AVX2 compares into ordinary registers. There LLVM packs each comparison into bytes
and unpacks it for each select, a quarter of all instructions of a triangle test.
`WholeLanes` keeps the result of the comparison, by target intrinsics, which LLVM leaves
intact.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from llvmlite import ir
from numba.core import codegen, config

_I32 = ir.IntType(32)


def call(builder: ir.IRBuilder, name: str, result: ir.Type, *args: ir.Value) -> ir.Value:
    """Call the LLVM intrinsic `name`."""
    function_type = ir.FunctionType(result, [a.type for a in args])
    module = builder.module
    function = module.globals.get(name) or ir.Function(module, function_type, name)
    return builder.call(function, args)


def part(builder: ir.IRBuilder, x: ir.Value, first: int, width: int) -> ir.Value:
    """Return `width` lanes of x from lane `first` on."""
    order = ir.Constant(ir.VectorType(_I32, width), list(range(first, first + width)))
    return builder.shuffle_vector(x, ir.Constant(x.type, ir.Undefined), order)


def joined_values(builder: ir.IRBuilder, parts: list[ir.Value]) -> ir.Value:
    """Concatenate one, two or four vectors of equal type."""
    while len(parts) > 1:
        width = 2 * parts[0].type.count
        order = ir.Constant(ir.VectorType(_I32, width), list(range(width)))
        pairs = zip(parts[::2], parts[1::2], strict=True)
        parts = [builder.shuffle_vector(a, b, order) for a, b in pairs]
    return parts[0]


class Bits:
    """Masks as one bit per lane."""

    def vector(self, width: int) -> ir.VectorType:
        """Return the LLVM type of a mask."""
        return ir.VectorType(ir.IntType(1), width)

    def from_bits(self, builder: ir.IRBuilder, bits: ir.Value) -> ir.Value:
        """Return the mask from a vector of bits, as LLVM's comparisons give."""
        return bits

    def to_bits(self, builder: ir.IRBuilder, mask: ir.Value) -> ir.Value:
        """Return a mask as a vector of bits."""
        return mask

    def compared(self, builder: ir.IRBuilder, sign: str, a: Any, b: Any) -> ir.Value:
        """Compare float32 lanes; comparisons with NaN are false, except !=."""
        if sign == "!=":
            return builder.fcmp_unordered(sign, a, b)
        return builder.fcmp_ordered(sign, a, b)

    def chosen(self, builder: ir.IRBuilder, mask: Any, yes: Any, no: Any) -> ir.Value:
        """Return `yes` where the mask is set and `no` elsewhere."""
        return builder.select(mask, yes, no)

    def extreme(self, builder: ir.IRBuilder, sign: str, a: Any, b: Any) -> ir.Value:
        """Return the minimum ("<") or maximum (">") of floats; b if either is NaN."""
        return builder.select(builder.fcmp_ordered(sign, a, b), a, b)

    def packed(self, builder: ir.IRBuilder, mask: ir.Value) -> ir.Value:
        """Return the mask as an integer of that many bits, lane 0 in the lowest."""
        return builder.bitcast(mask, ir.IntType(mask.type.count))


class WholeLanes(Bits):
    """Masks as all ones or all zeros in each 32-bit lane."""

    def vector(self, width: int) -> ir.VectorType:
        """Return the LLVM type of a mask."""
        return ir.VectorType(_I32, width)

    def from_bits(self, builder: ir.IRBuilder, bits: ir.Value) -> ir.Value:
        """Return the mask from a vector of bits, as LLVM's comparisons give."""
        return builder.sext(bits, self.vector(bits.type.count))

    def to_bits(self, builder: ir.IRBuilder, mask: ir.Value) -> ir.Value:
        """Return a mask as a vector of bits."""
        return builder.icmp_signed("<", mask, ir.Constant(mask.type, None))

    def compared(self, builder: ir.IRBuilder, sign: str, a: Any, b: Any) -> ir.Value:
        """Compare float32 lanes; comparisons with NaN are false, except !=."""
        if a.type.element != ir.FloatType():
            return self.from_bits(builder, super().compared(builder, sign, a, b))
        if sign in (">", ">="):
            a, b = b, a
        how = ir.IntType(8)({"==": 0, "<": 1, ">": 1, "<=": 2, ">=": 2, "!=": 4}[sign])
        compared = _by_halves(builder, _COMPARE, (a, b), how)
        return builder.bitcast(compared, self.vector(a.type.count))

    def chosen(self, builder: ir.IRBuilder, mask: Any, yes: Any, no: Any) -> ir.Value:
        """Return `yes` where the mask is set and `no` elsewhere."""
        if _size(yes.type.element) != 32:
            return builder.select(self.to_bits(builder, mask), yes, no)
        floats = ir.VectorType(ir.FloatType(), mask.type.count)
        lanes = [builder.bitcast(x, floats) for x in (no, yes, mask)]
        return builder.bitcast(_by_halves(builder, _CHOOSE, lanes), yes.type)

    def extreme(self, builder: ir.IRBuilder, sign: str, a: Any, b: Any) -> ir.Value:
        """Return the minimum ("<") or maximum (">") of floats; b if either is NaN."""
        floats = getattr(a.type, "element", None) == ir.FloatType()
        if not floats or a.type.count < 4:
            return super().extreme(builder, sign, a, b)
        return _by_halves(builder, _LESSER if sign == "<" else _GREATER, (a, b))

    def packed(self, builder: ir.IRBuilder, mask: ir.Value) -> ir.Value:
        """Return the mask as an integer of that many bits, lane 0 in the lowest."""
        count = mask.type.count
        lanes = builder.bitcast(mask, ir.VectorType(ir.FloatType(), count))
        bits = _I32(0)
        for first in range(0, count, 8):
            half = part(builder, lanes, first, min(count, 8))
            signs = call(builder, _SIGNS[half.type.count], _I32, half)
            bits = builder.or_(bits, builder.shl(signs, _I32(first)))
        return builder.trunc(bits, ir.IntType(count))


# The intrinsics for four and for eight lanes.
_COMPARE = {4: "llvm.x86.sse.cmp.ps", 8: "llvm.x86.avx.cmp.ps.256"}
_CHOOSE = {4: "llvm.x86.sse41.blendvps", 8: "llvm.x86.avx.blendv.ps.256"}
_LESSER = {4: "llvm.x86.sse.min.ps", 8: "llvm.x86.avx.min.ps.256"}
_GREATER = {4: "llvm.x86.sse.max.ps", 8: "llvm.x86.avx.max.ps.256"}
_SIGNS = {4: "llvm.x86.sse.movmsk.ps", 8: "llvm.x86.avx.movmsk.ps.256"}


def _by_halves(
    builder: ir.IRBuilder, names: dict[int, str], lanes: Sequence[Any], *more: Any
) -> ir.Value:
    """Apply an intrinsic to float32 lanes: four, or any multiple of eight in parts."""
    count = lanes[0].type.count
    width = min(count, 8)
    parts = []
    for first in range(0, count, width):
        args = [part(builder, x, first, width) for x in lanes]
        parts.append(call(builder, names[width], args[0].type, *args, *more))
    return joined_values(builder, parts)


def _size(element: ir.Type) -> int:
    if isinstance(element, ir.IntType):
        return int(element.width)
    return 32 if element == ir.FloatType() else 64


def _has_avx2_only() -> bool:
    """Return whether Numba compiles for AVX2 (256 bits, gathers) but not AVX-512."""
    given = config.CPU_FEATURES
    names = (codegen.get_host_cpu_features() if given is None else given).split(",")
    return "+avx2" in names and "+avx512f" not in names


HAS_AVX2_ONLY = _has_avx2_only()
MASKS: Bits = WholeLanes() if HAS_AVX2_ONLY else Bits()
