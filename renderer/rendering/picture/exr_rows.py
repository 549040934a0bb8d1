"""Writes an EXR file by rows, so that the picture is never in memory as a whole.

OpenEXR's Python interface writes whole pictures. (An older class writes rows, and crashes
if a channel has 2 GiB.) But rows are compressed in independent chunks of 16. So OpenEXR
compresses some rows as a separate picture, and this module copies their chunks to the large
file, behind a header with its size and a table of the positions of all chunks. The file is
byte by byte the one that `Image.save` writes.

Format after "Technical Introduction to OpenEXR" and "OpenEXR File Layout" (openexr.com): a
magic number, flags, attributes (name, type, size, value) that end with an empty name, the
table (64 bits each), and the chunks, each after its first row and its size (32 bits each).
"""

from __future__ import annotations

import io
import struct
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.process.whole_file import whole_file
from renderer.rendering.picture.image import Image
from renderer.rendering.picture.image_files import (
    check_output_path,
    exr_header,
    exr_planes,
)

CHUNK = 16  # rows that ZIP compresses together
_WINDOWS = (b"dataWindow", b"displayWindow")
_START = 8  # bytes: the magic number and the flags


class ExrRows:
    """A file that is written from the top; it gets its name when it is complete.

    Parameters
    ----------
    path
        It must end in .exr.
    width, height
        Of the whole picture.

    Raises
    ------
    SceneError
        If it cannot be written; also raised by `add` and at the end.
    """

    def __init__(self, path: Path, width: int, height: int) -> None:
        check_output_path(path)
        if path.suffix.lower() != ".exr":
            raise SceneError(f"{path}: rows can be written to an .exr file alone")
        self._path, self._width, self._height = path, width, height
        self._chunks: list[int] = []  # position of each
        self._rest: dict[str, NDArray[np.float32]] = {}  # rows of an incomplete chunk
        self._done = 0  # rows in the file
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        """Return the file."""
        try:
            self._file = self._stack.enter_context(whole_file(self._path))
        except OSError as error:
            raise self._failed(error) from error
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close and rename the file; after an error it is deleted."""
        if error is not None:
            self._stack.__exit__(kind, error, trace)
            return
        try:
            with self._stack.pop_all():
                self._end()
        except OSError as failure:
            raise self._failed(failure) from failure

    def add(self, rows: Image) -> None:
        """Write the next rows; the first ones define the channels and the metadata."""
        planes = exr_planes(rows)
        if self._rest:
            planes = {
                name: np.vstack([self._rest[name], plane]) for name, plane in planes.items()
            }
        count = next(iter(planes.values())).shape[0]
        if self._done + count < self._height:
            count -= count % CHUNK
        self._rest = {name: plane[count:].copy() for name, plane in planes.items()}
        if count:
            try:
                self._add_chunks({k: plane[:count] for k, plane in planes.items()}, rows)
            except (OSError, RuntimeError) as error:  # OpenEXR raises RuntimeError
                raise self._failed(error) from error
            self._done += count

    def _add_chunks(self, planes: dict[str, NDArray[np.float32]], image: Image) -> None:
        import OpenEXR

        piece = io.BytesIO()
        OpenEXR.File(exr_header(image), dict(planes)).write(piece)
        content = piece.getbuffer()
        header = bytearray(content[: _end_of_header(content)])
        if not self._done:
            for at in _windows(header):
                struct.pack_into("<4i", header, at, 0, 0, self._width - 1, self._height - 1)
            self._file.write(header)
            self._table = self._file.tell()
            self._file.write(bytes(8 * -(-self._height // CHUNK)))
        rows = next(iter(planes.values())).shape[0]
        at = len(header) + 8 * -(-rows // CHUNK)
        while at < len(content):
            first, size = struct.unpack_from("<ii", content, at)
            self._chunks.append(self._file.tell())
            self._file.write(struct.pack("<ii", first + self._done, size))
            self._file.write(content[at + 8 : at + 8 + size])
            at += 8 + size

    def _end(self) -> None:
        if self._done != self._height:
            raise SceneError(f"{self._path}: {self._done} of {self._height} rows are there")
        self._file.seek(self._table)
        self._file.write(struct.pack(f"<{len(self._chunks)}Q", *self._chunks))

    def _failed(self, error: Exception) -> SceneError:
        reason = getattr(error, "strerror", None) or error
        return SceneError(f"{self._path}: cannot be written: {reason}")


def _attributes(content: Any) -> list[tuple[bytes, int, int]]:
    """Return name, position and size of the value of each attribute of a header."""
    content = bytes(content[: 1 << 20])
    found, at = [], _START
    while content[at]:
        name_end = content.index(0, at)
        type_end = content.index(0, name_end + 1)
        (size,) = struct.unpack_from("<i", content, type_end + 1)
        found.append((content[at:name_end], type_end + 5, size))
        at = type_end + 5 + size
    return found


def _end_of_header(content: Any) -> int:
    _, at, size = _attributes(content)[-1]
    return at + size + 1


def _windows(header: bytearray) -> list[int]:
    """Return the positions of the values with the numbers of pixels."""
    return [at for name, at, _ in _attributes(header) if name in _WINDOWS]
