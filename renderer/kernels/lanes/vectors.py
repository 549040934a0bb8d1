"""Three-component vectors for kernels: `vec3(x, y, z)` with ordinary operators.

The components are scalars or lanes, so one formula serves one ray or 16. A vector of
scalars mixed with lanes is broadcast to every lane.
"""

from __future__ import annotations

import math
import operator
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.errors import TypingError
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import (
    intrinsic,
    make_attribute_wrapper,
    models,
    register_model,
    type_callable,
)
from numba.np.arrayobj import make_array, populate_array

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    as_i32,
    fabs,
    lower_half,
    select,
    sqrt,
    upper_half,
)
from renderer.kernels.lanes.memory import (
    append_row,
    gather_columns,
    gather_row,
    load_one,
    load_row,
    store_row,
    store_where,
)
from renderer.kernels.lanes.types import Lanes, operands, widen


class Vec3Type(types.Type):
    """Numba type of a vector whose three components have the type `element`."""

    def __init__(self, element: types.Type) -> None:
        self.element = element
        super().__init__(name=f"Vec3({element})")


@register_model(Vec3Type)
class _Vec3Model(models.StructModel):
    def __init__(self, dmm: Any, fe_type: Vec3Type) -> None:
        members = [(name, fe_type.element) for name in "xyz"]
        super().__init__(dmm, fe_type, members)


for _name in "xyz":
    make_attribute_wrapper(Vec3Type, _name, _name)


def vec3(x: Any, y: Any, z: Any) -> Any:
    """Make a vector; for kernels only."""
    raise TypeError("vec3 exists inside kernels only")


def _common(a: Any, b: Any) -> Any:
    """Return the component type of an operation on components of types a and b."""
    if isinstance(a, Lanes) or isinstance(b, Lanes):
        return operands(a, b)
    return a if isinstance(a, types.Number) and isinstance(b, types.Number) else None


@type_callable(vec3)
def _type_vec3(context: Any) -> Any:
    def typer(x: Any, y: Any, z: Any) -> Any:
        first = _common(x, y)
        element = None if first is None else _common(first, z)
        return None if element is None else Vec3Type(element)

    return typer


@lower_builtin(vec3, types.Any, types.Any, types.Any)
def _lower_vec3(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    element = sig.return_type.element
    vector = cgutils.create_struct_proxy(sig.return_type)(context, builder)
    for name, given, value in zip("xyz", sig.args, args, strict=True):
        if isinstance(element, Lanes):
            converted = widen(context, builder, value, given, element)
        else:
            converted = context.cast(builder, value, given, element)
        setattr(vector, name, converted)
    return vector._getvalue()


def _declare(op: Any) -> None:
    """Define `op` componentwise for vector-vector and vector-number pairs."""

    class Typing(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            left, right = args
            if not (isinstance(left, Vec3Type) or isinstance(right, Vec3Type)):
                return None
            a = left.element if isinstance(left, Vec3Type) else left
            b = right.element if isinstance(right, Vec3Type) else right
            element = _common(a, b)
            if not isinstance(left, Vec3Type):  # number first: the vector's precision
                element = _common(b, a)
            return None if element is None else signature(Vec3Type(element), left, right)

    infer_global(op)(Typing)

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        element = sig.return_type.element
        result = cgutils.create_struct_proxy(sig.return_type)(context, builder)
        sides = []
        for given, value in zip(sig.args, args, strict=True):
            if isinstance(given, Vec3Type):
                struct = cgutils.create_struct_proxy(given)(context, builder, value)
                sides.append((given.element, [getattr(struct, n) for n in "xyz"]))
            else:
                sides.append((given, [value] * 3))
        (left, a), (right, b) = sides
        if not isinstance(element, Lanes):
            a = [context.cast(builder, v, left, element) for v in a]
            b = [context.cast(builder, v, right, element) for v in b]
            left = right = element
        component = context.get_function(op, signature(element, left, right))
        for name, p, q in zip("xyz", a, b, strict=True):
            setattr(result, name, component(builder, (p, q)))
        return result._getvalue()

    lower_builtin(op, Vec3Type, Vec3Type)(lower)
    for number in (types.Number, Lanes):
        lower_builtin(op, Vec3Type, number)(lower)
        lower_builtin(op, number, Vec3Type)(lower)


for _op in (operator.add, operator.sub, operator.mul, operator.truediv):
    _declare(_op)


@infer_global(operator.neg)
class _Negation(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        return signature(args[0], args[0]) if isinstance(args[0], Vec3Type) else None


@lower_builtin(operator.neg, Vec3Type)
def _negate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    element = sig.args[0].element
    given = cgutils.create_struct_proxy(sig.args[0])(context, builder, args[0])
    result = cgutils.create_struct_proxy(sig.args[0])(context, builder)
    component = context.get_function(operator.neg, signature(element, element))
    for name in "xyz":
        setattr(result, name, component(builder, (getattr(given, name),)))
    return result._getvalue()


@kernel
def dot(a, b):
    """Return the inner product."""
    return a.x * b.x + a.y * b.y + a.z * b.z


@kernel
def cross(a, b):
    """Return the cross product, right-handed."""
    return vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)


@kernel
def length(a):
    """Return the Euclidean norm."""
    return sqrt(dot(a, a))


@kernel
def normalize(a):
    """Return a / |a|."""
    return a * (1.0 / length(a))


@kernel
def select3(mask, a, b):
    """Return `a` where the mask is set and `b` elsewhere."""
    return vec3(select(mask, a.x, b.x), select(mask, a.y, b.y), select(mask, a.z, b.z))


@kernel
def orthonormal_basis(n):
    """Return two unit vectors that complete the unit vector n to a right-handed frame.

    Branchless and continuous except at n.z = 0 [Duff2017, listing 3]. As there, the sign is
    that of the sign bit: -0 is negative.
    """
    sign = select(as_i32(n.z) < 0, n.z * 0.0 - 1.0, n.z * 0.0 + 1.0)
    a = -1.0 / (sign + n.z)
    b = n.x * n.y * a
    tangent = vec3(1.0 + sign * n.x * n.x * a, sign * b, -(sign * n.x))
    return tangent, vec3(b, sign + n.y * n.y * a, -n.y)


@kernel
def column(array, k):
    """Return the vector in column k of a (3, n) array."""
    return column3(array, 0, k)


@kernel
def column3(array, row, k):
    """Return rows row to row + 2 of column k as scalars."""
    return vec3(
        load_one(array, row, k), load_one(array, row + 1, k), load_one(array, row + 2, k)
    )


@kernel
def load3(array, i):
    """Load columns i to i + 15 of a (3, n) array as a vector of lanes."""
    return vec3(load_row(array, 0, i), load_row(array, 1, i), load_row(array, 2, i))


@kernel
def lower_half3(a):
    """Return the first half of the lanes of a vector."""
    return vec3(lower_half(a.x), lower_half(a.y), lower_half(a.z))


@kernel
def upper_half3(a):
    """Return the second half of the lanes of a vector."""
    return vec3(upper_half(a.x), upper_half(a.y), upper_half(a.z))


@kernel
def store3(array, i, a):
    """Store a vector of lanes to columns i to i + 15 of a (3, n) array."""
    store_row(array, 0, i, a.x)
    store_row(array, 1, i, a.y)
    store_row(array, 2, i, a.z)


@kernel
def store3_where(array, i, a, mask):
    """Store the masked lanes of a vector to columns i to i + 15 of a (3, n) array."""
    store_where(array, 0, i, a.x, mask)
    store_where(array, 1, i, a.y, mask)
    store_where(array, 2, i, a.z, mask)


@kernel
def gather3(array, indices, mask):
    """Load the columns `indices` of a (3, n) array; lanes outside the mask are 0."""
    return vec3(
        gather_row(array, 0, indices, mask),
        gather_row(array, 1, indices, mask),
        gather_row(array, 2, indices, mask),
    )


@kernel
def gather_vectors(table, indices, mask):
    """Load vectors from a column-major table (4, n); see `gather_columns`."""
    x, y, z, _ = gather_columns(table, 0, indices, mask)
    return vec3(x, y, z)


@kernel
def gather_rows3(array, row, indices, mask):
    """Load rows row to row + 2 of the columns `indices`; lanes outside the mask are 0."""
    return vec3(
        gather_row(array, row, indices, mask),
        gather_row(array, row + 1, indices, mask),
        gather_row(array, row + 2, indices, mask),
    )


@kernel
def append3(array, i, a, mask):
    """Store the masked lanes of a vector contiguously from column i on."""
    append_row(array, 0, i, a.x, mask)
    append_row(array, 1, i, a.y, mask)
    append_row(array, 2, i, a.z, mask)


# -------------------------------------------------------------------------------- local
# Small arrays on the stack, for traversals: no allocation, no reference counting.

_CACHE_LINE = 64  # bytes, as many as 16 float32: no load of 16 lanes crosses two lines


def _reserve(builder: ir.IRBuilder, whole: ir.Type) -> ir.Value:
    """Reserve uninitialised memory in the function's stack frame.

    Numba's `alloca_once` stores zeros, as one value of thousands of elements. That cost
    LLVM 2.8 of the 20.7 s that the wide hierarchy and its scene compiled.
    """
    with builder.goto_entry_block():
        memory = builder.alloca(whole)
    memory.align = _CACHE_LINE
    return memory


def _array_of(context: Any, builder: Any, array: types.Array, shape: Any) -> Any:
    """Return an array of constant shape in the function's stack frame."""
    item = context.get_data_type(array.dtype)
    memory = _reserve(builder, ir.ArrayType(item, math.prod(shape)))
    bytes_each = context.get_abi_sizeof(item)
    before = [
        shape[k + 1 :] if array.layout == "C" else shape[:k] for k in range(len(shape))
    ]
    strides = [bytes_each * math.prod(sizes) for sizes in before]
    struct = make_array(array)(context, builder)
    word = context.get_constant
    populate_array(
        struct,
        data=builder.bitcast(memory, item.as_pointer()),
        shape=[word(types.intp, size) for size in shape],
        strides=[word(types.intp, stride) for stride in strides],
        itemsize=word(types.intp, bytes_each),
        meminfo=None,
    )
    return struct._getvalue()


def _local_array(element: types.Number) -> Any:
    @intrinsic
    def local_array(typingctx: Any, size: Any) -> Any:
        if not isinstance(size, types.IntegerLiteral):
            raise TypingError("the size of a local array must be a constant")
        array = types.Array(element, 1, "C")

        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return _array_of(context, builder, array, (size.literal_value,))

        return signature(array, size), codegen

    return local_array


def _local_rows(element: types.Number, layout: str = "C") -> Any:
    @intrinsic
    def local_rows(typingctx: Any, rows: Any, size: Any) -> Any:
        if not all(isinstance(n, types.IntegerLiteral) for n in (rows, size)):
            raise TypingError("the shape of a local array must be constant")
        array = types.Array(element, 2, layout)

        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            shape = (rows.literal_value, size.literal_value)
            return _array_of(context, builder, array, shape)

        return signature(array, rows, size), codegen

    return local_rows


# `local_i32(64)` is 64 uninitialised numbers that live as long as the function. The size
# must be a constant, and the array must not be returned.
local_i32 = _local_array(types.int32)
local_i64 = _local_array(types.int64)
local_f32 = _local_array(types.float32)
local_f64 = _local_array(types.float64)

# `local_rows_f32(3, 64)` is three such rows as one array: seven fields to pass to a kernel
# instead of 21.
local_rows_i32 = _local_rows(types.int32)
local_rows_f32 = _local_rows(types.float32)
# the same shape in column-major order
local_columns_f32 = _local_rows(types.float32, "F")


# ------------------------------------------------------------------------------- affine
# Affine maps of rays, points and normals, as scalars or in 16 lanes.


class Affine(NamedTuple):
    """The rows of a matrix, and a translation; scalars or lanes."""

    x: Any
    y: Any
    z: Any
    at: Any


@kernel
def affine_at(numbers, k):
    """Return map k of `Placements.to_world` or `to_object`, as scalars."""
    n = np.int64(12) * k
    return Affine(
        vec3(numbers[n], numbers[n + 1], numbers[n + 2]),
        vec3(numbers[n + 3], numbers[n + 4], numbers[n + 5]),
        vec3(numbers[n + 6], numbers[n + 7], numbers[n + 8]),
        vec3(numbers[n + 9], numbers[n + 10], numbers[n + 11]),
    )


@kernel
def _three(numbers, n, mask):
    return vec3(
        gather_row(numbers, 0, n, mask),
        gather_row(numbers, 0, n + 1, mask),
        gather_row(numbers, 0, n + 2, mask),
    )


@kernel
def affine_of(numbers, k, mask):
    """Return the maps of 16 instances as lanes; zeros outside the mask."""
    n = k * 12
    return Affine(
        _three(numbers, n, mask),
        _three(numbers, n + 3, mask),
        _three(numbers, n + 6, mask),
        _three(numbers, n + 9, mask),
    )


@kernel
def times(m, a):
    """Return the matrix of m times the vector a."""
    return vec3(dot(m.x, a), dot(m.y, a), dot(m.z, a))


@kernel
def transposed_times(m, a):
    """Return the transposed matrix of m times the vector a."""
    return m.x * a.x + m.y * a.y + m.z * a.z


@kernel
def absolute(a):
    """Return the componentwise absolute value of a vector."""
    return vec3(fabs(a.x), fabs(a.y), fabs(a.z))


@kernel
def absolute_times(m, a):
    """Return |m| |a|, which bounds the rounding error of m a."""
    b = absolute(a)
    return vec3(
        dot(absolute(m.x), b),
        dot(absolute(m.y), b),
        dot(absolute(m.z), b),
    )
