"""a * b + c rounded once, of sixteen lanes: only for what must equal another renderer.

The other kernels fuse nothing but box tests (`lanes.mathematics.fused`). The result is
the same on every machine: where the processor lacks the instruction, the C library's
function is called.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core.errors import TypingError
from numba.core.typing.templates import signature
from numba.extending import intrinsic

from renderer.kernels.lanes.operators import operands, widen
from renderer.kernels.lanes.types import Lanes


@intrinsic
def fused(typingctx: Any, a: Any, b: Any, c: Any) -> Any:
    """Return a * b + c; at least a or b, and c if it is no number, are float lanes."""
    lanes = operands(a, b)
    if lanes is not None:
        lanes = operands(lanes, c)
    if not (isinstance(lanes, Lanes) and isinstance(lanes.element, types.Float)):
        raise TypingError(f"cannot fuse {a} * {b} + {c}")

    def codegen(context: Any, builder: ir.IRBuilder, sig: Any, args: Any) -> Any:
        given = zip(args, (a, b, c), strict=True)
        values = [widen(context, builder, v, t, lanes) for v, t in given]
        vector = values[0].type
        name = f"llvm.fma.v{lanes.width}f{lanes.element.bitwidth}"
        function_type = ir.FunctionType(vector, [vector] * 3)
        module = builder.module
        function = module.globals.get(name) or ir.Function(module, function_type, name)
        return builder.call(function, values)

    return signature(lanes, a, b, c), codegen
