"""Picture: the pixels of a render, with everything that was measured on the way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]


@dataclass(frozen=True, eq=False, repr=False)
class Picture:
    """What a file is made of; with ways to show itself it is an `Image`."""

    pixels: Array  # (H, W, 3), linear sRGB; row 0 is the top
    aovs: Mapping[str, Array] = field(default_factory=dict)  # name -> (H, W, C)
    aov_kinds: Mapping[str, str] = field(default_factory=dict)  # name -> "depth", "uv", ...
    spp: int = 0  # samples per pixel
    seconds: float = 0.0  # render time without compilation
    compile_seconds: float = 0.0
    threads: int = 0
    integrator: str = ""  # what ran, after `auto` has chosen
    explain: str = ""  # what was modelled, what was left out, and why
    metadata: Mapping[str, str] = field(default_factory=dict)  # goes into the EXR header
    complete: bool = True  # False: interrupted, fewer samples than spp
    error: float | None = None  # relative, estimated, where a render was asked for one
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
    def width(self) -> int:
        """Number of columns."""
        return int(self.pixels.shape[1])

    @property
    def height(self) -> int:
        """Number of rows."""
        return int(self.pixels.shape[0])
