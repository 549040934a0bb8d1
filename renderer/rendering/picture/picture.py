"""Sums of the film as pixels: `Picture`, and the transfer curve of sRGB.

The transfer curve of sRGB: from light to the numbers that a screen expects.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray


def srgb_from_linear(linear: ArrayLike) -> NDArray[np.float64]:
    """Encode linear values by the curve of IEC 61966-2-1.

    Parameters
    ----------
    linear
        Any shape; clipped to [0, 1] first, so that infinity is 1. NaN stays NaN.

    Returns
    -------
    Values in [0, 1], float64, of the same shape.
    """
    clipped = np.clip(np.asarray(linear, dtype=np.float64), 0.0, 1.0)
    curve = 1.055 * np.power(clipped, 1.0 / 2.4) - 0.055
    return np.where(clipped <= 0.0031308, 12.92 * clipped, curve)


# ------------------------------------------------------------------------------ picture
# Picture: the pixels of a render, with everything that was measured on the way.

Array = NDArray[np.float32]


@dataclass(frozen=True, eq=False, repr=False)
class Picture:
    """What a file is made of; with ways to show itself it is an `Image`."""

    pixels: Array  # (H, W, 3), linear sRGB; row 0 is the top
    aovs: Mapping[str, Array] = field(default_factory=dict)  # name -> (H, W, C)
    aov_kinds: Mapping[str, str] = field(default_factory=dict)  # name -> "depth", "uv", ...
    # samples per pixel that there are; after an interrupt their mean, which need not be
    # whole, as some tiles have more than others. Of colours with AOVs, which come first, it
    # is that of the colours: 0 if all AOVs are there and no colour
    spp: float = 0
    # samples per pixel that were requested; None: as many as a goal takes
    requested_spp: int | None = None
    samples: int = 0  # all that were traced: of AOVs and of the film's border too
    seconds: float = 0.0  # render time without compilation
    compile_seconds: float = 0.0
    threads: int = 0
    integrator: str = ""  # what ran, after `auto` has chosen
    explain: str = ""  # what was modelled, what was left out, and why
    metadata: Mapping[str, str] = field(default_factory=dict)  # goes into the EXR header
    complete: bool = True  # False: interrupted, with fewer samples than requested
    error: float | None = None  # relative, estimated, of a render with a goal
    error_of_pixels: Array | None = None  # (H, W, 3), one guess of each pixel's difference
    error_unsure: bool = False  # the true one may well be another (`rendering.accuracy`)

    def __post_init__(self) -> None:
        """Refuse arrays whose shapes do not belong together."""
        if self.pixels.ndim != 3 or self.pixels.shape[2] != 3:
            raise ValueError(f"pixels have shape {self.pixels.shape}, not (H, W, 3)")
        for name, values in self.aovs.items():
            if values.ndim != 3 or values.shape[:2] != self.pixels.shape[:2]:
                raise ValueError(
                    f"AOV {name!r} has shape {values.shape}; the pixels have "
                    f"{self.pixels.shape}, so (H, W, C) with the same H and W is needed"
                )

    @property
    def samples_text(self) -> str:
        """How many samples per pixel there are, in words; of how many, if interrupted."""
        some = shown_spp(self.spp)
        if self.complete:
            return f"{some} samples per pixel"
        of = "" if self.requested_spp is None else f" of {self.requested_spp}"
        return f"interrupted: {some}{of} samples per pixel"

    @property
    def width(self) -> int:
        """Number of columns."""
        return int(self.pixels.shape[1])

    @property
    def height(self) -> int:
        """Number of rows."""
        return int(self.pixels.shape[0])


def shown_spp(spp: float) -> str:
    """Return samples per pixel as a text: "64", or "about 3.1" if it is no whole number."""
    if spp == int(spp):
        return str(int(spp))
    return f"about {spp:.1f}" if spp >= 1.0 else f"about {spp:.1g}"
