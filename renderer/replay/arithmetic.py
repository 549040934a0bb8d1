"""Mitsuba's floating-point arithmetic, bit for bit: fused operations, reciprocals, arcs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import config
from numba.core.errors import TypingError
from numba.core.typing.templates import signature
from numba.extending import intrinsic
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    as_f32,
    as_i32,
    fabs,
    maximum,
    minimum,
    select,
    splat_f32,
    sqrt,
)
from renderer.kernels.lanes.types import Lanes, operands, widen
from renderer.kernels.lanes.vectors import vec3

# -------------------------------------------------------------------------------- fused
# a * b + c rounded once, where the compiler of Mitsuba's wheels has fused the two.
#
# Other kernels of this renderer fuse nothing but box tests; a replay must fuse where
# Mitsuba does. The result is the same on every machine: a processor without the
# instruction calls the C library.

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
    """Return a * b + c of float32 arrays, rounded once except in one case of 2^29.

    The product is exact in double precision. The sum is rounded there before it is rounded
    to float32, which can round a tie the wrong way.
    """
    return (np.multiply(a, b, dtype=np.float64) + c).astype(np.float32)


# -------------------------------------------------------------------------- fused lanes
# a * b + c rounded once, in 16 lanes: only for what must equal another renderer.
#
# The other kernels fuse nothing but box tests (`multiply_add` in `lanes.mathematics`). The
# result is the same on every machine: a processor without the instruction calls the C
# library.


@intrinsic
def fused(typingctx: Any, a: Any, b: Any, c: Any) -> Any:
    """Return a * b + c; a or b must be lanes, and c lanes or a number."""
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


# ------------------------------------------------------------------------- rounded once
# Vector arithmetic with the fused multiply-adds of Mitsuba's wheels, on float32 scalars.
#
# Which products are fused, and the order of sums, was found by trial on thousands of hits:
# with these, positions, uv and normals are Mitsuba's bit for bit.

_ONE = np.float32(1.0)
_ZERO = np.float32(0.0)


@kernel
def fused_cross(a, b):
    """Return a x b; in each component the second product is rounded first."""
    return vec3(
        fused_multiply_add(a.y, b.z, -(a.z * b.y)),
        fused_multiply_add(a.z, b.x, -(a.x * b.z)),
        fused_multiply_add(a.x, b.y, -(a.y * b.x)),
    )


@kernel
def fused_dot(a, b):
    """Return a . b, summed from the last component."""
    return fused_multiply_add(a.x, b.x, fused_multiply_add(a.y, b.y, a.z * b.z))


@kernel
def fused_affine(row, at, p):
    """Return row . p + at, summed from the translation."""
    x = fused_multiply_add(row.x, p.x, at)
    return fused_multiply_add(row.z, p.z, fused_multiply_add(row.y, p.y, x))


@kernel
def times_point(rows, first, k, p):
    """Transform point p by the 3 x 4 matrix in rows first .. first + 11 of column k.

    Row by row, with the fused multiply-adds of Mitsuba.
    """
    return vec3(
        _row_times(rows, first, k, rows[first + 3, k], p),
        _row_times(rows, first + 4, k, rows[first + 7, k], p),
        _row_times(rows, first + 8, k, rows[first + 11, k], p),
    )


@kernel
def times_vector(rows, first, k, a):
    """Return the same matrix times the vector a, without the translation."""
    return vec3(
        _row_times(rows, first, k, -_ZERO, a),
        _row_times(rows, first + 4, k, -_ZERO, a),
        _row_times(rows, first + 8, k, -_ZERO, a),
    )


@kernel
def fused_times(x, y, z, a):
    """Return the matrix with rows x, y, z times a, summed from the first column."""
    zero = -_ZERO  # the zero to which a product can be added unchanged
    return vec3(
        fused_affine(x, zero, a), fused_affine(y, zero, a), fused_affine(z, zero, a)
    )


@kernel
def _row_times(rows, row, k, at, p):
    return fused_affine(vec3(rows[row, k], rows[row + 1, k], rows[row + 2, k]), at, p)


@kernel
def fused_sum(a, s, b):
    """Return a s + b for vectors a, b and a scalar s."""
    return vec3(
        fused_multiply_add(a.x, s, b.x),
        fused_multiply_add(a.y, s, b.y),
        fused_multiply_add(a.z, s, b.z),
    )


@kernel
def unit(a):
    """Return a / |a|; the square is summed as in four lanes: x and z first."""
    return a * (_ONE / np.sqrt((a.x * a.x + a.z * a.z) + a.y * a.y))


# --------------------------------------------------------------------------- reciprocal
# 1 / a as Embree computes it: the processor's table estimate and one Newton step.
#
# In one quotient of two hundred the last bit depends on the table, and tables differ
# between vendors and generations of processors. So a replay executes the same instruction
# as Embree on the same machine. With it (u, v) on triangles were Mitsuba's bit for bit on
# 4640 of 4640 hits, with a division on 99.5 %.

_FOUR = ir.VectorType(ir.FloatType(), 4)


def guess_instruction() -> str:
    """Return LLVM's name of Embree's estimate instruction here, "" if Embree divides."""
    if config.CPU_NAME or config.CPU_FEATURES is not None:
        return ""  # Numba was told to compile for another processor
    if not llvm.get_process_triple().startswith(("x86_64", "i686")):
        return ""
    if config.ENABLE_AVX and llvm.get_host_cpu_features().get("avx512vl", False):
        return "llvm.x86.avx512.rcp14.ss"
    return "llvm.x86.sse.rcp.ss"


def table_instruction() -> str:
    """Return LLVM's name of the estimate instruction in Mitsuba's wheel, "" if it divides.

    The wheel is built without AVX-512, whatever processor it runs on.
    """
    name = guess_instruction()
    return "llvm.x86.sse.rcp.ss" if name else ""


def _guess_by(instruction: Callable[[], str]) -> Any:
    @intrinsic
    def guess(typingctx: Any, a: Any) -> Any:
        def codegen(context: Any, builder: ir.IRBuilder, sig: Any, args: Any) -> Any:
            name = instruction()
            if not name:
                return builder.fdiv(ir.Constant(ir.FloatType(), 1.0), args[0])
            first = ir.Constant(ir.IntType(32), 0)
            a = builder.insert_element(ir.Constant(_FOUR, None), args[0], first)
            operands = [a]
            if name.endswith("rcp14.ss"):  # (upper lanes, a, value of masked lanes, mask)
                operands = [a, a, a, ir.Constant(ir.IntType(8), 0xFF)]
            kind = ir.FunctionType(_FOUR, [operand.type for operand in operands])
            function = builder.module.globals.get(name)
            function = function or ir.Function(builder.module, kind, name)
            return builder.extract_element(builder.call(function, operands), first)

        return signature(types.float32, types.float32), codegen

    return guess


_embree_guess, _mitsuba_guess = _guess_by(guess_instruction), _guess_by(table_instruction)


@kernel
def reciprocal(a):
    """Return 1 / a as Embree computes it, float32, within two units in the last place."""
    r = _embree_guess(a)
    return fused_multiply_add(r, fused_multiply_add(-a, r, _ONE), r)


@kernel
def reciprocal_in_matrices(a):
    """Return 1 / a as Mitsuba inverts a scale: 2 r - (r a) r from the estimate r.

    On an Intel processor 1 / a rounded agrees in 67 of 100 cases, this in all.
    """
    r = _mitsuba_guess(a)
    return fused_multiply_add(-(r * a), r, r + r)


# --------------------------------------------------------------------------------- arcs
# Mitsuba's arc tangent and arc cosine: Cephes' polynomials, summed in pairs and fused.

_SIGN_BIT = -0x80000000
_PI = np.float32(np.pi)
_HALF_PI = np.float32(0.5 * np.pi)
_ARC_TANGENT = tuple(
    np.float32(c)
    for c in (
        *(0.99999934166683966009, -0.33326497518773606976, 0.19881342388439013552),
        *(-0.13486708938456973185, 0.083863120428809689910, -0.037006525670417265220),
        0.0078613793713198150252,
    )
)
_ARC_SINE = tuple(
    np.float32(c)
    for c in (
        *(1.666675242e-1, 7.4953002686e-2, 4.5470025998e-2, 2.4181311049e-2),
        4.2163199048e-2,
    )
)


@kernel
def arctan2_as_mitsuba(y, x):
    """Return the angle of (x, y) in [-pi, pi], with Mitsuba's error of up to 6e-7."""
    across, up = fabs(x), fabs(y)
    larger = maximum(across, up)
    ratio = minimum(across, up) / select(larger > 0.0, larger, splat_f32(1.0))
    z = ratio * ratio
    z2 = z * z
    c = _ARC_TANGENT
    low = fused(z2, fused(z, c[3], splat_f32(c[2])), fused(z, c[1], splat_f32(c[0])))
    high = fused(z2, c[6], fused(z, c[5], splat_f32(c[4])))
    t = fused(z2 * z2, high, low) * ratio
    t = select(up > across, _HALF_PI - t, t)
    t = select(x < 0.0, _PI - t, t)
    return select(y < 0.0, -t, t)


@kernel
def arccos_as_mitsuba(x):
    """Return the arc cosine in [0, pi] of lanes clamped to [-1, 1]."""
    x = minimum(maximum(x, splat_f32(-1.0)), splat_f32(1.0))
    magnitude = fabs(x)
    steep = magnitude > 0.5
    half = 0.5 * (1.0 - magnitude)
    z = select(steep, half, x * x)
    r = select(steep, sqrt(half), magnitude)
    z2 = z * z
    c = _ARC_SINE
    low = fused(z2, fused(z, c[3], splat_f32(c[2])), fused(z, c[1], splat_f32(c[0])))
    arc = fused(fused(z2 * z2, c[4], low), z * r, r)
    twice = arc + arc
    signed = as_f32(as_i32(arc) | (as_i32(x) & _SIGN_BIT))
    return select(steep, select(x < 0.0, _PI - twice, twice), _HALF_PI - signed)
