"""Writes the small images of the scenes next to this file that are lit by images.

python tests/plugins/make_light_images.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR
from PIL import Image

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


def slide() -> np.ndarray:
    """Coloured stripes and a white frame, wider than high."""
    height, width = 8, 12
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    image = np.stack((x * 20, 230 - y * 28, 60 + 15 * ((x + y) % 9)), axis=-1)
    image[[0, -1]], image[:, [0, -1]] = 255, 255
    return image.astype(np.uint8)


def glow() -> np.ndarray:
    """A dim picture with a few bright texels, one of them in a corner."""
    image = np.full((6, 9, 3), (0.3, 0.2, 0.4))
    image[2, 3:5], image[4, 7], image[0, 0] = (9.0, 6.0, 2.0), (1.0, 8.0, 3.0), 6.0
    return image


if __name__ == "__main__":
    Image.fromarray(slide()).save(HERE / "slide.png")
    write_exr(HERE / "glow.exr", glow())
    write_exr(HERE / "sky.exr", sky())
