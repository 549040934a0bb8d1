"""`Image`: the result of a render, with its display in notebooks."""

from __future__ import annotations

import base64
import html
import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.rendering.picture.image_files import encode_png, write_image_file
from renderer.rendering.picture.picture import Picture


class Image(Picture):
    """A rendered picture with all measurements of its render.

    `np.asarray(image)` is its pixels; in a notebook it shows itself.
    """

    def save(self, path: str | Path) -> None:
        """Write the picture in the format of the file extension of `path`.

        `.exr` holds float32 R, G, B and every AOV as channels `name.X` and so on, as
        Mitsuba names them, and the metadata; `.npy` the float32 pixels; `.png` the pixels
        as 8-bit sRGB, clipped to [0, 1]. The file appears whole or not at all.

        Raises
        ------
        SceneError
            If the extension is not supported, or the file cannot be written.

        Warns
        -----
        RuntimeWarning
            If a PNG has pixels that are NaN or infinite: they become magenta.
        """
        write_image_file(Path(path), self)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """Return the pixels, for NumPy functions."""
        return np.array(self.pixels, dtype=dtype, copy=copy)

    def __repr__(self) -> str:
        """Return size, number of samples and time, not the pixels."""
        aovs = f", AOVs {', '.join(self.aovs)}" if self.aovs else ""
        return (
            f"<Image {self.width} x {self.height}, {self.samples_text}, "
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
