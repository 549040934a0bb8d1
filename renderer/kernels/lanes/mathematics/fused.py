"""Multiplication and addition in one step, for bounds that have room for rounding.

A processor with fused multiply-add does both in one instruction and rounds once; one
without does the two that `a * b + c` is. So results differ in the last bit from processor
to processor: a box that is tested with a margin may be computed so, a hit or a colour must
not.
"""

from __future__ import annotations

from typing import Any

from numba.core import types
from numba.core.errors import TypingError
from numba.core.typing.templates import signature
from numba.extending import intrinsic

from renderer.kernels.lanes.masks import call
from renderer.kernels.lanes.operators import operands, widen
from renderer.kernels.lanes.types import Lanes


@intrinsic
def multiply_add(typingctx: Any, a: Any, b: Any, c: Any) -> Any:
    """Return a * b + c of float32 lanes; scalars among them are copied to every lane."""
    lanes = next((x for x in (a, b, c) if isinstance(x, Lanes)), None)
    fits = lanes is not None and all(operands(lanes, x) == lanes for x in (a, b, c))
    if not fits or lanes.element != types.float32:
        raise TypingError(f"multiply_add needs float32 lanes, not {a}, {b} and {c}")

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        values = [
            widen(context, builder, value, of, lanes)
            for value, of in zip(args, sig.args, strict=True)
        ]
        name = f"llvm.fmuladd.v{lanes.width}f32"
        return call(builder, name, values[0].type, *values)

    return signature(lanes, a, b, c), codegen
