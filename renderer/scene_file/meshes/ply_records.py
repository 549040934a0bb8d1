"""PLY headers, and the records that they declare, binary or ASCII."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.scene_file.meshes.mesh_data import is_number

# --------------------------------------------------------------------------- ply header
# The text at the start of a PLY file, with elements and format.

# Names of scalar types, old and new, as NumPy type codes without byte order.
SCALAR_TYPES = {
    "char": "i1",
    "int8": "i1",
    "uchar": "u1",
    "uint8": "u1",
    "short": "i2",
    "int16": "i2",
    "ushort": "u2",
    "uint16": "u2",
    "int": "i4",
    "int32": "i4",
    "uint": "u4",
    "uint32": "u4",
    "float": "f4",
    "float32": "f4",
    "double": "f8",
    "float64": "f8",
}
_BYTE_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_LONGEST_HEADER = 1 << 16  # [bytes]; a file without `end_header` is not searched further


@dataclass(frozen=True)
class Property:
    """A scalar, or a list preceded by its length."""

    name: str
    type: str  # NumPy code, "f4"
    count_type: str = ""  # type of a list's length; empty for a scalar


@dataclass(frozen=True)
class Element:
    """A number of records (`count`) with the same properties."""

    name: str
    count: int
    properties: list[Property] = field(default_factory=list)


@dataclass(frozen=True)
class PlyHeader:
    """The contents of the header, and its size."""

    byte_order: str  # "<" or ">"; empty for ASCII
    elements: list[Element]
    size: int  # [bytes]
    line_count: int  # the data begin on the line with this number plus 1


def parse_ply_header(content: bytes, path: Path) -> PlyHeader:
    """Read the header at the start of `content`, or raise SceneError with file and line."""
    if content[:4] not in (b"ply\n", b"ply\r"):
        raise SceneError(f"{path}:1: not a PLY file: its first line is not `ply`")
    byte_order: str | None = None
    elements: list[Element] = []
    position = 0
    number = 0
    while True:
        end = content.find(b"\n", position, _LONGEST_HEADER)
        if end < 0:
            raise SceneError(f"{path}: the PLY header has no `end_header` line")
        words = content[position:end].decode("latin-1").split()
        position = end + 1
        number += 1
        where = f"{path}:{number}"
        keyword = words[0] if words else ""
        if keyword in ("", "comment", "obj_info") or number == 1:
            continue
        if keyword == "end_header":
            break
        if keyword == "format":
            byte_order = _parse_format(words, where)
        elif keyword == "element":
            elements.append(_parse_element(words, where))
            if elements[-1].name in (element.name for element in elements[:-1]):
                raise SceneError(f"{where}: a second element `{elements[-1].name[:40]}`")
        elif keyword == "property":
            if not elements:
                raise SceneError(f"{where}: `property` before the first `element`")
            properties = elements[-1].properties
            properties.append(_parse_property(words, where))
            if properties[-1].name in (p.name for p in properties[:-1]):
                raise SceneError(f"{where}: a second property `{properties[-1].name[:40]}`")
        else:
            raise SceneError(
                f"{where}: unknown word `{keyword[:40]}` in the PLY header; possible: "
                "format, element, property, comment, obj_info, end_header"
            )
    if byte_order is None:
        raise SceneError(f"{path}: the PLY header has no `format` line")
    return PlyHeader(byte_order, elements, size=position, line_count=number)


def _parse_format(words: list[str], where: str) -> str:
    if len(words) != 3 or words[1] not in _BYTE_ORDERS or words[2] != "1.0":
        raise SceneError(
            f"{where}: unknown PLY format `{' '.join(words[1:])[:40]}`; possible: "
            + ", ".join(f"{name} 1.0" for name in _BYTE_ORDERS)
        )
    return _BYTE_ORDERS[words[1]]


def _parse_element(words: list[str], where: str) -> Element:
    # isdecimal alone would accept digits of other scripts.
    if len(words) != 3 or not (words[2].isascii() and words[2].isdecimal()):
        raise SceneError(f"{where}: expected `element NAME COUNT`, found `{_show(words)}`")
    if len(words[2]) > 18:
        raise SceneError(f"{where}: {words[2][:40]} is no possible number of records")
    return Element(words[1], int(words[2]))


def _parse_property(words: list[str], where: str) -> Property:
    is_list = len(words) > 1 and words[1] == "list"
    if len(words) != (5 if is_list else 3):
        raise SceneError(
            f"{where}: expected `property TYPE NAME` or `property list TYPE TYPE NAME`, "
            f"found `{_show(words)}`"
        )
    for name in words[2:4] if is_list else words[1:2]:
        if name not in SCALAR_TYPES:
            raise SceneError(
                f"{where}: unknown PLY type `{name[:40]}`; possible: "
                + ", ".join(SCALAR_TYPES)
            )
    if not is_list:
        return Property(words[2], SCALAR_TYPES[words[1]])
    if SCALAR_TYPES[words[2]][0] == "f":
        raise SceneError(f"{where}: a list's length must be an integer, not {words[2]}")
    return Property(words[4], SCALAR_TYPES[words[3]], SCALAR_TYPES[words[2]])


def _show(words: list[str]) -> str:
    return " ".join(words)[:60]


# -------------------------------------------------------------------------- ply records
# The records after a PLY header, as columns of numbers, binary and ASCII.
#
# An element is read as a table with one row per record. So every record must have the same
# size, and all lists of a property the same length, as for the triangles of a mesh. The
# length is read from the first record, then checked.

# Records of one element: property name -> (N,) doubles, or for a list (N, length), in
# binary files of its own type.
Columns = dict[str, NDArray[Any]]


def read_records(content: bytes, header: PlyHeader, path: Path) -> dict[str, Columns]:
    """Return the columns of each element of the file, by element name.

    Raises
    ------
    SceneError
        If the data end early or late, a value is not a number, or a list changes its
        length.
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
            # A double beyond float32 is kept: the mesh reader reports it, and NaN, of which
            # the cast would warn if it is signalling.
            kind = p.type if p.count_type else "f8"
            with np.errstate(invalid="ignore"):
                columns[element.name][p.name] = column.astype(kind)
    if position != len(content):
        raise SceneError(
            f"{path}: {len(content) - position} bytes are left over after the last "
            "record; the counts in the header do not fit"
        )
    return columns


def _record_type(
    content: bytes, position: int, element: Element, byte_order: str, path: Path
) -> np.dtype[np.void]:
    """Return the layout of a record; its lengths are those of the one at `position`."""
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
    """Return the field name of a list's length; no property name contains a space."""
    return f"length of {p.name}"


# -------------------------------------------------------------------------- ascii


def _read_ascii(content: bytes, header: PlyHeader, path: Path) -> dict[str, Columns]:
    words = content[header.size :].split()
    try:
        if b"_" in content[header.size :]:  # Python would read 1_0 as 10
            raise ValueError
        values = np.fromiter(map(float, words), np.float64, len(words))
    except ValueError:
        index = next(i for i, word in enumerate(words) if not is_number(word))
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
    """Return `file:line` of the word with this index after the header."""
    lines = content[header.size :].split(b"\n")
    for number, line in enumerate(lines, start=header.line_count + 1):
        index -= len(line.split())
        if index < 0:
            return f"{path}:{number}"
    return str(path)


# ------------------------------------------------------------------------- errors


def _check_length(length: float, available: int, p: Property, path: Path) -> None:
    """Refuse a first list longer than the file, before memory is allocated."""
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
