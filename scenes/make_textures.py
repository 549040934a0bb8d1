"""Make every image in this folder: `python scenes/make_textures.py`.

The files are committed. A test compares pixels, not bytes: how an image is packed depends
on the library that packs it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR
from numpy.typing import NDArray
from PIL import Image

HERE = Path(__file__).parent
Pixels = NDArray[np.uint8]


def planks(size: int = 256) -> Pixels:
    """Return wooden boards that run upwards and tile in both directions."""
    y, x = np.mgrid[0:size, 0:size] / size
    board = np.floor(4 * x)
    shift = np.array([0.13, 0.62, 0.37, 0.88])[board.astype(int)]
    tone = np.array([0.92, 1.08, 0.98, 1.04])[board.astype(int)]
    across = 4 * x - board
    wave = 0.35 * np.sin(2 * np.pi * (y + shift)) + 0.2 * np.sin(4 * np.pi * (y - shift))
    rings = 0.5 + 0.5 * np.sin(2 * np.pi * (3 * across + wave + shift))
    fibre = 0.5 + 0.5 * np.sin(2 * np.pi * (41 * across + 3 * wave))
    light = tone * (0.8 + 0.15 * rings + 0.05 * fibre)
    joint = (across < 0.03) | (np.mod(y + shift, 1.0) < 0.008)
    light = np.where(joint, 0.35, light)
    return to_pixels(light[..., None] * np.array([0.70, 0.47, 0.28]))


def invader() -> Pixels:
    """Return a small figure in hard pixels, for the nearest filter: 12 x 12."""
    half = ("000000", "000100", "000010", "000111", "001101", "011111")
    half += ("010111", "010100", "000011", "000000", "000000", "000000")
    left = np.array([[int(c) for c in row] for row in half])
    figure = np.roll(np.concatenate((left, left[:, ::-1]), axis=1), 1, axis=0)
    ink, paper = np.array([0.95, 0.75, 0.15]), np.array([0.12, 0.14, 0.35])
    return to_pixels(np.where(figure[..., None] == 1, ink, paper))


def sunset(width: int = 192, height: int = 128) -> Pixels:
    """Return a sun over water: smooth enough for JPEG."""
    y, x = np.mgrid[0:height, 0:width]
    x, y = (x + 0.5) / width - 0.5, 0.5 - (y + 0.5) / height
    above = y > -0.08
    sky = np.array([0.95, 0.55, 0.30]) + (y[..., None] + 0.1) * np.array([-0.9, -0.35, 0.6])
    sun = np.hypot(1.5 * x, y - 0.06) < 0.16
    stripes = 0.5 + 0.5 * np.sin(90.0 / (0.25 - y))
    glitter = np.exp(-((x / 0.16) ** 2)) * stripes
    water = np.array([0.10, 0.16, 0.32]) + glitter[..., None] * np.array([0.75, 0.45, 0.15])
    picture = np.where(above[..., None], sky, water)
    picture = np.where((sun & above)[..., None], np.array([1.0, 0.85, 0.45]), picture)
    return to_pixels(picture)


def glaze(size: int = 128) -> Pixels:
    """Return blue bands and dots on white, to go around a vase."""
    y, x = np.mgrid[0:size, 0:size] / size
    dots = np.hypot(np.mod(8 * x, 1.0) - 0.5, np.mod(8 * y, 1.0) - 0.5) < 0.28
    bands = np.abs(np.mod(4 * y + 0.15 * np.sin(16 * np.pi * x), 1.0) - 0.5) > 0.42
    in_middle = np.abs(y - 0.5) < 0.19
    blue = (dots & in_middle) | (bands & ~in_middle)
    return to_pixels(
        np.where(
            blue[..., None], np.array([0.13, 0.25, 0.62]), np.array([0.93, 0.92, 0.88])
        )
    )


def evening_sky(width: int = 128) -> NDArray[np.float16]:
    """Return radiance in all directions, y up: dusk, a darker ground and a low sun."""
    y, x = np.mgrid[0 : width // 2, 0:width]
    up = np.cos(np.pi * (y + 0.5) / (width // 2))[..., None]
    azimuth = (x + 0.5) / width
    glow = np.array([0.9, 0.32, 0.08]) * np.exp(-10 * np.abs(up))
    blue = np.array([0.22, 0.34, 0.62]) * (0.4 + 0.6 * np.maximum(up, 0))
    ground = np.array([0.06, 0.05, 0.05])
    sky = np.where(up > 0, blue + glow, ground + 0.15 * glow)
    turn = np.hypot((azimuth - 0.3) * width, y - 0.415 * (width // 2))
    sun = np.array([1.0, 0.72, 0.42]) * 20.0
    sky = np.where((turn < 4.5)[..., None], sun, sky)
    return sky.astype(np.float16)


def leaf(width: int = 96, height: int = 64) -> Pixels:
    """Return where a leaf is: grey, its edge softened over a texel, with holes."""
    y, x = np.mgrid[0:height, 0:width]
    u, v = (x + 0.5) / width, (y + 0.5) / height - 0.5
    teeth = 0.02 * np.abs(np.mod(14 * u, 1.0) - 0.5)
    half = 0.46 * np.sin(np.pi * np.clip(u, 0, 1) ** 0.7) ** 0.8 - teeth
    inside = np.clip((half - np.abs(v)) * height + 0.5, 0.0, 1.0)
    for center in ((0.62, 0.17), (0.4, -0.21), (0.71, -0.1)):
        hole = np.hypot((u - center[0]) * width, (v - center[1]) * height)
        inside = np.minimum(inside, np.clip(hole - 3.5, 0.0, 1.0))
    return to_pixels(inside)


def heights(size: int = 64) -> NDArray[np.float64]:
    """Return studs and rings in [0, 1] at texel centres; they tile in both directions."""
    y, x = (np.mgrid[0:size, 0:size] + 0.5) / size
    return relief(x, y)


def relief(u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the height in [0, 1] at (u, v), of period 1 in both."""
    across = np.sin(3 * np.pi * u) ** 2 + np.sin(3 * np.pi * v) ** 2
    wave = 0.5 + 0.5 * np.cos(6 * np.pi * u) * np.cos(6 * np.pi * v)
    return np.clip(0.6 * np.exp(-5 * across) + 0.4 * wave, 0.0, 1.0)


def normals(height: float = 0.08, size: int = 64) -> Pixels:
    """Return the relief's normals, `height` times as high as the square is wide."""
    y, x = (np.mgrid[0:size, 0:size] + 0.5) / size
    step = 0.5 / size
    along = (relief(x + step, y) - relief(x - step, y)) * size * height
    across = (relief(x, y + step) - relief(x, y - step)) * size * height
    n = np.stack((-along, -across, np.ones_like(along)), axis=-1)
    return to_pixels(0.5 + 0.5 * n / np.linalg.norm(n, axis=-1, keepdims=True))


def to_pixels(values: NDArray[np.float64]) -> Pixels:
    """Round values in [0, 1], already in sRGB, to bytes."""
    return np.round(255 * np.clip(values, 0.0, 1.0)).astype(np.uint8)


def main(folder: Path = HERE) -> None:
    """Write every texture of every scene under `folder`."""
    textures = folder / "textured-room/textures"
    textures.mkdir(parents=True, exist_ok=True)
    Image.fromarray(invader()).save(textures / "invader.png", optimize=True)
    Image.fromarray(glaze()).save(textures / "glaze.png", optimize=True)
    Image.fromarray(sunset()).save(textures / "sunset.jpg", quality=92)
    for scene in ("leaves", "bumps", "evening-sky"):
        (folder / scene / "textures").mkdir(parents=True, exist_ok=True)
    for scene in ("textured-room", "evening-sky"):
        path = folder / scene / "textures/planks.png"
        Image.fromarray(planks()).save(path, optimize=True)
    Image.fromarray(leaf()).save(folder / "leaves/textures/leaf.png", optimize=True)
    Image.fromarray(normals()).save(folder / "bumps/textures/normals.png", optimize=True)
    sixteen = np.round(65535 * heights()).astype(np.uint16)
    Image.fromarray(sixteen).save(folder / "bumps/textures/heights.png", optimize=True)
    sky = {"RGB": evening_sky()}
    with OpenEXR.File({}, sky) as file:
        file.write(str(folder / "evening-sky/textures/evening.exr"))


if __name__ == "__main__":
    main()
