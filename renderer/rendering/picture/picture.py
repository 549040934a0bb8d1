"""`Picture`: the pixels of a render and its measurements; the transfer curve of sRGB."""

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
# Picture: the pixels of a render, with all measurements of it.

Array = NDArray[np.float32]


@dataclass(frozen=True, eq=False, repr=False)
class Picture:
    """The content of an image file; `Image` adds the display."""

    pixels: Array  # (H, W, 3), linear sRGB; row 0 is the top
    aovs: Mapping[str, Array] = field(default_factory=dict)  # name -> (H, W, C)
    aov_kinds: Mapping[str, str] = field(default_factory=dict)  # name -> "depth", "uv", ...
    # Samples per pixel that were rendered. After an interrupt their mean, which need not be
    # an integer, as tiles may have different numbers. For colours with AOVs, which are
    # rendered first, the number of the colours: 0 if only AOVs are there.
    spp: float = 0
    # samples per pixel that were requested; None: as many as a goal needs
    requested_spp: int | None = None
    samples: int = 0  # total, including those of AOVs and of the film's border
    seconds: float = 0.0  # render time without compilation
    compile_seconds: float = 0.0
    threads: int = 0
    integrator: str = ""  # that was used, after `auto` has been resolved
    explain: str = ""  # what was rendered, what was left out, and why
    metadata: Mapping[str, str] = field(default_factory=dict)  # for the EXR header
    complete: bool = True  # False: interrupted, with fewer samples than requested
    error: float | None = None  # estimated relative error, of a render with a goal
    error_of_pixels: Array | None = None  # (H, W, 3), an estimate of each pixel's error
    error_unsure: bool = False  # whether `error` may be far off (`rendering.accuracy`)

    def __post_init__(self) -> None:
        """Refuse arrays whose shapes do not match."""
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
        """Number of samples per pixel in words, and the requested number if interrupted."""
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
    """Return samples per pixel as text: "64", or "about 3.1" if not an integer."""
    if spp == int(spp):
        return str(int(spp))
    return f"about {spp:.1f}" if spp >= 1.0 else f"about {spp:.1g}"
