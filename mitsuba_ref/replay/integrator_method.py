"""What Mitsuba's `path`, `direct`, `volpath` and `volpathmis` do differently.

All but `volpathmis` weight light samples and BSDF samples by the power heuristic
[Veach1997].
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from mitsuba_ref.reference.errors import MitsubaError


@dataclass(frozen=True)
class Method:
    """One integrator's parameters."""

    max_depth: int
    roulette_depth: int | None  # None: draws no number for it
    hide_emitters: bool
    light_samples: int = 1
    bsdf_samples: int = 1  # 0: the path ends where the lights were sampled
    share: bool = False  # whether densities count by their share of all samples
    point_first: bool = False  # the BSDF's point is drawn before its single number
    media: bool = False  # paths pass through media
    densities: int = 0  # of a path of `volpathmis`: 3, or 1 without use_spectral_mis

    def light_weight(self, light_pdf: float, bsdf_pdf: float) -> float:
        """Return the weight of one of the light samples."""
        lights, bsdf = self._shares
        weight = _power_heuristic(light_pdf, lights, bsdf_pdf, bsdf)
        return weight / self.light_samples

    def bsdf_weight(self, bsdf_pdf: float, light_pdf: float) -> float:
        """Return the weight of a direction that the BSDF chose."""
        lights, bsdf = self._shares
        return _power_heuristic(bsdf_pdf, bsdf, light_pdf, lights)

    @property
    def _shares(self) -> tuple[float, float]:
        if not self.share:
            return 1.0, 1.0
        count = self.light_samples + self.bsdf_samples
        return self.light_samples / count, self.bsdf_samples / count


def read_method(integrator: Any, densities: int = 3) -> Method:
    """Return the parameters of a mitsuba.Integrator.

    Its description in words is the only place that has them all, but for `densities`, which
    count for `volpathmis`.

    Raises
    ------
    MitsubaError
        For another integrator, or more than one path at a hit.
    """
    text = str(integrator)
    name = text.partition("[")[0]
    number = {k: int(v) for k, v in re.findall(r"(\w+) = (\d+)", text)}
    hide = bool(getattr(integrator, "hide_emitters", False))
    if name == "PathIntegrator":
        return Method(number["max_depth"], number["rr_depth"], hide)
    in_media = {
        "VolumetricSimplePathIntegrator": 0,
        "VolumetricMisPathIntegrator": densities,
    }
    if name in in_media:
        depths = number["max_depth"], number["rr_depth"]
        return Method(*depths, hide, media=True, densities=in_media[name])
    if name != "DirectIntegrator":
        known = "path, direct, volpath and volpathmis"
        raise MitsubaError(f"a trace follows {known} only; the scene has {name}")
    lights, directions = number["emitter_samples"], number["bsdf_samples"]
    if directions > 1:
        raise MitsubaError(f"a trace follows one path; the scene has {directions} at a hit")
    return Method(
        max_depth=2,
        roulette_depth=None,
        hide_emitters=hide,
        light_samples=lights,
        bsdf_samples=directions,
        share=True,
        point_first=True,
    )


def _power_heuristic(pdf: float, share: float, other_pdf: float, other: float) -> float:
    """Return the weight of a sample of `pdf`; 0 where Mitsuba's squares overflow."""
    with np.errstate(over="ignore", invalid="ignore"):
        a = (np.float32(pdf) * np.float32(share)) ** 2
        b = (np.float32(other_pdf) * np.float32(other)) ** 2
        weight = a / (a + b)
    return float(weight) if np.isfinite(weight) else 0.0
