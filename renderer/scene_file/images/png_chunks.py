"""Whether a PNG holds the rows that its header promises, which Pillow does not say.

A stream that ends early, but properly and with a whole row, is no error there: the rows
that are missing are black.
"""

from __future__ import annotations

import struct
import zlib

SIGNATURE = b"\x89PNG\r\n\x1a\n"
CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}  # by colour type, 3 has a palette
DEFLATE_RATIO = 1032  # bytes that one byte of a stream may stand for, at most
HEAD = 29  # [bytes] of signature and header
_PIECE = 1 << 16  # [bytes]
# first column and row of the seven passes of an interlaced image, and the steps to the next
_PASSES = (
    *((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4)),
    *((0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)),
)


def chunks(content: bytes, wanted: bytes) -> list[bytes]:
    """Return the chunks of one kind; of one that ends too early, what is there."""
    parts = []
    position = len(SIGNATURE)
    while position + 8 <= len(content):
        length, kind = struct.unpack_from(">I4s", content, position)
        if kind == wanted:
            parts.append(content[position + 8 : position + 8 + length])
        position += length + 12  # length, kind, checksum
    return parts


def image_data(content: bytes) -> bytes:
    """Join the IDAT chunks of a file."""
    return b"".join(chunks(content, b"IDAT"))


def size_of(content: bytes) -> tuple[int, int]:
    """Return width and height as the header has them."""
    width, height = struct.unpack_from(">II", content, 16)
    return width, height


def bytes_of_rows(content: bytes) -> int:
    """Return how many bytes all rows have that the header promises, unpacked.

    The header is the first chunk, which the caller has seen to.
    """
    width, height, depth, color_type, _, _, interlace = struct.unpack_from(
        ">IIBBBBB", content, 16
    )
    bits = depth * CHANNELS.get(color_type, 0)
    total = 0
    for x, y, step_x, step_y in _PASSES if interlace else ((0, 0, 1, 1),):
        columns, rows = -(-(width - x) // step_x), -(-(height - y) // step_y)
        if columns > 0 and rows > 0:
            total += rows * (1 + -(-columns * bits // 8))  # a byte names the row's filter
    return total


def bytes_held(content: bytes, at_most: int) -> int:
    """Return how many bytes of rows there are, up to `at_most`.

    Raises
    ------
    zlib.error, struct.error
        If there is no telling.
    """
    # without the stream's head of two bytes, so that its checksum is not verified: Pillow
    # does not verify it either if all rows are there
    data, inflater, found = image_data(content)[2:], zlib.decompressobj(-15), 0
    for start in range(0, len(data), _PIECE):
        piece = data[start : start + _PIECE]
        while piece and found < at_most:
            found += len(inflater.decompress(piece, min(16 * _PIECE, at_most - found)))
            piece = inflater.unconsumed_tail
    return found
