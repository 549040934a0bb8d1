"""Kernels that parse OBJ files: the kinds of lines, and their numbers.

Text is an array of bytes. Unusual syntax is left to Python.
"""

from __future__ import annotations

import numpy as np

from renderer.kernels.jit import entry_kernel, kernel

# columns of `counts`: lines, v, vt, vn, f, other lines, corners
_LINES, _FACES, _OTHERS, _CORNERS = 0, 4, 5, 6
_NEWLINE, _HASH, _SLASH, _POINT, _PLUS, _MINUS, _ZERO = b"\n#/.+-0"
_F, _N, _T, _V, _E, _SMALL_E = b"fntvEe"
# Kinds of lines: parsed here; with numbers for Python to parse; not supported here.
PLAIN, _HARD, UNUSUAL = range(3)
_LONGEST = 64
_NOTHING = 5
LARGEST = 2**31 - 1
_POWERS = np.array([10.0**k for k in range(23)])  # exact in double precision
_NAN = np.nan


@entry_kernel
def number_corners(corners, newest, following, keys, vertex):
    """Write the vertex of each corner; return the number of vertices.

    Corners with the same v form a chain, newest first. Returns -1 if a chain is longer than
    `_LONGEST`, since the time grows with the square of its length.
    """
    count = 0
    for k in range(corners.shape[1]):
        v, vt, vn = corners[0, k], corners[1, k], corners[2, k]
        same = newest[v]
        passed = 0
        while same >= 0 and (keys[same, 1] != vt or keys[same, 2] != vn):
            same = following[same]
            passed += 1
        if passed > _LONGEST:
            return -1
        if same < 0:
            same = np.int32(count)
            keys[count, 0], keys[count, 1], keys[count, 2] = v, vt, vn
            following[count] = newest[v]
            newest[v] = same
            count += 1
        vertex[k] = same
    return count


@entry_kernel
def count_lines(text, begin, end, counts):
    """Count the lines that begin in a block, by kind."""
    at = _first_line(text, begin)
    end = min(end, text.shape[0])
    while at < end:
        kind, word_end = _kind_of_line(text, at)
        counts[_LINES] += 1
        if kind != _NOTHING:
            counts[1 + kind] += 1
        if 1 + kind == _FACES:
            at = _next_word(text, word_end)
            while not _ends_line(text, at):
                counts[_CORNERS] += 1
                at = _next_word(text, _end_of_word(text, at))
        at = _next_line(text, at)


@entry_kernel
def read_lines(
    text, begin, end, before, most, with_normals, v, vt, vn, begins, corners, sizes, other
):
    """Write the numbers of the lines that begin in a block; return whether all were plain.

    `before` has the counts of the previous blocks.
    """
    line, i, j, k, face, others, corner = before
    at = _first_line(text, begin)
    end = min(end, text.shape[0])
    state = PLAIN
    while at < end and state != UNUSUAL:
        kind, word_end = _kind_of_line(text, at)
        line += 1
        found = PLAIN
        if kind == 0:
            begins[0][i] = at
            at, found = _read_row(text, word_end, v[i])
            i += 1
        elif kind == 1:
            begins[1][j] = at
            at, found = _read_row(text, word_end, vt[j])
            j += 1
        elif kind == 2:
            begins[2][k] = at
            if with_normals:
                at, found = _read_row(text, word_end, vn[k])
            k += 1
        elif kind == 3:
            first = corner
            at = _next_word(text, word_end)
            while not _ends_line(text, at) and found == PLAIN:
                at, found = _read_corner(text, at, most, corners, corner)
                corner += 1
                at = _next_word(text, at)
            sizes[face] = corner - first
            face += 1
            if corner - first < 3:
                found = UNUSUAL
        elif kind != _NOTHING:
            other[others, 0], other[others, 1] = line, at
            others += 1
        state = max(state, found)
        at = _next_line(text, at)
    return state


@kernel
def _read_corner(text, at, most, corners, corner):
    """Write the indices of `v`, `v/vt`, `v//vn` or `v/vt/vn`; return the end position."""
    part = index = 0
    while True:
        over = _ends_word(text, at)
        if over or text[at] == _SLASH:
            corners[part, corner] = index
            if index > most[part] or (over and corners[0, corner] == 0):
                return at, UNUSUAL
            if over:
                return at, PLAIN
            part, index = part + 1, 0
        else:
            digit = np.int64(text[at]) - _ZERO
            index = 10 * index + digit
            if digit < 0 or digit > 9 or index > LARGEST:
                return at, UNUSUAL
        if part > 2:
            return at, UNUSUAL
        at += 1


@kernel
def _read_row(text, at, row):
    """Write the numbers of a row; return the end position and the kind of the line."""
    state = PLAIN
    for j in range(row.shape[0]):
        at = _next_word(text, at)
        if _ends_line(text, at):
            return at, UNUSUAL
        value, at = _number(text, at)
        row[j] = value
        if value != value:
            state = _HARD
    return at, state


@kernel
def _number(text, at):
    """Return a number, correctly rounded, or NaN for Python to parse; and its end."""
    negative = text[at] == _MINUS
    if negative or text[at] == _PLUS:
        at += 1
    mantissa = np.int64(0)
    digits = power = after = 0
    plain = True
    while not _ends_word(text, at):
        digit = np.int64(text[at]) - _ZERO
        if 0 <= digit <= 9:
            plain &= mantissa < 10**17
            mantissa = 10 * mantissa + digit
            digits += 1
            power -= after
        elif text[at] == _POINT and after == 0:
            after = 1
        else:
            break
        at += 1
    plain &= digits > 0
    if not _ends_word(text, at) and (text[at] == _E or text[at] == _SMALL_E):
        at += 1
        sign = 1
        if not _ends_word(text, at) and (text[at] == _MINUS or text[at] == _PLUS):
            sign = -1 if text[at] == _MINUS else 1
            at += 1
        plain &= not _ends_word(text, at)
        exponent = 0
        while not _ends_word(text, at) and exponent < 1000:
            digit = np.int64(text[at]) - _ZERO
            plain &= 0 <= digit <= 9
            exponent = 10 * exponent + digit
            at += 1
        power += sign * exponent
    plain &= _ends_word(text, at)
    value = _scaled(mantissa, power) if plain else _NAN
    return -value if negative else value, _end_of_word(text, at)


@kernel
def _scaled(mantissa, power):
    """Return mantissa 10^power for mantissas below 10^18, rounded once; NaN if uncertain.

    Below 2^53 it is one exact product or quotient [Clinger1990]. Others are a sum of two
    numbers. The remainder of the division is exact. If the sums with a slightly larger and
    a slightly smaller second number differ, the rounding is uncertain.
    """
    if mantissa == 0:
        return 0.0
    if abs(power) > 22:
        return _NAN
    scale = _POWERS[abs(power)]
    high = np.float64(mantissa)
    low = np.float64(mantissa - np.int64(high))
    if power < 0:
        value = high / scale
        product, error = _exact_product(value, scale)
        rest = (((high - product) - error) + low) / scale
    else:
        value, error = _exact_product(high, scale)
        rest = error + low * scale
    if low == 0.0:
        return value
    doubt = value * 2.0**-100
    less, more = value + (rest - doubt), value + (rest + doubt)
    return less if less == more else _NAN


@kernel
def _exact_product(a, b):
    """Return a product and its rounding error [Dekker1971]."""
    product = a * b
    split = a * 134217729.0  # 2^27 + 1
    a_high = split - (split - a)
    split = b * 134217729.0
    b_high = split - (split - b)
    a_low, b_low = a - a_high, b - b_high
    error = ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low
    return product, error


# -------------------------------------------------------------------------- lines, words


@kernel
def _first_line(text, begin):
    """Return the start of the first line that begins in a block."""
    return begin if begin == 0 else _next_line(text, begin - 1)


@kernel
def _next_line(text, at):
    while at < text.shape[0] and text[at] != _NEWLINE:
        at += 1
    return at + 1


@kernel
def _kind_of_line(text, at):
    """Return the index of the first word of a line in `KINDS`, 4 for others; and its end.

    Empty lines and comments have the kind `_NOTHING`.
    """
    if text[at] == _F and _is_blank(text, at + 1):
        return 3, at + 1
    if text[at] == _V:
        if _is_blank(text, at + 1):
            return 0, at + 1
        if _is_blank(text, at + 2):
            if text[at + 1] == _T:
                return 1, at + 2
            if text[at + 1] == _N:
                return 2, at + 2
    begins = text[at] == 13 and at + 1 < text.shape[0]  # a carriage return
    first = text[at + 1] if begins else text[at]
    return (_NOTHING if first == _NEWLINE or first == _HASH else 4), at


@kernel
def _is_blank(text, at):
    """Return whether a byte is white space; control characters are not."""
    return at >= text.shape[0] or text[at] == 32 or 9 <= text[at] <= 13


@kernel
def _ends_line(text, at):
    return at >= text.shape[0] or text[at] == _NEWLINE or text[at] == _HASH


@kernel
def _ends_word(text, at):
    return _is_blank(text, at) or text[at] == _HASH


@kernel
def _end_of_word(text, at):
    while not _ends_word(text, at):
        at += 1
    return at


@kernel
def _next_word(text, at):
    """Return the start of the next word, or the end of the line."""
    while _is_blank(text, at) and not _ends_line(text, at):
        at += 1
    return at
