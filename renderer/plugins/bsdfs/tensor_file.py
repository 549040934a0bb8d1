r"""Files of named arrays, the `tensor_file` format of measured materials [Dupuy2018].

After "tensor_file\0", two bytes of version and the number of fields, each field has a
name, a rank, a type, the offset of its numbers in the file, and its size along each axis.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError

_MAGIC = b"tensor_file\0\1\0"  # with the version, 1.0
_TYPES = {1: "u1", 2: "i1", 3: "<u2", 4: "<i2", 5: "<u4", 6: "<i4", 7: "<u8", 8: "<i8"} | {
    9: "<f2",
    10: "<f4",
    11: "<f8",
}
_MOST_FIELDS, _MOST_AXES = 256, 8

MOST_NUMBERS = 1 << 24
"""Largest size of a field, for tables of several materials to be indexed with 32 bits."""


class Field(NamedTuple):
    """An array of the file, as its header describes it."""

    type: str  # of NumPy
    offset: int  # [bytes]
    shape: tuple[int, ...]


class TensorFile:
    """The fields of an open file, which are read one by one.

    Raises
    ------
    SceneError
        If the header is damaged, or a field has more numbers than are in the file.
    """

    def __init__(self, path: Path, file: BinaryIO) -> None:
        self.name = path.name
        self._file = file
        self._size = path.stat().st_size
        start = file.read(len(_MAGIC))
        if start != _MAGIC:
            raise self.error(
                f'begins with {start!r}; expected "tensor_file" of version 1.0'
            )
        (count,) = self._unpack("I")
        if count > _MOST_FIELDS:
            raise self.error(f"{count} fields; at most {_MOST_FIELDS} are possible")
        self.fields: dict[str, Field] = {}
        for _ in range(count):
            (length,) = self._unpack("H")
            (name,) = self._unpack(f"{length}s")
            shown = repr(name[:40])[2:-1]  # bytes that cannot be printed are escaped
            self.fields[shown] = self._read_field(shown)

    def error(self, what: str) -> SceneError:
        """Return the error that the file is wrong."""
        return SceneError(f"{self.name}: {what}")

    def read(self, name: str) -> NDArray[Any]:
        """Return a field's numbers."""
        field = self.fields[name]
        self._file.seek(field.offset)
        content = self._file.read(_bytes_of(field))
        if len(content) < _bytes_of(field):
            raise self.error(f'ends within the field "{name}"')
        return np.frombuffer(content, field.type).reshape(field.shape)

    def _read_field(self, name: str) -> Field:
        rank, kind, offset = self._unpack("HBQ")
        if kind not in _TYPES or rank > _MOST_AXES:
            raise self.error(
                f'field "{name}" is of type {kind} and rank {rank}; possible are types 1 '
                f"to {max(_TYPES)} and ranks up to {_MOST_AXES}"
            )
        field = Field(_TYPES[kind], offset, self._unpack(f"{rank}Q"))
        shown = " x ".join(map(str, field.shape))
        if math.prod(field.shape) > MOST_NUMBERS:
            raise self.error(
                f'field "{name}" has {shown} numbers; at most {MOST_NUMBERS} are possible'
            )
        if (end := offset + _bytes_of(field)) > self._size:
            raise self.error(
                f'field "{name}" of {shown} numbers ends at byte {end}; the file has '
                f"{self._size} bytes"
            )
        return field

    def _unpack(self, form: str) -> tuple[Any, ...]:
        form = "<" + form
        content = self._file.read(struct.calcsize(form))
        if len(content) < struct.calcsize(form):
            raise self.error(f"ends within its header, after {self._size} bytes")
        return struct.unpack(form, content)


def _bytes_of(field: Field) -> int:
    return math.prod(field.shape) * np.dtype(field.type).itemsize


def tensor_file(fields: Mapping[str, NDArray[Any]]) -> bytes:
    """Return the content of a file with these arrays."""
    codes = {np.dtype(kind): code for code, kind in _TYPES.items()}
    names = {name.encode(): np.ascontiguousarray(a) for name, a in fields.items()}
    at = len(_MAGIC) + 4 + sum(13 + len(name) + 8 * a.ndim for name, a in names.items())
    header = _MAGIC + struct.pack("<I", len(names))
    for name, a in names.items():
        header += struct.pack("<H", len(name)) + name
        header += struct.pack(f"<HBQ{a.ndim}Q", a.ndim, codes[a.dtype], at, *a.shape)
        at += a.nbytes
    return header + b"".join(a.tobytes() for a in names.values())
