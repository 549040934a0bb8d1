"""The Numba types `f32x16`, `i32x16`, `u32x16`, `f64x8`, ... and their masks.

A lane type is a short vector that the processor computes on in one instruction: 16 rays,
or 16 triangles, at once. Its data model is an LLVM vector; where a machine's registers
are narrower, LLVM splits it. LLVM's own vectoriser left the shading loops scalar, because
Numba's arrays may alias; saying it made shading four times as fast.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import types
from numba.core.errors import TypingError
from numba.extending import models, register_model

from renderer.kernels.lanes.masks import MASKS

WIDTH = 16  # lanes of the packets that the renderer works on


class Lanes(types.Type):
    """`width` numbers of one Numba scalar type, computed on together."""

    def __init__(self, element: Any, width: int) -> None:
        self.element = element
        self.width = width
        super().__init__(name=f"Lanes({element} x {width})")

    def can_convert_to(self, typingctx: Any, other: Any) -> None:
        """Forbid silent conversions; the explicit ones are in `functions`."""
        return None


class Mask(types.Type):
    """`width` truth values, the result of comparing lanes."""

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
    """Return the lanes of one element type that fill 512 bits: f32x16, f64x8, ..."""
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
mask16 = Mask(16)
