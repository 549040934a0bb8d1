"""1 / a of a replay: Embree's guess from the processor and one Newton step."""

from __future__ import annotations

import numpy as np

from renderer.kernels.jit import entry_kernel
from renderer.replay.arithmetic import guess_instruction, reciprocal


@entry_kernel
def run_reciprocal(a, out):
    for i in range(a.size):
        out[i] = reciprocal(a[i])


def test_reciprocal_is_within_two_units_in_the_last_place():
    """Both signs, 36 decades. A guess without the Newton step is off by 2^-11 to 2^-14.

    Where the guess is the processor's, some last bits are not those of a division: that of
    SSE, which processors without AVX-512 use, leaves up to 1.92 units.
    """
    rng = np.random.default_rng(1)
    a = (rng.uniform(1, 2, 4096) * 2.0 ** rng.integers(-60, 61, 4096)).astype(np.float32)
    a[::2] *= -1
    found = np.empty_like(a)
    run_reciprocal(a, found)
    exact = 1.0 / a.astype(np.float64)
    units = np.spacing(np.abs(exact).astype(np.float32)).astype(np.float64)
    assert (np.abs(found - exact) <= 2.0 * units).all()
    assert (found != np.float32(1.0) / a).any() == bool(guess_instruction())
