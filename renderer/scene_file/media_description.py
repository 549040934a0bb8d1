"""Participating media in a scene description: media, volumes, phase functions."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

Rgb = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class ConstantVolume:
    """A constant colour; its box is the unit cube under `to_world`."""

    rgb: Rgb
    to_world: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))

    @property
    def maximum(self) -> float:
        """The largest value."""
        return max(self.rgb)


@dataclass(frozen=True, eq=False)
class GridVolume:
    """Values at the centres of the cells of a grid over the unit cube."""

    values: NDArray[np.float32]  # (z, y, x, 1 or 3 channels), finite, at least 0
    to_world: NDArray[np.float64]  # (4, 4) of the unit cube
    filter_type: str = "trilinear"  # or "nearest"
    wrap_mode: str = "clamp"  # or "repeat", "mirror"

    @property
    def maximum(self) -> float:
        """The largest value."""
        return float(self.values.max())


Volume = ConstantVolume | GridVolume


@dataclass(frozen=True)
class IsotropicPhase:
    """The isotropic phase function."""

    plugin: ClassVar[str] = "isotropic"


@dataclass(frozen=True)
class HenyeyGreenstein:
    """Henyey-Greenstein phase function [Henyey1941]; `g` is its mean cosine."""

    plugin: ClassVar[str] = "hg"
    g: float = 0.8


@dataclass(frozen=True)
class RayleighPhase:
    """Rayleigh phase function, for particles much smaller than the wavelength."""

    plugin: ClassVar[str] = "rayleigh"


@dataclass(frozen=True)
class TabulatedPhase:
    """Linear interpolation of values at equally spaced cosines; the last is forward."""

    plugin: ClassVar[str] = "tabphase"
    values: tuple[float, ...]


@dataclass(frozen=True)
class BlendedPhase:
    """Blend of two phase functions; `weight` is that of the second.

    A weight from a grid is interpolated, and then clamped to [0, 1].
    """

    plugin: ClassVar[str] = "blendphase"
    weight: float | GridVolume  # a float: in [0, 1]
    first: Phase
    second: Phase


Phase = IsotropicPhase | HenyeyGreenstein | RayleighPhase | TabulatedPhase | BlendedPhase


@dataclass(frozen=True, eq=False)
class Medium:
    """A participating medium.

    The extinction coefficient is `scale` times `sigma_t` [1/length].
    """

    plugin: str  # "homogeneous" or "heterogeneous"
    sigma_t: Volume
    albedo: Volume
    scale: float = 1.0
    phase: Phase = IsotropicPhase()
    # Mitsuba selects between estimators of the same radiance by these; for a replay.
    sample_emitters: bool = True
    has_spectral_extinction: bool = True
