"""What the tests saw, as pictures and histograms for a page."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mitsuba_ref.statistics.hypothesis_tests.welch import welch
from mitsuba_ref.statistics.samples import ROUNDING, Floats

P_BINS = 20
Z_LIMIT = 5.0
Z_BINS = 50


def evidence(ours: Floats, theirs: Floats) -> dict[str, NDArray[np.float32]]:
    """Return arrays that show where and how two sets of pictures differ.

    Parameters
    ----------
    ours, theirs
        (K, H, W, C).

    Returns
    -------
    dict
        "p_map" (H, W, C), p-values of Welch's test; 1 where there is no noise and no
        difference. "z_map" (H, W, C), the same as signed standard deviations of a normal
        distribution, within +-40. "signed_error" (H, W, C), mean of ours less mean of
        theirs. "p_histogram" (20, 3) and "z_histogram" (50, 3): rows of lower end, upper
        end and number of noisy values; z beyond +-5 counts in the last bins.
    """
    result = welch(ours, theirs)
    # A p of 0 would be infinitely far out; 40 is past any number that a p can hold.
    z = np.sign(result.t) * -special.ndtri(np.maximum(result.p / 2.0, 1e-300))
    noisy = result.standard_error > ROUNDING * result.scale
    p_edges = np.linspace(0.0, 1.0, P_BINS + 1)
    z_edges = np.linspace(-Z_LIMIT, Z_LIMIT, Z_BINS + 1)
    arrays = {
        "p_map": result.p,
        "z_map": z,
        "signed_error": result.difference,
        "p_histogram": _histogram(result.p[noisy], p_edges),
        "z_histogram": _histogram(np.clip(z[noisy], -Z_LIMIT, Z_LIMIT), z_edges),
    }
    return {name: array.astype(np.float32) for name, array in arrays.items()}


def _histogram(values: Floats, edges: Floats) -> Floats:
    counts, _ = np.histogram(values, edges)
    return np.column_stack([edges[:-1], edges[1:], counts])
