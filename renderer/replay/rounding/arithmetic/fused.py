"""a * b + c rounded once, where the compiler of Mitsuba's wheels has fused the two.

Our own kernels fuse nothing but box tests; a replay must do so in the same places. It is
rounded the same everywhere: a processor without the instruction calls the C library's.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.errors import TypingError
from numba.core.typing.templates import signature
from numba.extending import intrinsic
from numpy.typing import NDArray

Floats = NDArray[np.float32]


@intrinsic
def fused_multiply_add(typingctx: Any, a: Any, b: Any, c: Any) -> Any:
    """Return a * b + c of three float32."""
    if (a, b, c) != (types.float32,) * 3:
        raise TypingError(f"fused_multiply_add takes three float32, not {(a, b, c)}")

    def codegen(context: Any, builder: ir.IRBuilder, sig: Any, args: Any) -> Any:
        return builder.fma(*args)

    return signature(types.float32, a, b, c), codegen


def fused_in_numpy(a: Floats, b: Floats | np.float32, c: Floats) -> Floats:
    """Return a * b + c of float32 arrays, but for one case in 2^29 rounded once.

    The product is exact in double precision; its sum may lie between two float32 there.
    """
    return (np.multiply(a, b, dtype=np.float64) + c).astype(np.float32)
