"""The text at the top of a PLY file: which elements follow, in which form."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from renderer.errors import SceneError

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
    """A scalar, or a list with its length in front."""

    name: str
    type: str  # NumPy code, "f4"
    count_type: str = ""  # of a list's length; empty for a scalar


@dataclass(frozen=True)
class Element:
    """`count` records with the same properties."""

    name: str
    count: int
    properties: list[Property] = field(default_factory=list)


@dataclass(frozen=True)
class PlyHeader:
    """What the header says, and where it ends."""

    byte_order: str  # "<" or ">"; empty for ascii
    elements: list[Element]
    size: int  # [bytes]
    line_count: int  # the data's first line has this number plus 1


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
    # isdecimal alone would admit digits of other scripts.
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
