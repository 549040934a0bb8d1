"""Writes the small images of the scenes beside this file that are lit by images.

python tests/plugins/make_light_images.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR

HERE = Path(__file__).parent


def write_exr(path: Path, pixels: np.ndarray) -> None:
    """Write (H, W, 3) as full floats."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    channels = {
        name: np.ascontiguousarray(pixels[..., k], np.float32)
        for k, name in enumerate("RGB")
    }
    with OpenEXR.File(header, channels) as file:
        file.write(str(path))


def sky() -> np.ndarray:
    """A blue gradient over brown ground, with a sun of three texels and a green window."""
    height, width = 12, 24
    up = np.linspace(1.0, -1.0, height)[:, None, None]
    image = np.where(up > 0, (0.3, 0.5, 0.9) * (1.2 - up), (0.25, 0.2, 0.15))
    image = np.broadcast_to(image, (height, width, 3)).copy()
    image[3, 22:24] = image[3, 0] = 60.0, 50.0, 35.0  # across the seam
    image[5:7, 8:11] = 1.0, 4.0, 1.5
    return image


if __name__ == "__main__":
    write_exr(HERE / "sky.exr", sky())
