"""The Numba types `f32x16`, `i32x16`, `u32x16`, `f64x8`, ... and their masks.

A lane type is a SIMD vector: 16 rays, or 16 triangles, per instruction. Its data model is
an LLVM vector; for narrower registers LLVM splits it. LLVM's auto-vectoriser left the
shading loops scalar, because Numba's arrays may alias; explicit lanes made shading four
times as fast.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import types
from numba.core.errors import TypingError
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import models, register_model

from renderer.kernels.lanes.masks import MASKS

WIDTH = 16  # lanes of a packet


class Lanes(types.Type):
    """`width` numbers of one Numba scalar type, processed together."""

    def __init__(self, element: Any, width: int) -> None:
        self.element = element
        self.width = width
        super().__init__(name=f"Lanes({element} x {width})")

    def can_convert_to(self, typingctx: Any, other: Any) -> None:
        """Forbid silent conversions; the explicit ones are in `functions`."""
        return None


class Mask(types.Type):
    """`width` booleans, the result of comparing lanes."""

    def __init__(self, width: int) -> None:
        self.width = width
        super().__init__(name=f"Mask({width})")


_LLVM_ELEMENT = {
    types.float32: ir.FloatType(),
    types.float64: ir.DoubleType(),
    types.int32: ir.IntType(32),
    types.uint32: ir.IntType(32),
    types.int64: ir.IntType(64),
    types.uint64: ir.IntType(64),
}


def lanes_of(element: Any) -> Lanes:
    """Return the lane type of an element type that fills 512 bits: f32x16, f64x8, ..."""
    if element not in _LLVM_ELEMENT:
        raise TypingError(f"there are no lanes of {element}")
    return Lanes(element, 512 // element.bitwidth)


def llvm_vector(lanes: Lanes | Mask) -> ir.VectorType:
    """Return the LLVM type of a lane or mask type."""
    if isinstance(lanes, Mask):
        return MASKS.vector(lanes.width)
    return ir.VectorType(_LLVM_ELEMENT[lanes.element], lanes.width)


@register_model(Lanes)
@register_model(Mask)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Lanes | Mask) -> None:
        super().__init__(dmm, fe_type, llvm_vector(fe_type))


f32x16 = Lanes(types.float32, 16)
i32x16 = Lanes(types.int32, 16)
u32x16 = Lanes(types.uint32, 16)
f64x8 = Lanes(types.float64, 8)


# ---------------------------------------------------------------------------- operators
# Ordinary operators on lanes: `a * b + c`, `a < b`, `mask & ~other`, `x >> 16`.
#
# A scalar operand is converted to the lanes' element type and broadcast, so a Python
# literal never widens an expression to double precision. Integers wrap around; shifts by
# the element's width or more are undefined, as in C.

# LLVM instruction for float, signed and unsigned elements; None: not supported
_ARITHMETIC: dict[Any, tuple[Any, Any, Any]] = {
    operator.add: ("fadd", "add", "add"),
    operator.sub: ("fsub", "sub", "sub"),
    operator.mul: ("fmul", "mul", "mul"),
    operator.truediv: ("fdiv", None, None),
    operator.and_: (None, "and_", "and_"),
    operator.or_: (None, "or_", "or_"),
    operator.xor: (None, "xor", "xor"),
    operator.lshift: (None, "shl", "shl"),
    operator.rshift: (None, "ashr", "lshr"),
}
_INPLACE = {
    operator.iadd: operator.add,
    operator.isub: operator.sub,
    operator.imul: operator.mul,
    operator.itruediv: operator.truediv,
    operator.iand: operator.and_,
    operator.ior: operator.or_,
    operator.ixor: operator.xor,
    operator.ilshift: operator.lshift,
    operator.irshift: operator.rshift,
}
_COMPARISON = {
    operator.lt: "<",
    operator.le: "<=",
    operator.gt: ">",
    operator.ge: ">=",
    operator.eq: "==",
    operator.ne: "!=",
}
_ON_MASKS = (operator.and_, operator.or_, operator.xor)
# Numba tries the implementations of an operator for the exact target before the generic
# ones, and takes the first that fits. Otherwise each `a + b` of lanes would try those of
# strings, lists, sets, dates, ... twice, and most of these compile something.
_FIRST = {"target": "cpu"}
SCALARS = (types.Integer, types.Float, types.Boolean)


def _instruction(op: Callable[..., Any], element: Any) -> Any:
    floating, signed, unsigned = _ARITHMETIC[op]
    if isinstance(element, types.Float):
        return floating
    return signed if element.signed else unsigned


def operands(left: Any, right: Any) -> Any:
    """Return the common lane type of both operands, or None if they do not mix.

    A float does not mix with integer lanes: its fraction would be lost silently.
    """
    if isinstance(left, Lanes) and isinstance(right, Lanes):
        return left if left == right else None
    lanes, scalar = (left, right) if isinstance(left, Lanes) else (right, left)
    if not (isinstance(lanes, Lanes) and isinstance(scalar, SCALARS)):
        return None
    loses = isinstance(lanes.element, types.Integer) and isinstance(scalar, types.Float)
    return None if loses else lanes


def splat_value(builder: ir.IRBuilder, scalar: ir.Value, vector: Any) -> ir.Value:
    """Copy an LLVM scalar to every lane of a vector type."""
    index = ir.IntType(32)
    first = builder.insert_element(ir.Constant(vector, ir.Undefined), scalar, index(0))
    zeros = ir.Constant(ir.VectorType(index, vector.count), [0] * vector.count)
    return builder.shuffle_vector(first, ir.Constant(vector, ir.Undefined), zeros)


def widen(context: Any, builder: ir.IRBuilder, value: Any, given: Any, lanes: Any) -> Any:
    """Convert an operand of type `given` to `lanes`; lanes are returned unchanged."""
    if isinstance(given, Lanes | Mask):
        return value
    scalar = context.cast(builder, value, given, lanes.element)
    return splat_value(builder, scalar, llvm_vector(lanes))


def _declare_binary(op: Callable[..., Any], meaning: Callable[..., Any]) -> None:
    """Type and lower `op`; an in-place operator is implemented as the plain one."""

    class Typing(AbstractTemplate):
        metadata = _FIRST

        def generic(self, args: Any, kws: Any) -> Any:
            left, right = args
            if isinstance(left, Mask) and left == right and meaning in _ON_MASKS:
                return signature(left, left, right)
            lanes = operands(left, right)
            if lanes is None:
                return None
            if meaning in _COMPARISON:
                return signature(Mask(lanes.width), left, right)
            if _instruction(meaning, lanes.element) is None:
                return None
            return signature(lanes, left, right)

    infer_global(op)(Typing)

    def lower(context: Any, builder: ir.IRBuilder, sig: Any, args: Any) -> ir.Value:
        left, right = sig.args
        if isinstance(left, Mask):
            return getattr(builder, _ARITHMETIC[meaning][1])(*args)
        lanes = operands(left, right)
        a = widen(context, builder, args[0], left, lanes)
        b = widen(context, builder, args[1], right, lanes)
        if meaning not in _COMPARISON:
            return getattr(builder, _instruction(meaning, lanes.element))(a, b)
        sign = _COMPARISON[meaning]
        if isinstance(lanes.element, types.Float):
            return MASKS.compared(builder, sign, a, b)
        signed = lanes.element.signed
        compare = builder.icmp_signed if signed else builder.icmp_unsigned
        return MASKS.from_bits(builder, compare(sign, a, b))

    lower_builtin(op, Lanes, Lanes)(lower)
    for scalar in SCALARS:
        lower_builtin(op, Lanes, scalar)(lower)
        lower_builtin(op, scalar, Lanes)(lower)
    if meaning in _ON_MASKS:
        lower_builtin(op, Mask, Mask)(lower)


for _op in (*_ARITHMETIC, *_COMPARISON):
    _declare_binary(_op, _op)
for _op, _meaning in _INPLACE.items():
    _declare_binary(_op, _meaning)


@infer_global(operator.neg)
class _Negation(AbstractTemplate):
    metadata = _FIRST

    def generic(self, args: Any, kws: Any) -> Any:
        return signature(args[0], args[0]) if isinstance(args[0], Lanes) else None


@lower_builtin(operator.neg, Lanes)
def _negate(context: Any, builder: ir.IRBuilder, sig: Any, args: Any) -> ir.Value:
    if isinstance(sig.args[0].element, types.Float):
        return builder.fneg(args[0])
    return builder.neg(args[0])


@infer_global(operator.invert)
class _Inversion(AbstractTemplate):
    metadata = _FIRST

    def generic(self, args: Any, kws: Any) -> Any:
        (value,) = args
        integer = isinstance(value, Lanes) and isinstance(value.element, types.Integer)
        return signature(value, value) if integer or isinstance(value, Mask) else None


@lower_builtin(operator.invert, Lanes)
@lower_builtin(operator.invert, Mask)
def _invert(context: Any, builder: ir.IRBuilder, sig: Any, args: Any) -> ir.Value:
    return builder.not_(args[0])
