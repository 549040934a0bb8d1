"""Lane-wise functions: `select`, `sqrt`, `minimum`, conversions, and mask queries."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import types
from numba.core.errors import TypingError
from numba.core.typing.templates import signature
from numba.extending import intrinsic

from renderer.kernels.lanes.masks import MASKS, call, joined_values, part
from renderer.kernels.lanes.types import (
    SCALARS,
    Lanes,
    Mask,
    f32x16,
    i32x16,
    llvm_vector,
    operands,
    splat_value,
    u32x16,
    widen,
)


def _suffix(lanes: Lanes) -> str:
    kind = "f" if isinstance(lanes.element, types.Float) else "i"
    return f"v{lanes.width}{kind}{lanes.element.bitwidth}"


def _require(condition: bool, what: str) -> None:
    if not condition:
        raise TypingError(what)


def _splat_to(lanes: Lanes) -> Any:
    @intrinsic
    def splat(typingctx: Any, scalar: Any) -> Any:
        _require(isinstance(scalar, SCALARS), f"cannot make {lanes} of {scalar}")

        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return widen(context, builder, args[0], sig.args[0], lanes)

        return signature(lanes, scalar), codegen

    return splat


splat_f32 = _splat_to(f32x16)
splat_i32 = _splat_to(i32x16)
splat_u32 = _splat_to(u32x16)


def _indices(lanes: Lanes, doc: str) -> Any:
    @intrinsic
    def indices(typingctx: Any) -> Any:
        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return ir.Constant(llvm_vector(lanes), list(range(lanes.width)))

        return signature(lanes), codegen

    indices.__doc__ = doc
    return indices


lane_index = _indices(i32x16, "Return i32x16 (0, 1, ..., 15).")
lane_index_4 = _indices(Lanes(types.int32, 4), "Return i32x4 (0, 1, 2, 3).")
lane_index_8 = _indices(Lanes(types.int32, 8), "Return i32x8 (0, 1, ..., 7).")


@intrinsic
def splat_mask(typingctx: Any, flag: Any) -> Any:
    """Return a mask of 16 copies of a boolean."""
    _require(isinstance(flag, types.Boolean), "splat_mask takes a boolean")

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        flag = context.cast(builder, args[0], sig.args[0], types.boolean)
        bits = ir.VectorType(ir.IntType(1), 16)
        return MASKS.from_bits(builder, splat_value(builder, flag, bits))

    return signature(Mask(16), flag), codegen


@intrinsic
def select(typingctx: Any, mask: Any, yes: Any, no: Any) -> Any:
    """Return `yes` where the mask is set and `no` elsewhere, per lane.

    With a single boolean it selects one of two scalars, so that a formula for lanes also
    works for scalars. It never branches.
    """
    one = isinstance(mask, types.Boolean)
    _require(one or isinstance(mask, Mask), f"select needs a mask, not {mask}")
    if yes == no and isinstance(yes, Mask):
        result: Any = yes
    elif one and isinstance(yes, SCALARS) and isinstance(no, SCALARS):
        result = typingctx.unify_types(yes, no)
    else:
        result = operands(yes, no)
    fits = result is not None and getattr(mask, "width", 0) == getattr(result, "width", 0)
    _require(fits, f"select cannot mix {yes} and {no} under {mask}")

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        if one:
            a, b = (context.cast(builder, args[k], sig.args[k], result) for k in (1, 2))
            return builder.select(context.cast(builder, args[0], mask, types.boolean), a, b)
        a = widen(context, builder, args[1], sig.args[1], result)
        b = widen(context, builder, args[2], sig.args[2], result)
        return MASKS.chosen(builder, args[0], a, b)

    return signature(result, mask, yes, no), codegen


def _float_function(llvm_name: str, doc: str) -> Any:
    @intrinsic
    def function(typingctx: Any, x: Any) -> Any:
        element = x.element if isinstance(x, Lanes) else x
        _require(isinstance(element, types.Float), f"{llvm_name} needs floats, not {x}")

        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            suffix = _suffix(x) if isinstance(x, Lanes) else f"f{x.bitwidth}"
            return call(builder, f"llvm.{llvm_name}.{suffix}", args[0].type, args[0])

        return signature(x, x), codegen

    function.__doc__ = doc
    return function


sqrt = _float_function("sqrt", "Square root, correctly rounded; also of a scalar.")
fabs = _float_function("fabs", "Absolute value; also of a scalar.")
floor = _float_function("floor", "Largest whole number not above; also of a scalar.")


def _extremum(sign: str) -> Any:
    @intrinsic
    def function(typingctx: Any, a: Any, b: Any) -> Any:
        lanes = operands(a, b)
        if lanes is None and isinstance(a, SCALARS) and isinstance(b, SCALARS):
            lanes = typingctx.unify_types(a, b)
        element = getattr(lanes, "element", lanes)
        is_number = isinstance(element, types.Integer | types.Float)
        _require(is_number, f"cannot compare {a} and {b}")

        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            pairs = zip(args, sig.args, strict=True)
            if lanes is element:
                x, y = (context.cast(builder, *of, lanes) for of in pairs)
            else:
                x, y = (widen(context, builder, *of, lanes) for of in pairs)
            if isinstance(element, types.Float):
                return MASKS.extreme(builder, sign, x, y)
            signed = builder.icmp_signed if element.signed else builder.icmp_unsigned
            return builder.select(signed(sign, x, y), x, y)

        return signature(lanes, a, b), codegen

    return function


# Of lanes or scalars. If either operand is NaN the result is b, as of the x86 instruction:
# a slab test with the running bound as b ignores 0 * inf = NaN.
minimum = _extremum("<")
maximum = _extremum(">")


@intrinsic
def to_i32(typingctx: Any, x: Any) -> Any:
    """Round toward zero; out of range gives the smallest or largest int, NaN gives 0.

    LLVM's `llvm.fptosi.sat` is scalarised: a hundred instructions instead of six.
    """
    _require(x == f32x16, f"to_i32 takes f32x16, not {x}")

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        def everywhere(number: float, lanes: Lanes) -> ir.Value:
            return ir.Constant(llvm_vector(lanes), [number] * lanes.width)

        low, high = everywhere(-(2.0**31), f32x16), everywhere(2.0**31, f32x16)
        below = builder.fcmp_ordered("<", args[0], low)
        above = builder.fcmp_ordered(">=", args[0], high)
        inside = builder.and_(
            builder.fcmp_ordered(">=", args[0], low),
            builder.fcmp_ordered("<", args[0], high),
        )
        # fptosi is undefined out of range
        within = builder.select(inside, args[0], everywhere(0.0, f32x16))
        whole = builder.fptosi(within, llvm_vector(i32x16))
        whole = builder.select(below, everywhere(-(2**31), i32x16), whole)
        return builder.select(above, everywhere(2**31 - 1, i32x16), whole)

    return signature(i32x16, x), codegen


@intrinsic
def to_f32(typingctx: Any, x: Any) -> Any:
    """Convert whole numbers to the nearest floats."""
    whole = isinstance(x, Lanes) and x.element in (types.int32, types.uint32)
    _require(whole, f"to_f32 takes lanes of 32-bit integers, not {x}")
    result = Lanes(types.float32, x.width)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        convert = builder.sitofp if x.element.signed else builder.uitofp
        return convert(args[0], llvm_vector(result))

    return signature(result, x), codegen


def _to_precision(element: Any, convert: str, doc: str) -> Any:
    """Make the conversion of floats, lanes or scalar, to another precision."""

    @intrinsic
    def function(typingctx: Any, x: Any) -> Any:
        given = x.element if isinstance(x, Lanes) else x
        _require(isinstance(given, types.Float), f"{x} is no float")
        result = Lanes(element, x.width) if isinstance(x, Lanes) else element

        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            if given == element:
                return args[0]
            return getattr(builder, convert)(args[0], context.get_value_type(result))

        return signature(result, x), codegen

    function.__doc__ = doc
    return function


to_double = _to_precision(types.float64, "fpext", "Floats in double precision.")
to_single = _to_precision(types.float32, "fptrunc", "Floats rounded to single precision.")


@intrinsic
def any_of(typingctx: Any, mask: Any) -> Any:
    """Return whether any lane of a mask is set; a scalar boolean is returned as it is."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        if not isinstance(mask, Mask):
            return args[0]
        bits = MASKS.packed(builder, args[0])
        return builder.icmp_unsigned("!=", bits, bits.type(0))

    return signature(types.boolean, mask), codegen


def _reinterpret_as(element: Any, doc: str) -> Any:
    @intrinsic
    def reinterpret(typingctx: Any, x: Any) -> Any:
        given = x.element if isinstance(x, Lanes) else x
        same_size = getattr(given, "bitwidth", 0) == element.bitwidth
        _require(same_size, f"{x} has other bits than {element}")
        result = Lanes(element, x.width) if isinstance(x, Lanes) else element

        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return builder.bitcast(args[0], context.get_value_type(result))

        return signature(result, x), codegen

    reinterpret.__doc__ = doc
    return reinterpret


as_f32 = _reinterpret_as(types.float32, "The same bits as float32, of lanes or a scalar.")
as_i32 = _reinterpret_as(types.int32, "The same bits as int32, of lanes or a scalar.")
as_u32 = _reinterpret_as(types.uint32, "The same bits as uint32, of lanes or a scalar.")


def _half(upper: bool, doc: str) -> Any:
    @intrinsic
    def half(typingctx: Any, x: Any) -> Any:
        _require(isinstance(x, Lanes), f"lanes are halved, not {x}")
        width = x.width // 2

        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return part(builder, args[0], width if upper else 0, width)

        return signature(Lanes(x.element, width), x), codegen

    half.__doc__ = doc
    return half


lower_half = _half(False, "Return the first half of the lanes.")
upper_half = _half(True, "Return the second half of the lanes.")


@intrinsic
def joined(typingctx: Any, a: Any, b: Any) -> Any:
    """Concatenate the lanes of a and b.

    Operations on the result become pairs of independent instructions, which helps where a
    formula is one long dependency chain.
    """
    _require(isinstance(a, Lanes | Mask) and a == b, f"cannot join {a} and {b}")
    both = Mask(2 * a.width) if isinstance(a, Mask) else Lanes(a.element, 2 * a.width)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return joined_values(builder, list(args))

    return signature(both, a, b), codegen


@intrinsic
def negate_by_sign(typingctx: Any, x: Any, sign: Any) -> Any:
    """Return float32 x, negated where the sign bit of `sign` is set, also for -0.

    One instruction, instead of three for a comparison with 0 and a select.
    """
    _require(x == sign, f"{x} and {sign} differ")
    whole = Lanes(types.int32, x.width) if isinstance(x, Lanes) else types.int32

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        bits = context.get_value_type(whole)
        value, other = (builder.bitcast(a, bits) for a in args)
        highest = ir.IntType(32)(-(2**31))
        if isinstance(whole, Lanes):
            highest = splat_value(builder, highest, bits)
        flipped = builder.xor(value, builder.and_(other, highest))
        return builder.bitcast(flipped, args[0].type)

    return signature(x, x, sign), codegen


@intrinsic
def mask_bits(typingctx: Any, mask: Any) -> Any:
    """Return the mask as an integer, lane 0 in the lowest bit; 0 if no lane is set."""
    _require(isinstance(mask, Mask), f"mask_bits needs a mask, not {mask}")

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.zext(MASKS.packed(builder, args[0]), ir.IntType(64))

    return signature(types.int64, mask), codegen


@intrinsic
def mask_of(typingctx: Any, bits: Any) -> Any:
    """Return the 16-lane mask given by the lowest bits of an int64."""
    _require(bits == types.int64, f"mask_of takes int64, not {bits}")

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        packed = builder.trunc(args[0], ir.IntType(16))
        bits = builder.bitcast(packed, ir.VectorType(ir.IntType(1), 16))
        return MASKS.from_bits(builder, bits)

    return signature(Mask(16), bits), codegen


@intrinsic
def popcount(typingctx: Any, bits: Any) -> Any:
    """Return the number of set bits of an int64."""
    _require(bits == types.int64, f"popcount takes int64, not {bits}")

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return call(builder, "llvm.ctpop.i64", ir.IntType(64), args[0])

    return signature(types.int64, bits), codegen


@intrinsic
def lowest_bit(typingctx: Any, bits: Any) -> Any:
    """Return the index of the lowest set bit of an int64 (64 for 0)."""
    _require(bits == types.int64, f"lowest_bit takes int64, not {bits}")

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        no = ir.Constant(ir.IntType(1), 0)
        return call(builder, "llvm.cttz.i64", ir.IntType(64), args[0], no)

    return signature(types.int64, bits), codegen


@intrinsic
def bit_reverse(typingctx: Any, x: Any) -> Any:
    """Reverse the order of the 32 bits in each lane."""
    fits = isinstance(x, Lanes) and x.element == types.uint32
    _require(fits, f"bit_reverse takes lanes of uint32, not {x}")

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        name = f"llvm.bitreverse.{_suffix(x)}"
        return call(builder, name, args[0].type, args[0])

    return signature(x, x), codegen


@intrinsic
def first_lanes(typingctx: Any, count: Any) -> Any:
    """Return a mask of the first `count` of 16 lanes (all when `count` is above 16)."""
    _require(isinstance(count, types.Integer), "first_lanes takes an integer")

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        number = context.cast(builder, args[0], count, types.int64)
        big = builder.icmp_signed(">", number, ir.Constant(ir.IntType(64), 16))
        number = builder.select(big, ir.Constant(ir.IntType(64), 16), number)
        limit = builder.trunc(number, ir.IntType(32))
        index = ir.Constant(llvm_vector(i32x16), list(range(16)))
        bits = builder.icmp_signed("<", index, splat_value(builder, limit, index.type))
        return MASKS.from_bits(builder, bits)

    return signature(Mask(16), count), codegen


@intrinsic
def lane(typingctx: Any, x: Any, k: Any) -> Any:
    """Return lane `k` of x as a scalar."""
    _require(isinstance(x, Lanes) and isinstance(k, types.Integer), "lane(lanes, index)")

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        index = context.cast(builder, args[1], k, types.int32)
        return builder.extract_element(args[0], index)

    return signature(x.element, x, k), codegen


def _reduction(sign: str, doc: str) -> Any:
    @intrinsic
    def function(typingctx: Any, x: Any) -> Any:
        single = isinstance(x, Lanes) and x.element in (types.float32, types.int32)
        _require(single, f"cannot reduce {x}")

        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            if x.element == types.int32:
                name = f"llvm.vector.reduce.{_REDUCTIONS[sign]}.{_suffix(x)}"
                return call(builder, name, ir.IntType(32), args[0])
            # LLVM's own float reduction is scalarised
            lanes, width = args[0], x.width
            while width > 1:
                width //= 2
                halves = part(builder, lanes, 0, width), part(builder, lanes, width, width)
                lanes = MASKS.extreme(builder, sign, *halves)
            return builder.extract_element(lanes, ir.IntType(32)(0))

        return signature(x.element, x), codegen

    function.__doc__ = doc
    return function


_REDUCTIONS = {"<": "smin", ">": "smax"}
largest = _reduction(">", "The largest lane; none may be NaN.")
smallest = _reduction("<", "The smallest lane; none may be NaN.")
