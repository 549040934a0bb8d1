"""What a path carries through media in Mitsuba: a throughput, or in `volpathmis` matrices.

The methods are those of `renderer.replay.media.carried`. A shadow ray carries the same.
"""

from __future__ import annotations

import copy
from typing import Any, Self

import drjit
import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.our_renderer.traced_path import (
    DENSITIES,
    LIT,
    LIT_DENSITIES,
    Vector,
    Weights,
)
from mitsuba_ref.replay.integrator_method import Method
from mitsuba_ref.replay.paths.mitsuba_path import PathState, vector

Matrix = NDArray[np.float32]


class PathInMedia(PathState):
    """The state of a path of `volpath`; `delta`: no light sample could find its light."""

    def __init__(self, mi: Any, ray: Any, medium: Any, number: float) -> None:
        super().__init__(mi, ray)
        self.medium = medium
        self.channel = min(int(np.float32(number) * np.float32(3.0)), 2)

    @property
    def worth(self) -> Vector:
        """The throughput for Russian roulette; a path ends at black."""
        return vector(self.throughput)

    @property
    def passes(self) -> bool:
        """Whether a shadow ray goes on."""
        return any(vector(self.throughput))

    def multiply(self, factor: Any) -> None:
        """Multiply the throughput by a colour."""
        self.throughput = self.throughput * factor

    def raise_throughput(self, survival: float) -> None:
        """Survive the roulette."""
        self.multiply(_inverse(survival))

    def after_flight(self, passed: Any, pdf: Any) -> None:
        """Pass a transmittance, with the density of each colour."""
        self.multiply(passed * _inverse_or_zero(pdf[self.channel]))

    def after_null_collision(self, mei: Any, share: float, spectral: bool) -> None:
        """Go on after a null collision of this probability."""
        if spectral:
            self.multiply(mei.sigma_n * _inverse(share))

    def after_collision(self, mei: Any, share: float, spectral: bool) -> None:
        """Be scattered by a real collision."""
        if spectral:
            real = drjit.mean(mei.sigma_t / mei.combined_extinction)
            self.multiply(mei.sigma_s * _inverse(real))
        else:
            self.multiply(mei.sigma_s / mei.sigma_t)

    def after_ratio(self, mei: Any, spectral: bool) -> None:
        """Go on as a shadow ray after a collision."""
        sigma_n = mei.sigma_n
        self.multiply(sigma_n if spectral else sigma_n / mei.combined_extinction)

    def after_scattering(self, weight: Any, pdf: float, straight: bool = False) -> None:
        """Take a direction of a BSDF or a phase function."""
        self.multiply(weight)

    def shadow_ray(self, light_pdf: float) -> Self:
        """Return the state of a shadow ray to a light sample."""
        ray = copy.copy(self)
        ray.throughput = self._mi.Color3f(float(light_pdf != 0.0))
        return ray

    def light(
        self, shadow: Self, value: Any, pdf: float, light_pdf: float, radiance: Any
    ) -> tuple[Any, Any]:
        """Return what a light sample carries, and what of it arrives.

        Parameters
        ----------
        shadow
            The state of the shadow ray at the light.
        value, pdf
            Of the BSDF or phase function towards the light; 0 if only samples find it.
        light_pdf, radiance
            The density of the sample, and the radiance over it.
        """
        weight = _BALANCED.light_weight(light_pdf, pdf)
        return self.throughput * (value * weight) * radiance, shadow.throughput


_BALANCED = Method(0, 0, False)  # one light sample


class PathOfBothWays(PathInMedia):
    """The state of a path of `volpathmis`.

    Parameters
    ----------
    densities
        3; or 1, if only the density of the chosen colour counts.
    """

    def __init__(
        self, mi: Any, ray: Any, medium: Any, number: float, densities: int
    ) -> None:
        super().__init__(mi, ray, medium, number)
        # p_j / f_i, by sampling directions and by sampling a light at the last event
        self._found = np.ones((3, densities), np.float32)
        self._lit = self._found

    @property
    def worth(self) -> Vector:
        """The throughput for Russian roulette; for one density, black if one colour is."""
        return vector(_weight(self._found))

    @property
    def passes(self) -> bool:
        """Whether a shadow ray goes on."""
        lit = self._found.shape[1] == 1 and bool(self._lit.any())
        return lit or bool(self._found.any())

    @property
    def weights(self) -> Weights:
        """What a trace shows of the matrices."""
        found, lit = _densities(self._found), _densities(self._lit)
        weights = {DENSITIES: found}
        if not self.delta and self.pdf > 0.0:
            by_direction = _reciprocals(self._lit) / np.float32(self.pdf)
            weights |= {LIT: vector(by_direction), LIT_DENSITIES: lit}
        return {name: weight for name, weight in weights.items() if any(weight)}

    def _step(self, p: Any, f: Any) -> None:
        self._found = self._times(self._found, p, f)
        self.throughput = self._mi.Color3f(*vector(_reciprocals(self._found)))

    def _step_lit(self, p: Any, f: Any) -> None:
        self._lit = self._times(self._lit, p, f)

    def _times(self, matrix: Matrix, p: Any, f: Any) -> Matrix:
        """Return p_j / f_i after a step of these densities and values."""
        densities = _rgb(p)
        if matrix.shape[1] == 1:
            densities = densities[self.channel : self.channel + 1]
        with np.errstate(all="ignore"):
            ratio = densities[None, :] / _rgb(f)[:, None]
            ratio = np.where(np.isfinite(ratio), ratio, np.float32(0.0)) * matrix
        return np.where(np.isnan(ratio), np.float32(0.0), ratio)

    def raise_throughput(self, survival: float) -> None:
        """Survive the roulette."""
        self._step(survival, 1.0)

    def after_flight(self, passed: Any, pdf: Any) -> None:
        """Pass a transmittance, with the density of each colour."""
        self._step(pdf, passed)
        self._step_lit(pdf, passed)

    def after_null_collision(self, mei: Any, share: float, spectral: bool) -> None:
        """Go on after a null collision of this probability."""
        self._step(share if spectral else mei.sigma_n, mei.sigma_n)
        self._step_lit(1.0, mei.sigma_n if spectral else share)

    def after_collision(self, mei: Any, share: float, spectral: bool) -> None:
        """Be scattered by a real collision."""
        self._step(1.0 - share if spectral else mei.sigma_t, mei.sigma_s)

    def after_ratio(self, mei: Any, spectral: bool) -> None:
        """Go on as a shadow ray after a collision."""
        sigma_n = mei.sigma_n
        ratio = sigma_n / mei.combined_extinction
        self._step(drjit.mean(ratio) if spectral else sigma_n, sigma_n)
        self._step_lit(1.0, sigma_n if spectral else ratio)

    def after_scattering(self, weight: Any, pdf: float, straight: bool = False) -> None:
        """Take a direction of a BSDF or a phase function."""
        if not straight:
            self._lit = self._times(self._found, 1.0, weight * pdf)
        self._step(pdf, weight * pdf)

    def arrive(self, radiance: Any, light_pdf: float | None, method: Method) -> None:
        """Add emitted light; `light_pdf` is None where no light sample could find it."""
        weights = self._found
        if light_pdf is not None:
            self._step_lit(light_pdf, 1.0)
            weights = weights + self._lit
        self.result = self.result + self._mi.Color3f(*vector(_weight(weights))) * radiance

    def shadow_ray(self, light_pdf: float) -> Self:
        """Return the state of a shadow ray to a light sample."""
        ray = copy.copy(self)
        ray._lit = self._found
        ray._step_lit(light_pdf, 1.0)
        return ray

    def light(
        self, shadow: Self, value: Any, pdf: float, light_pdf: float, radiance: Any
    ) -> tuple[Any, Any]:
        """Return what a light sample carries, and what of it arrives, by both weights."""
        shadow._step_lit(1.0, value)
        shadow._step(pdf, value)
        weight = _weight(shadow._found + shadow._lit) * np.float32(light_pdf)
        scale = _rgb(value)
        with np.errstate(all="ignore"):
            passed = np.where(scale == 0.0, np.float32(0.0), weight / scale)
        return value * radiance, self._mi.Color3f(*vector(passed))


def _reciprocals(matrix: Matrix) -> Matrix:
    """Return f_i / mean(p); 0 for a row without a density."""
    with np.errstate(all="ignore"):
        sums, count = matrix.sum(axis=1), np.float32(matrix.shape[1])
        return np.where(sums == 0.0, np.float32(0.0), count / sums)


def _weight(matrix: Matrix) -> Matrix:
    """Return f_i / mean(p); of one density, black if any colour is."""
    throughput = _reciprocals(matrix)
    void = matrix.shape[1] == 1 and not throughput.all()
    return np.zeros_like(throughput) if void else throughput


def _densities(matrix: Matrix) -> Vector:
    """Return p_j / mean(p), black if there is none."""
    total = matrix.sum(axis=0)
    return vector(np.resize(total / (total.mean() or np.float32(1.0)), 3))


def _rgb(value: Any) -> Matrix:
    """Return a colour, or a number of all three, as an array."""
    of_all = isinstance(value, float | np.floating)
    return np.array([value] * 3 if of_all else vector(value), np.float32)


def _inverse(x: float) -> float:
    """Return 1 / x in single precision."""
    return float(np.float32(1.0) / np.float32(x))


def _inverse_or_zero(x: float) -> float:
    """Return 1 / x, and 0 where x is not positive."""
    return _inverse(x) if x > 0.0 else 0.0
