"""Pictures whose noise and bias are known, for the tests of the tests."""

from __future__ import annotations

import numpy as np

SHAPE = (24, 32, 3)
SPREAD = 0.3  # standard deviation of a pixel of one picture, relative to its value


def scene() -> np.ndarray:
    """A smooth picture without symmetry, values from 0.2 to 1.8."""
    y, x = np.meshgrid(np.arange(SHAPE[0]), np.arange(SHAPE[1]), indexing="ij")
    grey = 1.0 + 0.5 * np.sin(0.4 * y + 0.1 * x) + 0.3 * np.cos(0.6 * x)
    return grey[..., None] * np.array([1.0, 0.9, 0.8])


def gaussian(rng: np.random.Generator) -> np.ndarray:
    return rng.standard_normal(SHAPE)


def skewed(rng: np.random.Generator) -> np.ndarray:
    """Gamma noise of mean 0 and variance 1, kurtosis 20: many dark, few bright."""
    return (rng.gamma(0.3, 1.0, SHAPE) - 0.3) / np.sqrt(0.3)


def fireflies(rng: np.random.Generator) -> np.ndarray:
    """Pareto noise of index 1.8: no variance at all, as a caustic looks to an average."""
    return rng.pareto(1.8, SHAPE)


def pictures(rng, noise=gaussian, *, count=8, truth=None) -> np.ndarray:
    """Return pictures with independent noise, (count, H, W, 3)."""
    truth = scene() if truth is None else truth
    return np.stack([truth + SPREAD * scene() * noise(rng) for _ in range(count)])
