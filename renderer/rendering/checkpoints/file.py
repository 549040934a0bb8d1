"""The file of a checkpoint: named arrays and the identity of their render, with a checksum.

The previous checkpoint is kept with the new one, so there is a valid file at every moment:
the new one is on the disk before it replaces the old one, and a truncated or changed file
is detected by its checksum. docs/checkpoints.md has the format.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.process.whole_file import whole_file

MAGIC = b"lightproof checkpoint 1\n"
LENGTH = 8  # bytes of the header's length, little-endian
CHECKSUM = 32  # bytes of SHA-256 of everything before it, at the end of the file
BLOCK = 1 << 20  # bytes per read
Arrays = Mapping[str, NDArray[Any]]


class Damaged(Exception):
    """A file that is not a valid checkpoint; the message gives the reason, not the name."""


class Layout(NamedTuple):
    """Type and position of an array in a file."""

    dtype: str  # such as "<f8"
    shape: tuple[int, ...]
    offset: int  # [bytes]


class Stored(NamedTuple):
    """A checkpoint in a file whose checksum was valid."""

    path: Path
    of: dict[str, dict[str, str]]  # see `identity`
    arrays: dict[str, Layout]

    def read_into(self, arrays: Arrays) -> None:
        """Fill arrays, which must have the types and shapes of those in the file."""
        with self.path.open("rb") as file:
            for name, array in arrays.items():
                file.seek(self.arrays[name].offset)
                _fill(file, array)


def older(path: Path) -> Path:
    """Return the path of the previous checkpoint, for the current one at `path`."""
    return path.with_name(f"{path.name}.older")


def write_checkpoint(
    path: Path, of: dict[str, dict[str, str]], arrays: Arrays, *, keep: bool
) -> None:
    """Write a checkpoint; with `keep` the present file becomes the older one.

    Raises
    ------
    OSError
        Such as for a full disk. The old files still exist then.
    """
    types = [[name, a.dtype.str, list(a.shape)] for name, a in arrays.items()]
    header = json.dumps({"of": of, "arrays": types}, ensure_ascii=True).encode()
    length = len(header).to_bytes(LENGTH, "little")
    digest = hashlib.sha256()
    # For a moment only the older file exists: `find_checkpoint` reads it then.
    with whole_file(path, older=older(path) if keep else None) as file:
        data = map(_bytes_of, arrays.values())
        for block in (memoryview(MAGIC + length + header), *data):
            digest.update(block)
            file.write(block)
        file.write(digest.digest())


def find_checkpoint(path: Path) -> tuple[Stored | None, list[str]]:
    """Return the newest valid checkpoint at `path`, and the errors of newer files.

    Without a file the result is None and no errors.
    """
    wrong: list[str] = []
    for candidate in (path, older(path)):
        try:
            return read_checkpoint(candidate), wrong
        except FileNotFoundError:
            continue
        except (Damaged, OSError) as error:
            wrong.append(f"{candidate} {_reason(error)}")
    return None, wrong


def read_checkpoint(path: Path) -> Stored:
    """Verify a checkpoint; return its identity and the positions of its arrays.

    Raises
    ------
    Damaged
        If it was truncated or changed, or is not a checkpoint.
    OSError
        If it cannot be read.
    """
    if not path.is_file() and path.exists():
        raise Damaged("is no file")
    size = path.stat().st_size
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC[:size] or size == 0:
            raise Damaged("is no checkpoint of this version's format")
        file.seek(0)
        digest = hashlib.sha256()
        for block in _blocks(file, size - CHECKSUM):
            digest.update(block)
        if size < len(MAGIC) + LENGTH + CHECKSUM or file.read() != digest.digest():
            raise Damaged("is damaged: its checksum is wrong")
        file.seek(len(MAGIC))
        length = int.from_bytes(file.read(LENGTH), "little")
        if length > size:
            raise Damaged("is damaged: its header is longer than the file")
        text = file.read(length)
    try:
        header = json.loads(text)
        of = {group: dict(items) for group, items in header["of"].items()}
        offset, arrays = len(MAGIC) + LENGTH + length, {}
        for name, dtype, shape in header["arrays"]:
            if min(shape, default=0) < 0:
                raise ValueError
            arrays[name] = Layout(dtype, tuple(shape), offset)
            offset += np.dtype(dtype).itemsize * int(np.prod(shape, dtype=object))
    except (
        ValueError,
        TypeError,
        KeyError,
        AttributeError,
        RecursionError,
        SyntaxError,  # raised by NumPy for text that is not a type
        OverflowError,
    ):
        raise Damaged("is damaged: its header makes no sense") from None
    if offset + CHECKSUM != size:
        raise Damaged("is damaged: its arrays do not fill it")
    return Stored(path, of, arrays)


def _bytes_of(array: NDArray[Any]) -> memoryview:
    """Return the memory of an array, which must be contiguous."""
    flat: Any = array.reshape(-1).view(np.uint8)
    return memoryview(flat)


def _fill(file: BinaryIO, array: NDArray[Any]) -> None:
    target = _bytes_of(array)
    while len(target):
        count = file.readinto(target)  # type: ignore[attr-defined]
        if not count:
            raise OSError("it has become shorter while it was read")
        target = target[count:]


def _blocks(file: BinaryIO, size: int) -> Iterator[bytes]:
    while size > 0:
        block = file.read(min(BLOCK, size))
        if not block:
            return
        size -= len(block)
        yield block


def _reason(error: Exception) -> str:
    if isinstance(error, OSError):
        return f"cannot be read: {error.strerror or error}"
    return str(error)
