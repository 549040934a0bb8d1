"""Image: what a render gives back, and how it shows itself."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.rendering.picture.image_files import encode_png, write_image_file

Array = NDArray[np.float32]


@dataclass(frozen=True, eq=False, repr=False)
class Image:
    """A rendered picture with everything that was measured on the way.

    `np.asarray(image)` is its pixels; in a notebook it shows itself.
    """

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

    def save(self, path: str | Path) -> None:
        """Write the picture in the form that the ending of `path` names.

        `.exr` holds float32 R, G, B and every AOV as channels `name.X` and so on, as
        Mitsuba names them, and the metadata; `.npy` the float32 pixels; `.png` the pixels
        as 8-bit sRGB, clipped to [0, 1]. The file appears whole or not at all.

        Raises
        ------
        SceneError
            If the ending is another one, or the file cannot be written.

        Warns
        -----
        RuntimeWarning
            If a PNG is to show pixels that are NaN or infinite: they become magenta.
        """
        write_image_file(Path(path), self)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """Return the pixels, for NumPy's functions."""
        return np.array(self.pixels, dtype=dtype, copy=copy)

    def __repr__(self) -> str:
        """Return size, samples and time, not the numbers."""
        aovs = f", AOVs {', '.join(self.aovs)}" if self.aovs else ""
        return (
            f"<Image {self.width} x {self.height}, {self.spp} samples per pixel, "
            f"{self.seconds:.2f} s{aovs}>"
        )

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        encode_png(self.pixels).save(buffer, format="PNG")
        return buffer.getvalue()

    def _repr_html_(self) -> str:
        encoded = base64.b64encode(self._repr_png_()).decode("ascii")
        caption = html.escape(repr(self)[1:-1])
        return (
            f'<figure><img src="data:image/png;base64,{encoded}" alt="{caption}">'
            f"<figcaption>{caption}</figcaption></figure>"
        )
