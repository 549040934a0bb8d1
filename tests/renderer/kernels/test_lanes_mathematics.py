"""`lanes.mathematics.mathematics` against NumPy in float64, in units in the last place."""

from __future__ import annotations

import zlib

import numpy as np
from scipy import special

from renderer.kernels.jit import entry_kernel
from renderer.kernels.lanes.mathematics import (
    arccos,
    arctan2,
    erf,
    erfinv,
    exp,
    log,
    power,
    sincos,
)
from renderer.kernels.lanes.memory import load_row, store_row

NAN, INF = np.nan, np.inf


@entry_kernel
def evaluate(a, b, out):
    for i in range(0, a.size, 16):
        x = load_row(a, 0, i)
        sine, cosine = sincos(x)
        store_row(out, 0, i, sine)
        store_row(out, 1, i, cosine)
        store_row(out, 2, i, arctan2(x, load_row(b, 0, i)))
        store_row(out, 3, i, arccos(x))


def rows_of(kernel, rows, a, b):
    a = np.asarray(a, np.float32)
    b = a if b is None else np.asarray(b, np.float32)
    padded = np.zeros((2, a.size + -a.size % 16), np.float32)
    padded[:, : a.size] = a, b
    out = np.empty((rows, padded.shape[1]), np.float32)
    kernel(padded[0], padded[1], out)
    return out[:, : a.size]


def results(a, b=None):
    """Rows sin a, cos a, atan2(a, b), acos a."""
    return rows_of(evaluate, 4, a, b)


def ulps(got, true):
    """Errors in units of the spacing of float32 at the true values."""
    spacing = np.spacing(np.abs(true).astype(np.float32)).astype(np.float64)
    return np.max(np.abs(got.astype(np.float64) - true) / spacing)


def around(values, steps):
    """The float32 nearest to each value and its `steps` neighbours to either side."""
    bits = np.asarray(values, np.float32).view(np.int32)
    return (bits[:, None] + np.arange(-steps, steps + 1, dtype=np.int32)).view(np.float32)


def test_sincos_within_1_6_ulp_over_two_turns():
    """Also next to every zero, where the reduction of the angle has to keep its digits."""
    random = np.random.default_rng(0).uniform(-2 * np.pi, 2 * np.pi, 1 << 18)
    zeros = np.arange(1, 5) * np.pi / 2
    x = np.concatenate((random, around(np.concatenate((zeros, -zeros)), 2000).ravel()))
    x = x.astype(np.float32)
    sine, cosine, _, _ = results(x)
    assert ulps(sine, np.sin(x.astype(np.float64))) < 1.6
    assert ulps(cosine, np.cos(x.astype(np.float64))) < 1.6


def test_sincos_keeps_1e_7_over_a_thousand_turns():
    x = np.random.default_rng(1).uniform(-8000, 8000, 1 << 16).astype(np.float32)
    sine, cosine, _, _ = results(x)
    np.testing.assert_allclose(sine, np.sin(x.astype(np.float64)), rtol=0, atol=1e-7)
    np.testing.assert_allclose(cosine, np.cos(x.astype(np.float64)), rtol=0, atol=1e-7)


def test_sine_is_odd_and_cosine_even_to_the_bit():
    x = np.random.default_rng(2).uniform(0, 20, 4096).astype(np.float32)
    x[0] = 0.0
    plus, minus = results(x), results(-x)
    np.testing.assert_array_equal(minus[0].view(np.uint32), (-plus[0]).view(np.uint32))
    np.testing.assert_array_equal(minus[1].view(np.uint32), plus[1].view(np.uint32))


def test_arctan2_within_2_3_ulp():
    rng = np.random.default_rng(3)
    near = rng.uniform(-1, 1, (2, 1 << 18))
    far = rng.standard_normal((2, 1 << 16)) * 10.0 ** rng.uniform(-15, 15, (2, 1 << 16))
    y, x = np.concatenate((near, far), axis=1).astype(np.float32)
    assert ulps(results(y, x)[2], np.arctan2(y.astype(np.float64), x)) < 2.3


def test_arctan2_of_axes_signed_zeros_and_infinities():
    """The table of C's atan2, which NumPy follows; (0, 0) has an angle, too."""
    awkward = np.array([0.0, -0.0, 1, -1, 1e-38, -1e-38, 3e38, -3e38, INF, -INF])
    y, x = (v.ravel().astype(np.float32) for v in np.meshgrid(awkward, awkward))
    got = results(y, x)[2]
    true = np.arctan2(y.astype(np.float64), x)
    np.testing.assert_allclose(got, true, rtol=2e-7, atol=1e-45)
    np.testing.assert_array_equal(np.signbit(got), np.signbit(true))


def test_arctan2_passes_nan_on():
    assert np.isnan(
        results([NAN, NAN, NAN, 0, 1, INF], [0, 1, NAN, NAN, NAN, NAN])[2]
    ).all()


def test_arccos_within_1_2_ulp_up_to_both_ends():
    x = np.random.default_rng(4).uniform(-1, 1, 1 << 18)
    below_one = 1 - np.arange(4096) * 2.0**-24
    x = np.concatenate((x, below_one, -below_one)).astype(np.float32)
    assert ulps(results(x)[3], np.arccos(x.astype(np.float64))) < 1.2


def test_arccos_clamps_and_passes_nan_on():
    """A cosine that rounding took just above 1 belongs to the angle 0."""
    got = results([1.0000001, 2, INF, -1.0000001, -2, -INF, NAN])[3]
    pi = np.float32(np.pi)
    np.testing.assert_array_equal(got, np.array([0, 0, 0, pi, pi, pi, NAN], np.float32))


def test_the_bits_are_the_same_on_every_machine():
    """The checksum is the same with SSE2, AVX2 and AVX-512; so must an image be.

    A fused multiply-add, an approximate division or a call of the C library would show.
    """
    x = np.arange(-(1 << 15), 1 << 15, dtype=np.int32).astype(np.float32)
    angles = results(x * np.float32(2.0**-12))[:2]
    others = results(x * np.float32(2.0**-15), x[::-1] * np.float32(2.0**-15))[2:]
    assert zlib.crc32(np.concatenate((angles, others)).astype("<f4").tobytes()) == 981548610


# ------------------------------------------------------------------------- exponentials

N = 1 << 17


@entry_kernel
def evaluate_exponentials(a, b, out):
    for i in range(0, a.size, 16):
        x = load_row(a, 0, i)
        store_row(out, 0, i, exp(x))
        store_row(out, 1, i, log(x))
        store_row(out, 2, i, power(x, load_row(b, 0, i)))
        store_row(out, 3, i, erf(x))
        store_row(out, 4, i, erfinv(x))


def exponentials(a, b=None):
    """Rows exp a, log a, a^b, erf a, erfinv a."""
    return rows_of(evaluate_exponentials, 5, a, b)


def uniform(low, high, seed):
    return np.random.default_rng(seed).uniform(low, high, N).astype(np.float32)


def test_exp_within_0_51_ulp():
    """0.76 where results have fewer digits, below 2^-126."""
    x = uniform(-87.3, 88.7, 0)
    assert ulps(exponentials(x)[0], np.exp(x.astype(float))) < 0.51
    x = uniform(-103, -87.3, 1)
    assert ulps(exponentials(x)[0], np.exp(x.astype(float))) < 0.76


def test_log_within_0_51_ulp():
    """Over all sizes, and next to 1, where it is small."""
    sizes = (2.0 ** uniform(-149, 128, 2).astype(float)).astype(np.float32)
    near = 1 + np.arange(-4096, 4096) * 2.0**-24
    x = np.concatenate((sizes, near)).astype(np.float32)
    assert ulps(exponentials(x)[1], np.log(x.astype(float))) < 0.51


def test_power_within_0_51_ulp():
    """Large exponents too, where a logarithm of float32 would lose seven bits."""
    x = (2.0 ** uniform(-60, 60, 3).astype(float)).astype(np.float32)
    y = (uniform(-125, 127, 4) / np.log2(x)).astype(np.float32)
    true = x.astype(float) ** y.astype(float)
    normal = (true > 1.2e-38) & (true < 3.4e38)
    assert normal.mean() > 0.99
    assert ulps(exponentials(x, y)[2][normal], true[normal]) < 0.51


def test_erf_within_0_7_ulp():
    tiny = 10.0 ** uniform(-37, 0, 5).astype(float)
    x = np.concatenate((uniform(-5, 5, 6), tiny)).astype(np.float32)
    assert ulps(exponentials(x)[3], special.erf(x.astype(float))) < 0.7


def test_erfinv_within_1_ulp():
    """Up to the last number below 1, whose erfinv is 3.8."""
    ends = 1 - np.arange(1, 1 << 14) * 2.0**-24
    tiny = 10.0 ** uniform(-37, -1e-6, 7).astype(float)
    x = np.concatenate((uniform(-1, 1, 8), ends, -ends, tiny)).astype(np.float32)
    x = x[np.abs(x) < 1]
    assert ulps(exponentials(x)[4], special.erfinv(x.astype(float))) < 1.0


def test_they_undo_one_another():
    x = uniform(-3, 3, 9)
    np.testing.assert_allclose(exponentials(exponentials(x)[0])[1], x, atol=3e-7)
    x = uniform(-0.99, 0.99, 10)
    np.testing.assert_allclose(exponentials(exponentials(x)[4])[3], x, atol=2e-7)


def test_the_ends_of_their_ranges():
    """As NumPy and SciPy have them, NaN and both zeros included."""
    x = np.array([0, -0.0, 1, -1, 2, -2, INF, -INF, NAN, 1e-45, 3e38], np.float32)
    with np.errstate(all="ignore"):
        wide = x.astype(float)
        true = [np.exp(x), np.log(wide), np.ones(11), special.erf(x), special.erfinv(wide)]
    for row, got in enumerate(exponentials(x, np.zeros(11))):
        np.testing.assert_allclose(got, true[row].astype(np.float32), rtol=2e-7)
    signs = np.signbit(exponentials([0.0, -0.0])[3:])
    np.testing.assert_array_equal(signs, [[False, True]] * 2)


def test_powers_of_the_ends():
    x = np.array([0, 0, 0, INF, 2, 2, 0.5, 1, 1, -1, NAN], np.float32)
    y = np.array([1, -1, INF, -1, INF, -INF, -INF, INF, NAN, 2, 0], np.float32)
    expected = [0, INF, 0, 0, INF, 0, INF, 1, 1, NAN, 1]
    np.testing.assert_array_equal(exponentials(x, y)[2], np.array(expected, np.float32))


def test_the_bits_of_exponentials_are_the_same_on_every_machine():
    """As above: no fused operation, no call of the C library."""
    x = np.arange(1, 1 << 15).astype(np.float32) * np.float32(2.0**-15)
    table = exponentials(x, x[::-1].copy() * 8)
    assert zlib.crc32(table.astype("<f4").tobytes()) == 3527172655
