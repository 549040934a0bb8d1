"""Multiplication and addition in one step: rounded once or twice, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from numba.core.errors import TypingError

from renderer.kernels.jit import entry_kernel
from renderer.kernels.lanes.functions import joined, lower_half, splat_i32, upper_half
from renderer.kernels.lanes.mathematics import multiply_add
from renderer.kernels.lanes.memory import load_row, store_row


@entry_kernel
def run_multiply_add(a, b, c, s, out):
    """Lanes alone, with a scalar in each place, and eight lanes at a time."""
    for i in range(0, a.shape[1], 16):
        x, y, z = load_row(a, 0, i), load_row(b, 0, i), load_row(c, 0, i)
        store_row(out, 0, i, multiply_add(x, y, z))
        store_row(out, 1, i, multiply_add(s, y, z))
        store_row(out, 2, i, multiply_add(x, s, z))
        store_row(out, 3, i, multiply_add(x, y, s))
        low = multiply_add(lower_half(x), lower_half(y), -lower_half(z))
        high = multiply_add(upper_half(x), s, -upper_half(z))
        store_row(out, 4, i, joined(low, high))


@entry_kernel
def run_on_integers(a, out):
    x = load_row(a, 0, 0)
    store_row(out, 0, 0, multiply_add(x, splat_i32(2), x))


def test_it_is_rounded_once_or_twice() -> None:
    """Sums that cancel show which: both roundings are taken, anything between is not."""
    rng = np.random.default_rng(5)
    a, b = (rng.standard_normal((1, 4096)).astype(np.float32) for _ in range(2))
    c = (-(a * b)).astype(np.float32)
    c[0, ::2] = rng.standard_normal(2048)
    s = np.float32(1.1)
    out = np.empty((5, 4096), np.float32)
    run_multiply_add(a, b, c, s, out)
    upper = (np.arange(4096) & 8) != 0
    wanted = [(a, b, c), (s, b, c), (a, s, c), (a, b, s), (a, np.where(upper, s, b), -c)]
    for row, factors in zip(out, wanted, strict=True):
        x, y, z = (np.broadcast_to(f, (1, 4096))[0].astype(np.float32) for f in factors)
        once = (x.astype(np.float64) * y + z).astype(np.float32)
        twice = (x * y).astype(np.float32) + z
        assert ((row == once) | (row == twice)).all()
    # the processor does one or the other, always
    once = (a.astype(np.float64) * b + c).astype(np.float32)[0]
    twice = a[0] * b[0] + c[0]
    assert (once != twice).any()
    assert (out[0] == once).all() or (out[0] == twice).all()


def test_integers_are_refused() -> None:
    """They would be rounded."""
    a = np.zeros((1, 16), np.int32)
    with pytest.raises(TypingError, match="needs float32 lanes"):
        run_on_integers(a, a)
