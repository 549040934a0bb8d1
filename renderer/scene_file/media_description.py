"""Participating media as a scene file describes them: media, volumes, phase functions."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

Rgb = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class ConstantVolume:
    """The same colour everywhere; the unit cube under `to_world` is its box."""

    rgb: Rgb
    to_world: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))

    @property
    def maximum(self) -> float:
        """The largest of its numbers."""
        return max(self.rgb)


@dataclass(frozen=True, eq=False)
class GridVolume:
    """Numbers at the centres of the cells of a grid over the unit cube."""

    values: NDArray[np.float32]  # (z, y, x, 1 or 3 channels), finite, at least 0
    to_world: NDArray[np.float64]  # (4, 4) of the unit cube
    filter_type: str = "trilinear"  # or "nearest"
    wrap_mode: str = "clamp"  # or "repeat", "mirror"

    @property
    def maximum(self) -> float:
        """The largest of its numbers."""
        return float(self.values.max())


Volume = ConstantVolume | GridVolume


@dataclass(frozen=True)
class IsotropicPhase:
    """Every direction is equally likely."""

    plugin: ClassVar[str] = "isotropic"


@dataclass(frozen=True)
class HenyeyGreenstein:
    """The phase function of [Henyey1941]; `g` is its mean cosine, above 0 forward."""

    plugin: ClassVar[str] = "hg"
    g: float = 0.8


@dataclass(frozen=True)
class RayleighPhase:
    """The phase function of particles much smaller than the wavelength."""

    plugin: ClassVar[str] = "rayleigh"


@dataclass(frozen=True)
class TabulatedPhase:
    """Linear between values at equally spaced cosines; the last one is forward."""

    plugin: ClassVar[str] = "tabphase"
    values: tuple[float, ...]


@dataclass(frozen=True)
class BlendedPhase:
    """Two phase functions; `weight` is the share of the second.

    A weight that is interpolated in a grid, or the luminance of colours, is clamped to
    [0, 1].
    """

    plugin: ClassVar[str] = "blendphase"
    weight: float | GridVolume  # a float: in [0, 1]
    first: Phase
    second: Phase


Phase = IsotropicPhase | HenyeyGreenstein | RayleighPhase | TabulatedPhase | BlendedPhase


@dataclass(frozen=True, eq=False)
class Medium:
    """What absorbs and scatters light between surfaces.

    The extinction coefficient is `scale` times `sigma_t` [1/length].
    """

    plugin: str  # "homogeneous" or "heterogeneous"
    sigma_t: Volume
    albedo: Volume
    scale: float = 1.0
    phase: Phase = IsotropicPhase()
    # These two choose between estimators of the same light in Mitsuba: for a replay.
    sample_emitters: bool = True
    has_spectral_extinction: bool = True
