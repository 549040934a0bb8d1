"""exp, log, power, erf and erfinv of lanes against float64, in units in the last place."""

from __future__ import annotations

import zlib

import numpy as np
from scipy import special
from test_lanes_mathematics import INF, NAN, ulps

from renderer.kernels.jit import entry_kernel
from renderer.kernels.lanes.mathematics import erf, erfinv, exp, log, power
from renderer.kernels.lanes.memory import load_row, store_row

N = 1 << 17


@entry_kernel
def evaluate(a, b, out):
    for i in range(0, a.size, 16):
        x = load_row(a, 0, i)
        store_row(out, 0, i, exp(x))
        store_row(out, 1, i, log(x))
        store_row(out, 2, i, power(x, load_row(b, 0, i)))
        store_row(out, 3, i, erf(x))
        store_row(out, 4, i, erfinv(x))


def results(a, b=None):
    """Rows exp a, log a, a^b, erf a, erfinv a."""
    a = np.asarray(a, np.float32)
    b = a if b is None else np.asarray(b, np.float32)
    padded = np.zeros((2, a.size + -a.size % 16), np.float32)
    padded[:, : a.size] = a, b
    out = np.empty((5, padded.shape[1]), np.float32)
    evaluate(padded[0], padded[1], out)
    return out[:, : a.size]


def uniform(low, high, seed):
    return np.random.default_rng(seed).uniform(low, high, N).astype(np.float32)


def test_exp_within_0_51_ulp():
    """0.76 where results have fewer digits, below 2^-126."""
    x = uniform(-87.3, 88.7, 0)
    assert ulps(results(x)[0], np.exp(x.astype(float))) < 0.51
    x = uniform(-103, -87.3, 1)
    assert ulps(results(x)[0], np.exp(x.astype(float))) < 0.76


def test_log_within_0_51_ulp():
    """Over all sizes, and next to 1, where it is small."""
    sizes = (2.0 ** uniform(-149, 128, 2).astype(float)).astype(np.float32)
    near = 1 + np.arange(-4096, 4096) * 2.0**-24
    x = np.concatenate((sizes, near)).astype(np.float32)
    assert ulps(results(x)[1], np.log(x.astype(float))) < 0.51


def test_power_within_0_51_ulp():
    """Large exponents too, where a logarithm of float32 would lose seven bits."""
    x = (2.0 ** uniform(-60, 60, 3).astype(float)).astype(np.float32)
    y = (uniform(-125, 127, 4) / np.log2(x)).astype(np.float32)
    true = x.astype(float) ** y.astype(float)
    normal = (true > 1.2e-38) & (true < 3.4e38)
    assert normal.mean() > 0.99
    assert ulps(results(x, y)[2][normal], true[normal]) < 0.51


def test_erf_within_0_7_ulp():
    tiny = 10.0 ** uniform(-37, 0, 5).astype(float)
    x = np.concatenate((uniform(-5, 5, 6), tiny)).astype(np.float32)
    assert ulps(results(x)[3], special.erf(x.astype(float))) < 0.7


def test_erfinv_within_1_ulp():
    """Up to the last number below 1, whose erfinv is 3.8."""
    ends = 1 - np.arange(1, 1 << 14) * 2.0**-24
    tiny = 10.0 ** uniform(-37, -1e-6, 7).astype(float)
    x = np.concatenate((uniform(-1, 1, 8), ends, -ends, tiny)).astype(np.float32)
    x = x[np.abs(x) < 1]
    assert ulps(results(x)[4], special.erfinv(x.astype(float))) < 1.0


def test_they_undo_one_another():
    x = uniform(-3, 3, 9)
    np.testing.assert_allclose(results(results(x)[0])[1], x, atol=3e-7)
    x = uniform(-0.99, 0.99, 10)
    np.testing.assert_allclose(results(results(x)[4])[3], x, atol=2e-7)


def test_the_ends_of_their_ranges():
    """As NumPy and SciPy have them, NaN and both zeros included."""
    x = np.array([0, -0.0, 1, -1, 2, -2, INF, -INF, NAN, 1e-45, 3e38], np.float32)
    with np.errstate(all="ignore"):
        wide = x.astype(float)
        true = [np.exp(x), np.log(wide), np.ones(11), special.erf(x), special.erfinv(wide)]
    for row, got in enumerate(results(x, np.zeros(11))):
        np.testing.assert_allclose(got, true[row].astype(np.float32), rtol=2e-7)
    signs = np.signbit(results([0.0, -0.0])[3:])
    np.testing.assert_array_equal(signs, [[False, True]] * 2)


def test_powers_of_the_ends():
    x = np.array([0, 0, 0, INF, 2, 2, 0.5, 1, 1, -1, NAN], np.float32)
    y = np.array([1, -1, INF, -1, INF, -INF, -INF, INF, NAN, 2, 0], np.float32)
    expected = [0, INF, 0, 0, INF, 0, INF, 1, 1, NAN, 1]
    np.testing.assert_array_equal(results(x, y)[2], np.array(expected, np.float32))


def test_the_bits_are_the_same_on_every_machine():
    """As in test_lanes_mathematics: no fused operation, no call of the C library."""
    x = np.arange(1, 1 << 15).astype(np.float32) * np.float32(2.0**-15)
    table = results(x, x[::-1].copy() * 8)
    assert zlib.crc32(table.astype("<f4").tobytes()) == 3527172655
