"""How truth values of lanes are kept: as bits, or on AVX2 as lanes of ones and zeros.

AVX-512 compares into registers of bits, and LLVM's own comparisons and selections are what
it has instructions for (`Bits`). AVX2 compares into ordinary registers. There LLVM packs
the result of each comparison into bytes and unpacks it for each selection, a quarter of all
instructions of a triangle test. `WholeLanes` keeps the lanes as they are compared, by the
processor's own instructions, which LLVM does not take apart.
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
    """Return the lanes of one, two or four equal vectors side by side."""
    while len(parts) > 1:
        width = 2 * parts[0].type.count
        order = ir.Constant(ir.VectorType(_I32, width), list(range(width)))
        pairs = zip(parts[::2], parts[1::2], strict=True)
        parts = [builder.shuffle_vector(a, b, order) for a, b in pairs]
    return parts[0]


class Bits:
    """A bit for each lane."""

    def vector(self, width: int) -> ir.VectorType:
        """Return the LLVM type of a mask."""
        return ir.VectorType(ir.IntType(1), width)

    def from_bits(self, builder: ir.IRBuilder, bits: ir.Value) -> ir.Value:
        """Return the mask of the result of LLVM's comparisons, a vector of bits."""
        return bits

    def to_bits(self, builder: ir.IRBuilder, mask: ir.Value) -> ir.Value:
        """Return a mask as a vector of bits."""
        return mask

    def compared(self, builder: ir.IRBuilder, sign: str, a: Any, b: Any) -> ir.Value:
        """Compare float32 lanes; where one is NaN only != is true, as in Python."""
        if sign == "!=":
            return builder.fcmp_unordered(sign, a, b)
        return builder.fcmp_ordered(sign, a, b)

    def chosen(self, builder: ir.IRBuilder, mask: Any, yes: Any, no: Any) -> ir.Value:
        """Return `yes` where the mask is set and `no` elsewhere."""
        return builder.select(mask, yes, no)

    def extreme(self, builder: ir.IRBuilder, sign: str, a: Any, b: Any) -> ir.Value:
        """Return the lesser ("<") or greater (">") of floats; b where one is NaN."""
        return builder.select(builder.fcmp_ordered(sign, a, b), a, b)

    def packed(self, builder: ir.IRBuilder, mask: ir.Value) -> ir.Value:
        """Return the mask as an integer of as many bits, lane 0 in the lowest."""
        return builder.bitcast(mask, ir.IntType(mask.type.count))


class WholeLanes(Bits):
    """A lane of ones or zeros for each lane of 32 bits."""

    def vector(self, width: int) -> ir.VectorType:
        """Return the LLVM type of a mask."""
        return ir.VectorType(_I32, width)

    def from_bits(self, builder: ir.IRBuilder, bits: ir.Value) -> ir.Value:
        """Return the mask of the result of LLVM's comparisons, a vector of bits."""
        return builder.sext(bits, self.vector(bits.type.count))

    def to_bits(self, builder: ir.IRBuilder, mask: ir.Value) -> ir.Value:
        """Return a mask as a vector of bits."""
        return builder.icmp_signed("<", mask, ir.Constant(mask.type, None))

    def compared(self, builder: ir.IRBuilder, sign: str, a: Any, b: Any) -> ir.Value:
        """Compare float32 lanes; where one is NaN only != is true, as in Python."""
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
        """Return the lesser ("<") or greater (">") of floats; b where one is NaN."""
        floats = getattr(a.type, "element", None) == ir.FloatType()
        if not floats or a.type.count < 4:
            return super().extreme(builder, sign, a, b)
        return _by_halves(builder, _LESSER if sign == "<" else _GREATER, (a, b))

    def packed(self, builder: ir.IRBuilder, mask: ir.Value) -> ir.Value:
        """Return the mask as an integer of as many bits, lane 0 in the lowest."""
        count = mask.type.count
        lanes = builder.bitcast(mask, ir.VectorType(ir.FloatType(), count))
        bits = _I32(0)
        for first in range(0, count, 8):
            half = part(builder, lanes, first, min(count, 8))
            signs = call(builder, _SIGNS[half.type.count], _I32, half)
            bits = builder.or_(bits, builder.shl(signs, _I32(first)))
        return builder.trunc(bits, ir.IntType(count))


# The instruction for four lanes, and for eight.
_COMPARE = {4: "llvm.x86.sse.cmp.ps", 8: "llvm.x86.avx.cmp.ps.256"}
_CHOOSE = {4: "llvm.x86.sse41.blendvps", 8: "llvm.x86.avx.blendv.ps.256"}
_LESSER = {4: "llvm.x86.sse.min.ps", 8: "llvm.x86.avx.min.ps.256"}
_GREATER = {4: "llvm.x86.sse.max.ps", 8: "llvm.x86.avx.max.ps.256"}
_SIGNS = {4: "llvm.x86.sse.movmsk.ps", 8: "llvm.x86.avx.movmsk.ps.256"}


def _by_halves(
    builder: ir.IRBuilder, names: dict[int, str], lanes: Sequence[Any], *more: Any
) -> ir.Value:
    """Call an instruction for 4, 8 or 16 float32 lanes, eight by eight, or for four."""
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
    """Return whether Numba compiles for registers of 256 bits that can be gathered into."""
    given = config.CPU_FEATURES
    names = (codegen.get_host_cpu_features() if given is None else given).split(",")
    return "+avx2" in names and "+avx512f" not in names


HAS_AVX2_ONLY = _has_avx2_only()
MASKS: Bits = WholeLanes() if HAS_AVX2_ONLY else Bits()
