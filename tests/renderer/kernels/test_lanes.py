"""Every operator and function of `renderer.kernels.lanes` against NumPy, bit for bit.

NumPy treats a Python number next to an array as lanes treat it: the number takes the
array's element type. So one function body is run twice, on NumPy arrays as plain Python
and on lanes as a kernel, and the bits must agree.
"""

from __future__ import annotations

import numpy as np
import pytest
from numba.core.errors import TypingError

from renderer.kernels.jit import entry_kernel
from renderer.kernels.lanes.functions import (
    as_f32,
    as_i32,
    as_u32,
    bit_reverse,
    fabs,
    first_lanes,
    floor,
    joined,
    lane,
    lane_index,
    largest,
    lower_half,
    lowest_bit,
    mask_bits,
    mask_of,
    maximum,
    minimum,
    negate_by_sign,
    popcount,
    select,
    smallest,
    splat_f32,
    splat_i32,
    splat_mask,
    splat_u32,
    sqrt,
    to_f32,
    to_i32,
    upper_half,
)
from renderer.kernels.lanes.memory import (
    append_row,
    gather_columns,
    gather_row,
    load_one,
    load_row,
    scatter_row,
    store_columns,
    store_one,
    store_row,
    store_where,
)

FLOATS = (np.float32, np.float64)
INTEGERS = (np.int32, np.uint32, np.int64, np.uint64)
NAN, INF = float("nan"), float("inf")


def numbers(dtype, seed):
    """Random numbers and every awkward one next to every other, in two shuffled orders."""
    rng = np.random.default_rng(seed)
    if np.issubdtype(dtype, np.floating):
        info = np.finfo(dtype)
        awkward = [0, -0.0, 1, -1, NAN, INF, -INF, info.max, -info.max, info.tiny]
        awkward += [info.smallest_subnormal, 1 + info.eps, -info.eps, 0.5, 2.5, -2.5]
        plain = rng.standard_normal(240) * 10.0 ** rng.integers(-6, 6, 240)
    else:
        info = np.iinfo(dtype)
        awkward = [0, 1, 2, 7, 31, info.max, info.max - 1, info.max // 2, info.min]
        awkward += [info.min + 1, 5, 1 << 30, 3, 1 << 16, 6, 9]
        plain = rng.integers(info.min, info.max, 240, dtype, endpoint=True)
    return rng.permutation(
        np.concatenate((np.array(awkward * 16, dtype), plain.astype(dtype)))
    )


def pair(dtype):
    return numbers(dtype, 1), numbers(dtype, 2)


def assert_same_bits(got, expected):
    """NaN equals NaN; 0.0 does not equal -0.0."""
    expected = np.asarray(expected)
    assert got.dtype == expected.dtype
    np.testing.assert_array_equal(got, expected)
    if np.issubdtype(got.dtype, np.floating):
        number = ~np.isnan(expected)
        np.testing.assert_array_equal(np.signbit(got)[number], np.signbit(expected)[number])


# ------------------------------------------------------------------------------ operators


@entry_kernel
def float_operators(x, y, s):
    added = x - s
    added += y
    taken = x + s
    taken -= y
    multiplied = x - y
    multiplied *= x
    divided = x + y
    divided /= y
    scaled = x + y
    scaled *= s
    scaled += 0.1
    scaled -= s
    scaled /= 3
    return (
        *(x + y, x - y, x * y, x / y, -x),
        *(s + x, x + s, s - x, x - s, s * x, x * s, s / x, x / s),
        *(1 + x, x - 0.1, 0.1 * x, x / 3, True + x),  # literals do not widen
        *(added, taken, multiplied, divided, scaled),
        x * y + s,  # two roundings: no fused multiply-add
    )


@entry_kernel
def integer_operators(x, y, s, last_bit):
    n = y & last_bit  # how far to shift
    added = x - s
    added += y
    taken = x + s
    taken -= y
    multiplied = x - y
    multiplied *= x
    anded = x + y
    anded &= y
    ored = x + y
    ored |= y
    xored = x + y
    xored ^= y
    left = x + y
    left <<= n
    right = x + y
    right >>= n
    return (
        *(x + y, x - y, x * y, -x, ~x, x & y, x | y, x ^ y, x << n, x >> n),
        *(s + x, x + s, s - x, x - s, s * x, x * s, x << s, x >> s, s << n, s >> n),
        *(s & x, x & s, s | x, x | s, s ^ x, x ^ s, x + 1, 3 * x, x + True),
        *(added, taken, multiplied, anded, ored, xored, left, right),
    )


@entry_kernel
def comparisons(x, y, s):
    both = x < y
    both &= x > s
    either = x < y
    either |= x > s
    one = x < y
    one ^= x > s
    return (
        *(x < y, x <= y, x > y, x >= y, x == y, x != y),
        *(x < s, x <= s, x > s, x >= s, x == s, x != s),
        *(s < x, s <= x, s > x, s >= x, s == x, s != x),
        *((x < y) & (x > s), (x < y) | (x > s), (x < y) ^ (x > s), ~(x < y)),
        *(both, either, one),
    )


@entry_kernel
def run_floats(a, b, s, out):
    for i in range(0, a.size, 64 // a.itemsize):
        row = 0
        for result in float_operators(load_row(a, 0, i), load_row(b, 0, i), s):
            store_row(out, row, i, result)
            row += 1


@entry_kernel
def run_integers(a, b, s, last_bit, out):
    for i in range(0, a.size, 64 // a.itemsize):
        row = 0
        x = load_row(a, 0, i)
        for result in integer_operators(x, load_row(b, 0, i), s, last_bit):
            store_row(out, row, i, result)
            row += 1


@entry_kernel
def run_comparisons(a, b, s, out):
    width = 64 // a.itemsize
    for i in range(0, a.size, width):
        row = 0
        for result in comparisons(load_row(a, 0, i), load_row(b, 0, i), s):
            bits = mask_bits(result)
            for k in range(width):
                out[row, i + k] = (bits >> k) & 1
            row += 1


@pytest.mark.parametrize("dtype", FLOATS)
def test_float_operators(dtype):
    a, b = pair(dtype)
    with np.errstate(all="ignore"):
        expected = np.stack(float_operators.py_func(a, b, 0.7))
    got = np.empty_like(expected)
    run_floats(a, b, 0.7, got)
    assert_same_bits(got, expected)


@pytest.mark.parametrize("dtype", INTEGERS)
def test_integer_operators_wrap_around_and_shift(dtype):
    a, b = pair(dtype)
    last_bit = np.iinfo(dtype).bits - 1
    expected = np.stack(integer_operators.py_func(a, b, 7, last_bit))
    got = np.empty_like(expected)
    run_integers(a, b, 7, last_bit, got)
    assert_same_bits(got, expected)


@pytest.mark.parametrize("dtype", FLOATS + INTEGERS)
def test_comparisons_and_mask_operators(dtype):
    """Among the floats are NaNs: every comparison with one is false, only != is true."""
    a, b = pair(dtype)
    expected = np.stack(comparisons.py_func(a, b, dtype(1)))
    got = np.empty_like(expected)
    run_comparisons(a, b, dtype(1), got)
    assert_same_bits(got, expected)


# ------------------------------------------------------------------------------ functions


@entry_kernel
def run_float_functions(a, b, s, out):
    for i in range(0, a.size, 64 // a.itemsize):
        x = load_row(a, 0, i)
        y = load_row(b, 0, i)
        store_row(out, 0, i, sqrt(x))
        store_row(out, 1, i, fabs(x))
        store_row(out, 2, i, floor(x))
        store_row(out, 3, i, select((x < y) ^ (x > 0.0), x, y))
        store_row(out, 4, i, select(x < y, s, x))
        store_row(out, 5, i, select(x < y, x, 0.1))
    for i in range(a.size):
        out[6, i] = sqrt(a[i])
        out[7, i] = fabs(a[i])
        out[8, i] = floor(a[i])
        out[9, i] = select(a[i] < b[i], a[i], b[i])


@pytest.mark.parametrize("dtype", FLOATS)
def test_float_functions_of_lanes_and_scalars(dtype):
    a, b = pair(dtype)
    got = np.empty((10, a.size), dtype)
    run_float_functions(a, b, 0.7, got)
    with np.errstate(invalid="ignore"):
        unary = [np.sqrt(a), np.abs(a), np.floor(a)]
    chosen = np.where((a < b) ^ (a > 0), a, b)
    with_scalars = [np.where(a < b, dtype(0.7), a), np.where(a < b, a, dtype(0.1))]
    expected = [*unary, chosen, *with_scalars, *unary, np.where(a < b, a, b)]
    assert_same_bits(got, np.stack(expected))


@entry_kernel
def run_extrema(a, b, out):
    for i in range(0, a.size, 64 // a.itemsize):
        x = load_row(a, 0, i)
        y = load_row(b, 0, i)
        store_row(out, 0, i, minimum(x, y))
        store_row(out, 1, i, maximum(x, y))
        store_row(out, 2, i, minimum(1, x))
        store_row(out, 3, i, maximum(x, 1))


@pytest.mark.parametrize("dtype", FLOATS + INTEGERS)
def test_minimum_and_maximum_return_the_second_where_one_is_nan(dtype):
    a, b = pair(dtype)
    got = np.empty((4, a.size), dtype)
    run_extrema(a, b, got)
    one = dtype(1)
    expected = [np.where(a < b, a, b), np.where(a > b, a, b)]
    expected += [np.where(one < a, one, a), np.where(a > one, a, one)]
    assert_same_bits(got, np.stack(expected))


@entry_kernel
def run_conversions(f, i, u, to_int, to_float, bits_f, bits_i, bits_u):
    for k in range(0, f.size, 16):
        x, whole, natural = load_row(f, 0, k), load_row(i, 0, k), load_row(u, 0, k)
        store_row(to_int, 0, k, to_i32(x))
        store_row(to_float, 0, k, to_f32(whole))
        store_row(to_float, 1, k, to_f32(natural))
        store_row(bits_f, 0, k, as_f32(whole))
        store_row(bits_f, 1, k, as_f32(natural))
        store_row(bits_i, 0, k, as_i32(x))
        store_row(bits_i, 1, k, as_i32(natural))
        store_row(bits_u, 0, k, as_u32(x))
        store_row(bits_u, 1, k, as_u32(whole))
        store_row(bits_u, 2, k, bit_reverse(natural))


@entry_kernel
def run_signs_and_halves(a, b, signed, turned):
    for k in range(0, a.size, 32):
        x, y = load_row(a, 0, k), load_row(a, 0, k + 16)
        store_row(signed, 0, k, negate_by_sign(x, load_row(b, 0, k)))
        store_row(signed, 0, k + 16, negate_by_sign(y, load_row(b, 0, k + 16)))
        both = bit_reverse(joined(as_u32(x), as_u32(y)))
        store_row(turned, 0, k, upper_half(both))
        store_row(turned, 0, k + 16, lower_half(both))
    signed[a.size] = negate_by_sign(a[0], b[0])


def test_signs_and_joined_lanes():
    """The sign is a bit: that of -0 and of NaN counts, and no other bit changes."""
    a, b = (numbers(np.float32, seed)[:64] for seed in (5, 6))
    a[:4], b[:4] = (0.0, -0.0, 1.5, NAN), (-0.0, -1.0, -0.0, -1.0)
    signed, turned = np.empty(65, np.float32), np.empty(64, np.uint32)
    run_signs_and_halves(a, b, signed, turned)
    high = np.uint32(1 << 31)
    expected = a.view(np.uint32) ^ (b.view(np.uint32) & high)
    np.testing.assert_array_equal(signed[:64].view(np.uint32), expected)
    assert signed[64].view(np.uint32) == expected[0]
    swapped = a.view(np.uint32).reshape(2, 2, 16)[:, ::-1].ravel()
    backwards = [int(f"{word:032b}"[::-1], 2) for word in swapped]
    np.testing.assert_array_equal(turned, np.array(backwards, np.uint32))


def test_conversions():
    """Rounding toward zero saturates; NumPy's own cast of such numbers is undefined."""
    f, i, u = numbers(np.float32, 3), numbers(np.int32, 3), numbers(np.uint32, 3)
    f[:8] = 2**31, -(2**31), 2**31 - 128, 3e9, -3e9, 2.9, -2.9, NAN
    n = f.size
    to_int, to_float = np.empty(n, np.int32), np.empty((2, n), np.float32)
    bits_f, bits_i = np.empty((2, n), np.float32), np.empty((2, n), np.int32)
    bits_u = np.empty((3, n), np.uint32)
    run_conversions(f, i, u, to_int, to_float, bits_f, bits_i, bits_u)

    saturated = np.clip(np.nan_to_num(f.astype(np.float64)), -(2**31), 2**31 - 1)
    assert_same_bits(to_int, saturated.astype(np.int32))
    assert_same_bits(to_float, np.stack((i, u)).astype(np.float32, casting="unsafe"))
    np.testing.assert_array_equal(bits_f.view(np.uint32), [i.view(np.uint32), u])
    np.testing.assert_array_equal(bits_i, [f.view(np.int32), u.view(np.int32)])
    reverse = [int(f"{k:032b}"[::-1], 2) for k in u]
    np.testing.assert_array_equal(bits_u, [f.view(np.uint32), i.view(np.uint32), reverse])


@entry_kernel
def run_splats(number, flag, f, i, u, bits):
    store_row(f, 0, 0, splat_f32(number))
    store_row(i, 0, 0, splat_i32(number))
    store_row(u, 0, 0, splat_u32(number))
    store_row(i, 1, 0, lane_index())
    bits[0] = mask_bits(splat_mask(flag))
    bits[1] = mask_bits(splat_mask(not flag))
    bits[2] = mask_bits(select(splat_mask(flag), lane_index() < 3, lane_index() > 12))
    for k in range(16):
        i[2, k] = lane(lane_index() * 2, k)
    for count in range(-3, 20):
        bits[6 + count] = mask_bits(first_lanes(count))
    bits[26] = mask_bits(first_lanes(1 << 40))


def test_splats_and_masks():
    f, u = np.empty((1, 16), np.float32), np.empty((1, 16), np.uint32)
    i, bits = np.empty((3, 16), np.int32), np.empty(27, np.int64)
    run_splats(7, True, f, i, u, bits)
    assert (f == 7).all() and (i[0] == 7).all() and (u == 7).all()
    np.testing.assert_array_equal(i[1:], [np.arange(16), np.arange(16) * 2])
    assert bits[:3].tolist() == [0xFFFF, 0, 0b111]
    lanes = [min(max(count, 0), 16) for count in (*range(-3, 20), 1 << 40)]
    assert bits[3:].tolist() == [(1 << k) - 1 for k in lanes]


@entry_kernel
def run_bits(words, out):
    for k in range(words.size):
        out[0, k] = popcount(words[k])
        out[1, k] = lowest_bit(words[k])


def test_popcount_and_lowest_bit():
    words = np.array([0, 1, 2, 12, 0xFFFF, 1 << 62, -(2**63), -1], np.int64)
    out = np.empty((2, words.size), np.int64)
    run_bits(words, out)
    assert out[0].tolist() == [0, 1, 1, 2, 16, 1, 1, 64]
    assert out[1].tolist() == [64, 0, 1, 2, 0, 62, 63, 0]


@entry_kernel
def run_reductions(a, out):
    for i in range(0, a.size, 16):
        out[0, i // 16] = largest(load_row(a, 0, i))
        out[1, i // 16] = smallest(load_row(a, 0, i))


@pytest.mark.parametrize("dtype", [np.float32, np.int32])
def test_reductions(dtype):
    a = numbers(dtype, 4)
    a = a[~np.isnan(a)]
    a = a[: a.size // 16 * 16]
    got = np.empty((2, a.size // 16), dtype)
    run_reductions(a, got)
    rows = a.reshape(-1, 16)
    assert dtype == np.int32 or np.isinf(rows).any()
    np.testing.assert_array_equal(got, [rows.max(1), rows.min(1)])


# --------------------------------------------------------------------------------- memory


@entry_kernel
def run_every_mask(table, row, lanes, indices, gathered, appended):
    """Row m of the results: lanes whose bit is set in m."""
    width = lanes.size
    index = load_row(lanes, 0, 0)
    for m in range(1 << width):
        mask = ((m >> index) & 1) != 0
        x = gather_row(table, row, load_row(indices, m, 0), mask)
        store_row(gathered, m, 0, x)
        append_row(appended, m, 1, x, mask)


@pytest.mark.parametrize(
    ("dtype", "whole"),
    [
        (np.float32, np.int32),
        (np.int32, np.uint32),
        (np.uint32, np.int32),
        (np.float64, np.int64),
        (np.int64, np.uint64),
        (np.uint64, np.int64),
    ],
)
@pytest.mark.parametrize("row", [0, 2])
def test_gather_and_append_under_every_mask(dtype, whole, row):
    """Lanes outside the mask point far outside the table: reading them would crash."""
    width = 64 // np.dtype(dtype).itemsize
    rng = np.random.default_rng(row)
    table = rng.integers(1, 100, (3, 500)).astype(dtype)
    lanes = np.arange(width, dtype=whole)
    masks = (np.arange(1 << width)[:, None] >> np.arange(width)) & 1 == 1
    inside = rng.integers(0, 500, masks.shape)
    indices = np.where(masks, inside, 1 << 30).astype(whole)
    gathered = np.empty(masks.shape, dtype)
    appended = np.zeros((len(masks), width + 2), dtype)
    run_every_mask(table, row, lanes, indices, gathered, appended)

    values = np.where(masks, table[row][inside], 0)
    np.testing.assert_array_equal(gathered, values)
    front = np.arange(width) < masks.sum(1)[:, None]
    assert (appended[:, 0] == 0).all() and (appended[:, -1] == 0).all()
    np.testing.assert_array_equal(appended[:, 1:-1][front], values[masks])


@entry_kernel
def scatter_under(bits, table, row, indices, x):
    scatter_row(table, row, load_row(indices, 0, 0), load_row(x, 0, 0), mask_of(bits))


@pytest.mark.parametrize("dtype", [np.float32, np.int32])
def test_scatter_under_masks_made_of_bits(dtype):
    """Lanes outside the mask point far outside the table: writing them would crash."""
    rng = np.random.default_rng(5)
    x = rng.integers(1, 100, 16).astype(dtype)
    for bits in (0, 1, 0x8000, 0xFFFF, 0x12345, *rng.integers(0, 1 << 16, 20)):
        mask = (int(bits) >> np.arange(16)) & 1 == 1
        place = rng.permutation(500)[:16]
        indices = np.where(mask, place, 1 << 30).astype(np.int32)
        table, expected = np.zeros((2, 3, 500), dtype)
        expected[1, place[mask]] = x[mask]
        scatter_under(np.int64(bits), table, 1, indices, x)
        np.testing.assert_array_equal(table, expected)


@entry_kernel
def run_store_where(x, before, stored):
    """Row m of the result: lanes of x whose bit is set in m."""
    for m in range(1 << 16):
        store_row(stored, m, 0, load_row(before, 0, 0))
        store_where(stored, m, 0, load_row(x, 0, 0), mask_of(m))


def test_store_under_every_mask():
    x, before = np.arange(16, dtype=np.float32), np.full(16, -1.0, np.float32)
    stored = np.empty((1 << 16, 16), np.float32)
    run_store_where(x, before, stored)
    masks = (np.arange(1 << 16)[:, None] >> np.arange(16)) & 1 == 1
    np.testing.assert_array_equal(stored, np.where(masks, x, before))


@entry_kernel
def run_columns(bits, table, row, indices, x, out):
    """Gather from, and write to, a table that lies in memory column by column."""
    index, mask = load_row(indices, 0, 0), mask_of(bits)
    for k in range(4):
        store_row(out, k, 0, gather_columns(table, row, index, mask)[k])
    store_row(out, 4, 0, gather_row(table, row, index, mask))
    scatter_row(table, row + 1, index, load_row(x, 0, 0), mask)
    store_columns(
        table,
        row,
        30,
        load_row(x, 0, 0),
        load_row(x, 0, 0) + 1,
        load_row(x, 0, 0) + 2,
        load_row(x, 0, 0) + 3,
    )
    store_one(table, 0, 29, load_one(table, row, 45))


@pytest.mark.parametrize("dtype", [np.float32, np.int32])
@pytest.mark.parametrize(("rows", "row"), [(4, 0), (9, 0), (9, 5)])
def test_columns_under_masks(dtype, rows, row):
    """Lanes outside the mask point far outside the table: they take column 0, or 0."""
    rng = np.random.default_rng(6)
    x = rng.integers(1, 100, 16).astype(dtype)
    for bits in (0, 1, 0x8000, 0xFFFF, *rng.integers(0, 1 << 16, 20)):
        mask = (int(bits) >> np.arange(16)) & 1 == 1
        place = rng.permutation(29)[:16]
        indices = np.where(mask, place, 1 << 24).astype(np.int32)
        table = np.asfortranarray(rng.integers(1, 100, (rows, 50)).astype(dtype))
        expected, out = table.copy(), np.empty((5, 16), dtype)
        run_columns(np.int64(bits), table, row, indices, x, out)

        there = np.where(mask, place, 0)
        np.testing.assert_array_equal(out[:4], expected[row : row + 4, there])
        np.testing.assert_array_equal(out[4], np.where(mask, expected[row, place], 0))
        expected[row + 1, place[mask]] = x[mask]
        expected[row : row + 4, 30:46] = [x + k for k in range(4)]
        expected[0, 29] = x[15]
        np.testing.assert_array_equal(table, expected)


@entry_kernel
def gather_from_rows(table, indices, out):
    everything = splat_mask(True)
    store_row(out, 0, 0, gather_columns(table, 0, load_row(indices, 0, 0), everything)[0])


def test_columns_are_not_gathered_from_rows():
    table, indices = np.zeros((4, 20), np.float32), np.zeros(16, np.int32)
    with pytest.raises(TypingError, match="no columns that lie in memory one by one"):
        gather_from_rows(table, indices, np.zeros((1, 16), np.float32))


@entry_kernel
def copy_rows(a, b, i):
    store_row(b, 1, i, load_row(a, 2, i))
    store_row(b, 0, 0, load_row(a[1], 0, 1))


def test_loads_and_stores_need_no_alignment():
    a = np.arange(3 * 40, dtype=np.float32).reshape(3, 40)
    b = np.zeros((2, 40), np.float32)
    copy_rows(a, b, 13)
    expected = np.zeros_like(b)
    expected[1, 13:29] = a[2, 13:29]
    expected[0, :16] = a[1, 1:17]
    np.testing.assert_array_equal(b, expected)


# --------------------------------------------------------------------- what must not be


@entry_kernel
def mix_precisions(f, d, i, u):
    return lane(load_row(f, 0, 0) + load_row(d, 0, 0), 0)


@entry_kernel
def mix_signs(f, d, i, u):
    return lane(load_row(i, 0, 0) + load_row(u, 0, 0), 0)


@entry_kernel
def drop_a_fraction(f, d, i, u):
    return lane(load_row(i, 0, 0) * 0.5, 0)


@entry_kernel
def divide_integers(f, d, i, u):
    return lane(load_row(i, 0, 0) / load_row(i, 0, 0), 0)


@entry_kernel
def root_of_integers(f, d, i, u):
    return lane(sqrt(load_row(i, 0, 0)), 0)


@entry_kernel
def mask_of_another_width(f, d, i, u):
    return lane(select(load_row(d, 0, 0) < 0, load_row(f, 0, 0), 0), 0)


@entry_kernel
def gather_with_another_width(f, d, i, u):
    x = load_row(f, 0, 0)
    return lane(gather_row(d, 0, load_row(i, 0, 0), x < 0), 0)


@entry_kernel
def store_another_type(f, d, i, u):
    store_row(i, 0, 0, load_row(f, 0, 0))


@entry_kernel
def index_by_a_float(f, d, i, u):
    return lane(gather_row(f, 0, load_row(f, 0, 0), load_row(f, 0, 0) < 0), 0)


@pytest.mark.parametrize(
    "wrong",
    [
        mix_precisions,
        mix_signs,
        drop_a_fraction,
        divide_integers,
        root_of_integers,
        mask_of_another_width,
        gather_with_another_width,
        store_another_type,
        index_by_a_float,
    ],
    ids=lambda wrong: wrong.__name__,
)
def test_a_silent_conversion_does_not_compile(wrong):
    arrays = [
        np.zeros(16, dtype) for dtype in (np.float32, np.float64, np.int32, np.uint32)
    ]
    with pytest.raises(TypingError):
        wrong(*arrays)


@pytest.mark.parametrize(
    "array",
    [
        np.zeros(64, np.uint8),
        np.zeros((2, 2, 16), np.float32),
        np.zeros(64, np.float32)[::2],
    ],
    ids=["bytes", "three dimensions", "strided"],
)
def test_arrays_that_lanes_cannot_live_in(array):
    with pytest.raises(TypingError):
        run_reductions(array, np.zeros((2, 4), array.dtype))


def test_a_read_only_array_is_not_written():
    target = np.zeros((2, 40), np.float32)
    target.flags.writeable = False
    with pytest.raises(TypingError):
        copy_rows(np.zeros((3, 40), np.float32), target, 0)


# ---------------------------------------------------------------------------------- cache
