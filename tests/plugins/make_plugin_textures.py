"""Make the images and meshes of the scenes here: this file is a program.

The files are committed; they are small and of every format that a texture can come in.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import OpenEXR
from PIL import Image

HERE = Path(__file__).parent / "textures"
WIDTH, HEIGHT = 7, 5


def colors(seed: int) -> np.ndarray:
    """Return (H, W, 3) in [0.05, 0.95]: steps and noise, no symmetry."""
    noise = np.random.default_rng(seed).random((HEIGHT, WIDTH, 3))
    steps = np.linspace(0, 1, WIDTH)[None, :, None] * [1.0, 0.3, 0.0]
    steps = steps + np.linspace(0, 1, HEIGHT)[:, None, None] * [0.0, 0.5, 1.0]
    return 0.05 + 0.9 * (0.4 * noise + 0.6 * np.minimum(steps, 1.0))


def octets(seed: int) -> np.ndarray:
    return np.round(255 * colors(seed)).astype(np.uint8)


def write_16_bit(name: str, values: np.ndarray) -> None:
    """Write a PNG with 16 bits a channel, which Pillow cannot for colours."""
    height, width, channels = values.shape
    rows = values.astype(">u2").reshape(height, -1).view(np.uint8)
    packed = b"".join(b"\0" + row.tobytes() for row in rows)
    kind = {1: 0, 3: 2}[channels]
    header = struct.pack(">IIBBBBB", width, height, 16, kind, 0, 0, 0)
    content = b"\x89PNG\r\n\x1a\n"
    chunks = (b"IHDR", header), (b"IDAT", zlib.compress(packed)), (b"IEND", b"")
    for tag, data in chunks:
        content += struct.pack(">I", len(data)) + tag + data
        content += struct.pack(">I", zlib.crc32(tag + data))
    (HERE / name).write_bytes(content)


def write_exr(name: str, **channels: np.ndarray) -> None:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    given = {key: np.ascontiguousarray(value) for key, value in channels.items()}
    OpenEXR.File(header, given).write(str(HERE / name))


def write_hdr(name: str, values: np.ndarray) -> None:
    """Write rows that are not packed."""
    _, exponent = np.frexp(values.max(axis=2, keepdims=True))
    mantissas = np.ldexp(values, 8 - exponent).astype(np.uint8)
    pixels = np.concatenate([mantissas, (exponent + 128).astype(np.uint8)], axis=2)
    size = f"-Y {values.shape[0]} +X {values.shape[1]}\n"
    header = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{size}".encode()
    (HERE / name).write_bytes(header + pixels.tobytes())


def write_images() -> None:
    grey, alpha = octets(1)[:, :, 0], octets(2)[:, :, 1]
    Image.fromarray(octets(0)).save(HERE / "rgb.png")
    Image.fromarray(np.dstack([octets(3), alpha])).save(HERE / "rgba.png")
    Image.fromarray(grey).save(HERE / "grey.png")
    Image.fromarray(np.dstack([grey, alpha]), "LA").save(HERE / "grey_alpha.png")
    Image.fromarray(octets(4)[:1, :1]).save(HERE / "one_texel.png")
    Image.fromarray(octets(5)).save(HERE / "rgb.bmp")
    Image.fromarray(octets(6)).save(HERE / "rgb.tga")
    Image.fromarray(octets(7)).resize((16, 16)).save(HERE / "rgb.jpg", quality=95)
    write_16_bit("rgb_16.png", np.round(65535 * colors(8)))
    write_16_bit("grey_16.png", np.round(65535 * colors(9)[:, :, :1]))
    write_exr("half.exr", RGB=colors(10).astype(np.float16))
    write_exr("grey_half.exr", Y=colors(11)[:, :, 0].astype(np.float16))
    write_exr("float.exr", RGB=colors(12).astype(np.float32))
    write_exr("grey_float.exr", Y=colors(13)[:, :, 0].astype(np.float32))
    write_hdr("rgb.hdr", colors(14))


def write_meshes() -> None:
    """Write an octahedron with attributes of its vertices and of its faces."""
    rng = np.random.default_rng(15)
    corners = np.array(
        [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    )
    faces = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4)]
    faces += [(2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    of_vertices = ("x", "y", "z", "r", "g", "b", "heat_x")
    of_faces = ("tint_r", "tint_g", "tint_b", "age_0")
    lines = ["ply", "format ascii 1.0", f"element vertex {len(corners)}"]
    lines += [f"property float {name}" for name in of_vertices]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    lines += [f"property float {name}" for name in of_faces]
    lines += ["end_header"]
    for corner in corners:
        values = rng.uniform(0.05, 0.95, 4).round(3)
        lines.append(" ".join(str(value) for value in (*corner, *values)))
    for face in faces:
        values = rng.uniform(0.05, 0.95, 4).round(3)
        lines.append(" ".join(str(value) for value in (3, *face, *values)))
    (HERE / "octahedron.ply").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    HERE.mkdir(exist_ok=True)
    write_images()
    write_meshes()
