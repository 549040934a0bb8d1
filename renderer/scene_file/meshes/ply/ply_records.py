"""The records after a PLY header, as columns of numbers: binary and ascii.

Both readers take an element as a table with one row a record. That needs every record to
have the same size, so the lists of one property must share one length, which is the case
for the triangles of a mesh. The length is read from the first record, then checked.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.scene_file.meshes.ply.ply_header import Element, PlyHeader, Property

# The records of one element: property name -> (N,), of a list (N, length).
Columns = dict[str, NDArray[np.float64]]


def read_records(content: bytes, header: PlyHeader, path: Path) -> dict[str, Columns]:
    """Return the columns of each element of the file, by element name.

    Raises
    ------
    SceneError
        The data ends early or does not end, is no number, or a list changes its length.
    """
    return (_read_binary if header.byte_order else _read_ascii)(content, header, path)


# ------------------------------------------------------------------------- binary


def _read_binary(content: bytes, header: PlyHeader, path: Path) -> dict[str, Columns]:
    columns: dict[str, Columns] = {}
    position = header.size
    for element in header.elements:
        record = _record_type(content, position, element, header.byte_order, path)
        size = element.count * record.itemsize
        if position + size > len(content):
            raise _truncated(path, element, size, len(content) - position, "bytes")
        columns[element.name] = {}
        if size == 0:
            continue
        rows = np.frombuffer(content, record, element.count, offset=position)
        position += size
        for p in element.properties:
            column = rows[p.name]
            if p.count_type:
                wrong = np.flatnonzero(rows[_length_of(p)] != column.shape[1])
                if len(wrong):
                    length = int(rows[_length_of(p)][wrong[0]])
                    raise _other_length(f"{path}", element, p, int(wrong[0]), length)
            # A double far beyond float32 stays as it is: the mesh reader reports it, and
            # NaNs, of which the cast would warn where they are signalling ones.
            with np.errstate(invalid="ignore"):
                columns[element.name][p.name] = column.astype(np.float64)
    if position != len(content):
        raise SceneError(
            f"{path}: {len(content) - position} bytes are left over after the last "
            "record; the counts in the header do not fit"
        )
    return columns


def _record_type(
    content: bytes, position: int, element: Element, byte_order: str, path: Path
) -> np.dtype[np.void]:
    """Return the layout of one record; the first one, at `position`, has the lengths."""
    fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
    for p in element.properties:
        scalar = np.dtype(byte_order + p.type)
        if not p.count_type:
            fields.append((p.name, scalar.str))
            position += scalar.itemsize
            continue
        counter = np.dtype(byte_order + p.count_type)
        length = 0
        if element.count:
            if position + counter.itemsize > len(content):
                found = max(len(content) - position, 0)
                raise _truncated(path, element, counter.itemsize, found, "bytes")
            length = int(np.frombuffer(content, counter, 1, offset=position)[0])
            position += counter.itemsize
            _check_length(length, (len(content) - position) // scalar.itemsize, p, path)
            position += length * scalar.itemsize
        fields.append((_length_of(p), counter.str))
        fields.append((p.name, scalar.str, (length,)))
    return np.dtype(fields)


def _length_of(p: Property) -> str:
    """Name the field with the length of a list; no property name holds a space."""
    return f"length of {p.name}"


# -------------------------------------------------------------------------- ascii


def _read_ascii(content: bytes, header: PlyHeader, path: Path) -> dict[str, Columns]:
    words = content[header.size :].split()
    try:
        if b"_" in content[header.size :]:  # Python's 1_0 is 10
            raise ValueError
        values = np.fromiter(map(float, words), np.float64, len(words))
    except ValueError:
        index = next(i for i, word in enumerate(words) if not _is_number(word))
        raise SceneError(
            f"{_place(content, header, path, index)}: expected a number, found "
            f"`{words[index][:40].decode('latin-1')}`"
        ) from None
    columns: dict[str, Columns] = {}
    position = 0
    for element in header.elements:
        lengths = _ascii_lengths(values, position, element, path)
        width = len(element.properties) + sum(lengths.values())
        size = element.count * width
        if position + size > len(values):
            raise _truncated(path, element, size, len(values) - position, "numbers")
        columns[element.name] = {}
        if size == 0:
            continue
        table = values[position : position + size].reshape(element.count, width)
        start = 0
        for p in element.properties:
            if p.count_type:
                wrong = np.flatnonzero(table[:, start] != lengths[p.name])
                if len(wrong):
                    record = int(wrong[0])
                    where = _place(content, header, path, position + record * width)
                    raise _other_length(where, element, p, record, table[record, start])
                columns[element.name][p.name] = table[
                    :, start + 1 : start + 1 + lengths[p.name]
                ]
                start += lengths[p.name]
            else:
                columns[element.name][p.name] = table[:, start]
            start += 1
        position += size
    if position != len(values):
        raise SceneError(
            f"{_place(content, header, path, position)}: {len(values) - position} numbers "
            "are left over after the last record; the counts in the header do not fit"
        )
    return columns


def _ascii_lengths(
    values: NDArray[np.float64], position: int, element: Element, path: Path
) -> dict[str, int]:
    """Return the list lengths of the first record, which starts at `position`."""
    lengths: dict[str, int] = {}
    for p in element.properties:
        if p.count_type:
            lengths[p.name] = 0
            if element.count:
                if position >= len(values):
                    raise _truncated(path, element, 1, 0, "numbers")
                length = float(values[position])
                _check_length(length, len(values) - position - 1, p, path)
                lengths[p.name] = int(length)
                position += int(length)
        position += 1
    return lengths


def _place(content: bytes, header: PlyHeader, path: Path, index: int) -> str:
    """Return `file:line` of the word with this index, counted from the header on."""
    lines = content[header.size :].split(b"\n")
    for number, line in enumerate(lines, start=header.line_count + 1):
        index -= len(line.split())
        if index < 0:
            return f"{path}:{number}"
    return str(path)


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return b"_" not in word


# ------------------------------------------------------------------------- errors


def _check_length(length: float, available: int, p: Property, path: Path) -> None:
    """Refuse a first list that cannot be in the file, before anything is allocated."""
    if not (0 <= length <= available and length == int(length)):
        raise SceneError(
            f"{path}: the first list `{p.name}` has length {length:g}, but only "
            f"{max(available, 0)} values follow; the file is truncated or its header wrong"
        )


def _truncated(
    path: Path, element: Element, expected: int, found: int, unit: str
) -> SceneError:
    return SceneError(
        f"{path}: the file is truncated: {element.count} records of `{element.name}` take "
        f"{expected} {unit}, found {found}"
    )


def _other_length(
    where: str, element: Element, p: Property, record: int, length: float
) -> SceneError:
    return SceneError(
        f"{where}: list `{p.name}` of {element.name} {record} has length {length:g}, "
        "others not; only triangles, and lists of one length, are possible"
    )
