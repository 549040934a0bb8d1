"""Pearson's chi-square test of samples against a stated density, and what it can find.

A sampler is right if the histogram of its samples is the one that its density promises.
Counts in a grid are compared with the integrals of the density over the cells. A test that
passes is worth what it would have found, so each one here says which deformation of the
density it finds with 99 % power at its false alarm rate: then the statistic follows the
noncentral chi-square distribution, with N sum (q - p)^2 / p as its noncentrality.

The tests of this file itself are in test_chi_square.py.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.optimize import brentq

Array = NDArray[np.float64]

FALSE_ALARM = 1e-5  # of one comparison; seeds are fixed, so that a pass stays a pass
POWER = 0.99
FEWEST = 5.0  # expected counts below are pooled: the distribution would not be chi-square
PRECISION = 1e-6  # of the integrals, in shares of the whole
_ORDERS = (4, 8, 16, 32, 64)


def sidak(false_alarm: float, tests: int) -> float:
    """Return the rate for each of many independent tests that gives them one in all."""
    return float(-np.expm1(np.log1p(-false_alarm) / tests))


# ----------------------------------------------------------------- what is expected


def cell_masses(density: Callable, edges_a: Array, edges_b: Array) -> Array:
    """Integrate a density over each cell of a grid, good to `PRECISION`.

    Gauss-Legendre in each cell, of twice the order until the cells stand still.

    Parameters
    ----------
    density : callable
        Takes two arrays (n,), returns (n,): density per unit of a and b.
    edges_a, edges_b : ndarray of shape (rows + 1,) and (columns + 1,)
        The density has to be smooth inside the cells.

    Returns
    -------
    ndarray of shape (rows, columns)

    Raises
    ------
    ValueError
        If 64 points along each axis of a cell do not suffice.
    """
    last = gauss_masses(density, edges_a, edges_b, _ORDERS[0])
    for order in _ORDERS[1:]:
        masses = gauss_masses(density, edges_a, edges_b, order)
        if np.abs(masses - last).sum() < PRECISION * np.abs(masses).sum():
            return masses
        last = masses
    raise ValueError("the density is not smooth inside the cells")


def gauss_masses(density: Callable, edges_a: Array, edges_b: Array, order: int) -> Array:
    """Integrate a density over each cell of a grid, with `order` points along each axis."""
    a, weight_a = _nodes(np.asarray(edges_a, float), order)
    b, weight_b = _nodes(np.asarray(edges_b, float), order)
    grid_a, grid_b = (x.ravel() for x in np.meshgrid(a, b, indexing="ij"))
    values = np.asarray(density(grid_a, grid_b), float).reshape(len(a), len(b))
    weighted = values * weight_a[:, None] * weight_b
    shape = (len(edges_a) - 1, order, len(edges_b) - 1, order)
    return weighted.reshape(shape).sum(axis=(1, 3))


def _nodes(edges: Array, order: int) -> tuple[Array, Array]:
    """Return the points of all cells in turn and their weights."""
    x, weight = np.polynomial.legendre.leggauss(order)
    half = np.diff(edges)[:, None] / 2
    return (edges[:-1, None] + half * (x + 1)).ravel(), (half * weight).ravel()


# ----------------------------------------------------------------------- the histogram


def histogram(a: Array, b: Array, edges_a: Array, edges_b: Array) -> NDArray[np.int64]:
    """Count samples in the cells of a grid; those outside (and NaN) are left out."""
    rows, row = _cells(a, edges_a)
    columns, column = _cells(b, edges_b)
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    number = row[inside] * columns + column[inside]
    return np.bincount(number, minlength=rows * columns).reshape(rows, columns)


def _cells(x: Array, edges: Array) -> tuple[int, NDArray[np.int64]]:
    """Return how many cells there are and that of each value; the last edge belongs."""
    count = len(edges) - 1
    cell = np.searchsorted(edges, x, side="right") - 1
    cell[x == edges[-1]] = count - 1
    return count, cell


# ---------------------------------------------------------------------------- the test


class Outcome(NamedTuple):
    """A chi-square test: its p-value, and what it would have found."""

    p_value: float
    statistic: float
    freedom: int
    samples: int
    noncentrality: float  # found with 99 % power
    masses: Array  # of the cells, before pooling; a last one for samples outside the grid
    pool: NDArray[np.int64]  # number of the pool of each cell
    shape: tuple[int, ...]
    impossible: int  # samples in cells that together expect less than 1e-6 of a sample

    def detectable(self, deformation: Array) -> float:
        """Return the e for which masses times (1 + e deformation) are found.

        The mean of the deformation is taken off first, as masses stay masses.
        """
        g = np.append(np.ravel(deformation), 0.0)
        g = g - np.average(g, weights=self.masses)
        mass = np.bincount(self.pool, self.masses)
        change = np.bincount(self.pool, self.masses * g)
        used = mass > 0
        spread = np.sum(change[used] ** 2 / mass[used])
        return float(np.sqrt(self.noncentrality / (self.samples * spread)))

    def tilt(self, axis: int) -> float:
        """Return the smallest tilt along an axis that is found.

        The density is x too high at one end, x too low at the other, linear in the share
        of the mass below.
        """
        other = tuple(k for k in range(len(self.shape)) if k != axis)
        marginal = self.masses[:-1].reshape(self.shape).sum(axis=other)
        below = np.cumsum(marginal) - marginal / 2
        slope = 2 * below / marginal.sum() - 1
        along = [1] * len(self.shape)
        along[axis] = -1
        return self.detectable(np.broadcast_to(slope.reshape(along), self.shape))

    def excess(self) -> float:
        """Return the smallest relative excess of one cell of mean mass that is found."""
        mean = self.masses[:-1].sum() / np.count_nonzero(self.masses[:-1])
        return float(np.sqrt(self.noncentrality / self.samples / mean * (1 - mean)))


@cache
def noncentrality_found(freedom: int, false_alarm: float, power: float = POWER) -> float:
    """Return the noncentrality that a test finds with a given power."""
    limit = stats.chi2.isf(false_alarm, freedom)

    def lacking(noncentrality: float) -> float:
        return float(stats.ncx2.sf(limit, freedom, noncentrality)) - power

    return float(brentq(lacking, 1e-3, 10 * limit + 1000))


def binomial_p_value(count: Any, samples: int, probability: float) -> Any:
    """Return the two-sided p-value of counts: twice the smaller tail, at most 1."""
    law = stats.binom(samples, probability)
    count = np.asarray(count)
    return np.minimum(2 * np.minimum(law.cdf(count), law.sf(count - 1)), 1)


def binomial_found(
    probability: float, samples: int, false_alarm: float = FALSE_ALARM
) -> float:
    """Return by how much a probability may be too large or small until it is found.

    By `binomial_p_value`, with 99 % power; the larger of both sides.
    """
    law = stats.binom(samples, probability)
    low, high = law.ppf(false_alarm / 2), law.isf(false_alarm / 2)

    def lacking(shift: float) -> float:
        p = min(max(probability + shift, 0.0), 1.0)
        beyond = stats.binom.sf(high, samples, p) if shift > 0 else 0.0
        below = stats.binom.cdf(low - 1, samples, p) if shift < 0 else 0.0
        return float(beyond + below) - POWER

    ends = [end for end in (-probability, 1 - probability) if lacking(end) > 0]
    return max(abs(float(brentq(lacking, 0.0, end))) for end in ends)


def chi_square(
    counts: NDArray[np.int64],
    masses: Array,
    samples: int,
    false_alarm: float = FALSE_ALARM,
) -> Outcome:
    """Compare counts with the masses of the cells (arrays of the same shape).

    Whatever of `samples` is in no cell falls in a last one, whose mass is what `masses`
    lack of 1.
    """
    counts, cells = np.asarray(counts), np.asarray(masses, float)
    shares = np.append(cells.ravel(), max(1.0 - cells.sum(), 0.0))
    seen = np.append(counts.ravel(), samples - counts.sum()).astype(float)
    pool = _pools(shares * samples)
    expected, found = np.bincount(pool, shares * samples), np.bincount(pool, seen)
    statistic = np.sum((found - expected) ** 2 / expected)
    freedom = len(expected) - 1
    return Outcome(
        float(stats.chi2.sf(statistic, freedom)),
        float(statistic),
        freedom,
        samples,
        noncentrality_found(freedom, false_alarm),
        shares,
        pool,
        cells.shape,
        int(seen[_empty(shares * samples)].sum()),
    )


def _empty(expected: Array) -> NDArray[np.bool_]:
    order = np.argsort(expected, kind="stable")
    empty = np.zeros(len(expected), bool)
    empty[order] = np.cumsum(expected[order]) < 1e-6
    return empty


def _pools(expected: Array) -> NDArray[np.int64]:
    """Number the cells such that cells of small counts share a number.

    From the smallest upwards, cells join until `FEWEST` are reached.
    """
    order = np.argsort(expected, kind="stable")
    pool = np.empty(len(expected), np.int64)
    number, total = 0, 0.0
    for k, cell in enumerate(order):
        if total >= FEWEST:
            number, total = number + 1, 0.0
        rest = expected[order[k:]].sum() if expected[cell] < FEWEST else np.inf
        if total == 0.0 and number > 0 and rest < FEWEST:
            number -= 1  # too little is left for a pool of its own
        pool[cell] = number
        total += expected[cell]
    return pool


def assert_follows(
    counts: NDArray[np.int64],
    masses: Array,
    samples: int,
    *,
    finds: float,
    mass: float = 1.0,
    within: float = 1e-5,
    stray: int = 0,
    tests: int = 1,
) -> Outcome:
    """Assert that samples follow the masses of the cells, and that the test is sharp.

    Parameters
    ----------
    counts, masses : ndarray of the same shape
        Samples in the cells of a grid, and integrals of the stated density over them.
    samples : int
        Drawn in all.
    finds : float
        A tilt of the density so large, along any axis of the grid, has to be found with a
        power of 99 %; less is an error of the test.
    mass : float
        The integral of the density over the grid; what lacks of 1 are samples outside it.
    within : float
        How near the integral has to be.
    stray : int
        Samples that rounding may put where the density is zero.
    tests : int
        How many comparisons share the false alarm rate of 1e-5 (Sidak's correction).
    """
    false_alarm = sidak(FALSE_ALARM, tests)
    total = np.sum(masses)
    assert abs(total - mass) < within, f"the density integrates to {total}"
    outcome = chi_square(counts, masses * (mass / total), samples, false_alarm)
    assert outcome.impossible <= stray, f"{outcome.impossible} where the density is zero"
    tilts = [outcome.tilt(k) for k, n in enumerate(outcome.shape) if n > 1]
    assert max(tilts) < finds, f"finds no less than {max(tilts):.2%}"
    assert outcome.p_value > false_alarm, (
        f"p = {outcome.p_value:.1e}, chi-square {outcome.statistic:.1f} "
        f"with {outcome.freedom} degrees of freedom"
    )
    return outcome
