"""A PNG that ends early but properly: Pillow makes up black rows, and none may be shown.

Found by a damaged file of the soak: 213 bytes that were a picture of 7 x 16,711,685 pixels.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from image_files import chunk, png_file

from renderer.errors import SceneError
from renderer.scene_file.images.images import read_texels

WIDTH, HEIGHT = 9, 7
BITS = {(0, 1): 1, (0, 8): 8, (2, 8): 24, (3, 4): 4, (3, 8): 8, (4, 8): 16, (6, 8): 32}
# of 9 x 7 pixels, what each of the seven passes has: columns, rows
PASSES = ((2, 1), (1, 1), (3, 1), (2, 2), (5, 2), (4, 4), (9, 3))


def png(kind: tuple[int, int], rows: bytes, interlace: int = 0, size=(WIDTH, HEIGHT)):
    palette = [chunk(b"PLTE", bytes(range(48)))] if kind[0] == 3 else []
    return png_file(size, kind, rows, *palette, interlace=interlace)


def rows_of(bits: int, interlace: int) -> list[bytes]:
    """Return rows of nothing but zeros, each behind the number of its filter."""
    shapes = PASSES if interlace else ((WIDTH, HEIGHT),)
    return [bytes(1 + -(-w * bits // 8)) for w, h in shapes for _ in range(h)]


@pytest.mark.parametrize("interlace", [0, 1])
@pytest.mark.parametrize("kind", BITS)
def test_rows_that_lack_are_no_black_ones(
    tmp_path: Path, kind: tuple[int, int], interlace: int
) -> None:
    path = tmp_path / "a.png"
    rows = rows_of(BITS[kind], interlace)
    path.write_bytes(png(kind, b"".join(rows), interlace))
    assert read_texels(path).texels.shape[:2] == (HEIGHT, WIDTH)
    for missing in (1, 3):
        path.write_bytes(png(kind, b"".join(rows[:-missing]), interlace))
        held = sum(map(len, rows[:-missing]))
        message = f"{held} bytes of pixels; expected {sum(map(len, rows))}"
        with pytest.raises(SceneError, match=message):
            read_texels(path)


def test_a_header_that_promises_more_than_the_file_can_hold(
    tmp_path: Path, monkeypatch
) -> None:
    """It costs nothing: the refusal comes before Pillow decodes."""
    monkeypatch.setattr("PIL.ImageFile.ImageFile.load", None)
    content = png((6, 8), b"".join(rows_of(32, 0)), size=(7, 0xFF0005))
    (tmp_path / "a.png").write_bytes(content)
    with pytest.raises(SceneError, match=f"{len(content)} bytes cannot hold 7 x 16711685"):
        read_texels(tmp_path / "a.png")


@pytest.mark.parametrize("place", [0, 1])
def test_a_second_header_is_refused(tmp_path: Path, place: int) -> None:
    """Pillow takes the last one; the rows were counted by the first."""
    whole = png((2, 8), b"".join(rows_of(24, 0)))
    other = chunk(b"IHDR", struct.pack(">IIBBBBB", WIDTH, 90, 8, 2, 0, 0, 0))
    before = 8 if place == 0 else 33
    content = whole[:before] + other + whole[before:]
    if place == 0:
        content = whole[:8] + chunk(b"tIME", bytes(7)) + whole[8:]
    (tmp_path / "a.png").write_bytes(content)
    with pytest.raises(SceneError, match="first chunk is not its header"):
        read_texels(tmp_path / "a.png")


def test_a_second_header_of_the_same_size_is_refused(tmp_path: Path) -> None:
    """Rows of one bit would be counted, and rows of 24 be read."""
    whole = png((2, 8), b"".join(rows_of(24, 0)))
    first = chunk(b"IHDR", struct.pack(">IIBBBBB", WIDTH, HEIGHT, 1, 0, 0, 0, 0))
    (tmp_path / "a.png").write_bytes(whole[:8] + first + whole[8:])
    with pytest.raises(SceneError, match="more than one header"):
        read_texels(tmp_path / "a.png")


def test_pixels_are_those_of_before(tmp_path: Path) -> None:
    values = np.random.default_rng(3).integers(0, 256, (HEIGHT, 3 * WIDTH), dtype=np.uint8)
    values[-1] = 0  # a black last row is looked at
    rows = b"".join(b"\0" + row.tobytes() for row in values)
    (tmp_path / "a.png").write_bytes(png((2, 8), rows))
    found = read_texels(tmp_path / "a.png").texels
    np.testing.assert_array_equal(found.reshape(HEIGHT, -1), values)
