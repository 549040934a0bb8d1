"""OBJ files a block at a time: all lines of a kind together, by NumPy.

`obj_file` reads line by line, and says what is wrong with a file. What is read here is what
nearly all files are made of: plain numbers, as many on each line of a kind, and corners of
one form with indices from 1. For anything else the answer is None.
"""

from __future__ import annotations

import warnings
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]
Integers = NDArray[np.int64]

WIDTHS = {"v": 3, "vt": 2, "vn": 3}  # numbers that count on each line
KINDS = (*WIDTHS, "f")
_LARGEST = 2**62
_MOST_RUNS = 20_000  # of lines of one kind; each is a slice
_NEWLINE, _SLASH, _MINUS, _TAB, _LAST_BLANK = b"\n/-\t\r"
_SPACE, _DELETE = 32, 127


class Blocks(NamedTuple):
    """The numbers of a file."""

    v: NDArray[np.float64]  # (n, 3)
    vt: NDArray[np.float64]  # (n, 2)
    vn: NDArray[np.float64]  # (n, 3)
    lines: list[Integers]  # of each row of v, vt, vn, from 1
    corners: Integers  # (corners, 3) indices of v, vt, vn from 1; 0: none given
    face_sizes: Integers  # corners of each face
    other: Integers  # lines of other kinds, from 1
    starts: Integers  # where each line begins


def read_blocks(content: bytes, *, face_normals: bool) -> Blocks | None:
    """Return the numbers of a file; None if it has to be read line by line.

    Parameters
    ----------
    content
        The file.
    face_normals
        Whether the lines of normals are not to be read.
    """
    if b"\\" in content:  # may join lines
        return None
    text = np.frombuffer(content, np.uint8)
    ends = np.append(np.flatnonzero(text == _NEWLINE), len(text))
    starts = np.append(0, ends[:-1] + 1)
    kind = _kind_of_lines(text, starts)
    tables, lines_of = [], []
    for number, (name, width) in enumerate(WIDTHS.items()):
        lines = np.flatnonzero(kind == number)
        lines_of.append(lines + 1)
        if name == "vn" and face_normals:
            tables.append(np.zeros((len(lines), 3)))
            continue
        block = _block(content, starts, ends, lines, len(name))
        rows = None if block is None else _rows(block, len(lines), width)
        if rows is None:
            return None
        tables.append(rows)
    lines = np.flatnonzero(kind == KINDS.index("f"))
    block = _block(content, starts, ends, lines, 1)
    faces = None if block is None else _corners(block)
    if faces is None:
        return None
    v, vt, vn = tables
    corners, sizes = faces
    counts = np.array([len(v), len(vt), len(vn) if not face_normals else 2**62])
    if (corners > counts).any() or (corners < [1, 0, 0]).any():
        return None
    other = np.flatnonzero(kind == len(KINDS)) + 1
    return Blocks(v, vt, vn, lines_of, corners, sizes, other, starts)


def _kind_of_lines(text: Bytes, starts: Integers) -> NDArray[np.uint8]:
    """Return of each line its place in `KINDS`; of others as many as there are kinds."""
    padded = np.append(text, np.full(3, _SPACE, np.uint8))
    one, two, three = (padded[starts + k] for k in range(3))
    blank_two, blank_three = two <= _SPACE, three <= _SPACE
    kind = np.full(len(starts), len(KINDS), np.uint8)
    for number, name in enumerate(KINDS):
        if len(name) == 1:
            kind[(one == ord(name)) & blank_two] = number
        else:
            kind[(one == ord(name[0])) & (two == ord(name[1])) & blank_three] = number
    return kind


def _block(
    content: bytes, starts: Integers, ends: Integers, lines: Integers, word: int
) -> Bytes | None:
    """Return all lines of a kind, each without its word and with a newline behind it."""
    if len(lines) == 0:
        return np.zeros(0, np.uint8)
    first = np.flatnonzero(np.diff(lines, prepend=-2) != 1)  # of each run of lines
    if len(first) > _MOST_RUNS:
        return None
    last = np.append(first[1:], len(lines)) - 1
    runs = zip(starts[lines[first]].tolist(), ends[lines[last]].tolist(), strict=True)
    block = np.frombuffer(
        bytearray(b"\n".join([content[a:b] for a, b in runs]) + b"\n"), np.uint8
    )
    begin = np.append(0, np.flatnonzero(block == _NEWLINE)[:-1] + 1)
    for k in range(word):
        block[begin + k] = _SPACE
    strange = (
        (block > _DELETE) | (block < _TAB) | ((block > _LAST_BLANK) & (block < _SPACE))
    )
    return None if strange.any() else block


def _words(block: Bytes) -> Integers:
    """Return where the words of a block begin."""
    blank = block <= _SPACE
    begins = ~blank
    begins[1:] &= blank[:-1]
    return np.flatnonzero(begins)


def _parsed(block: Bytes, kind: type) -> NDArray[Any] | None:
    """Return all numbers of a block; None if anything in it is none."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # unmatched data
        try:
            return np.fromstring(block.tobytes().decode("ascii"), kind, sep=" ")
        except (DeprecationWarning, ValueError):
            return None


def _rows(block: Bytes, lines: int, width: int) -> NDArray[np.float64] | None:
    """Return the first `width` numbers of each line; None if lines differ in length."""
    if lines == 0:
        return np.zeros((0, width))
    words = _words(block)
    each, rest = divmod(len(words), lines)
    if rest or each < width:
        return None
    ends = np.flatnonzero(block == _NEWLINE)
    first, last = words[::each], words[each - 1 :: each]
    if (last > ends).any() or (first[1:] < ends[:-1]).any():
        return None
    values = _parsed(block, np.float64)
    if values is None or len(values) != len(words):
        return None
    return values.reshape(lines, each)[:, :width].copy()


def _corners(block: Bytes) -> tuple[Integers, Integers] | None:
    """Return the corners (n, 3) of all faces, and how many each face has."""
    words = _words(block)
    ends = np.flatnonzero(block == _NEWLINE)
    sizes = np.diff(np.searchsorted(words, ends), prepend=0)
    if len(sizes) == 0 or sizes.min() < 3 or (block == _MINUS).any():
        return None
    slash = block == _SLASH
    if not slash.any():
        columns = [0]
    else:
        # the form of the first corner is that of all, or a count below is another one
        after = slash[1:] & slash[:-1]
        each, rest = divmod(int(slash.sum()), len(words))
        if rest or (slash[words]).any() or (slash[:-1] & (block[1:] <= _SPACE)).any():
            return None
        per_word = np.diff(
            np.append(np.searchsorted(np.flatnonzero(slash), words), slash.sum())
        )
        if (per_word != each).any():
            return None
        double = int(after.sum())
        if each == 1:
            columns = [0, 1]
        elif each == 2 and double == 0:
            columns = [0, 1, 2]
        elif each == 2 and double == len(words):
            columns = [0, 2]
        else:
            return None
        block[slash] = _SPACE
    values = _parsed(block, np.int64)
    if values is None or len(values) != len(words) * len(columns):
        return None
    corners = np.zeros((len(words), 3), np.int64)
    corners[:, columns] = values.reshape(-1, len(columns))
    return corners, sizes


def distinct(corners: Integers) -> tuple[Integers, Integers]:
    """Merge equal corners into vertices, in the order in which they come first.

    Returns
    -------
    keys
        (V, 3) the distinct corners.
    vertex
        (corners,) the vertex of each.
    """
    v, vt, vn = corners.T
    key, size = v, int(v.max()) + 1
    for column in (vt, vn):
        if not column.any() or np.array_equal(column, v):
            continue  # it distinguishes nothing
        most = int(column.max()) + 1
        if size * most > _LARGEST:
            key = np.unique(key, return_inverse=True)[1]
            size = len(key)
        key, size = key * most + column, size * most
    if size <= 4 * len(corners) + 1024:
        # the corner that is written last, and so the first in the file
        first = np.full(size, -1)
        first[key[::-1]] = np.arange(len(key))[::-1]
        used = first[first >= 0]
        order = np.sort(used)
        number = np.empty(len(key), np.int64)
        number[order] = np.arange(len(order))
        return corners[order], number[first[key]]
    _, first, vertex = np.unique(key, return_index=True, return_inverse=True)
    rank = np.argsort(first)
    number = np.empty(len(rank), np.int64)
    number[rank] = np.arange(len(rank))
    return corners[first[rank]], number[vertex]
