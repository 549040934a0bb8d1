"""The digits of the points behind the sampler `sobol`: matrices modulo 2, as tables.

A point has eight coordinates, four pairs. Each pair is a point of the same net of two
dimensions, at an index that the pair's matrix makes of the sample's index. So every pair is
a (0, m, 2)-net. The matrices were found by a random search with small steps, such that the
first two pairs are a good net of four dimensions, and some sets of two and three
coordinates are good nets: the cost was the share of boxes of volume 2^-m, 2^-(m-1) and
2^-(m-2) that are not hit evenly.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

DIGITS = 32

# Columns of the matrices of the second to the fourth pair; the lowest row is the lowest
# bit. The search looked at the first twelve of the sequence; chance made the others.
_SEQUENCE = (
    "1 3 4 d 1b 29 41 91 194 272 646 e08 1d9c 3461 60b6 a288 14ecd 214fa 44d0b 821d9 "
    "12cde5 3a064f 699007 f4d52c 180edb2 33698f6 7e20a69 dd6024a 1a1dc7fb 3165603c "
    "63d5affb f7b07403",
    "1 2 6 c 10 3a 46 85 1c6 3d1 565 d62 1792 3060 7054 f9a8 108ec 249cf 74ab1 f96d5 "
    "13fcd7 29fa85 779e1c b62f8f 145ee6d 3a7c8a2 50728eb b460a32 1a4d1fa2 31964580 "
    "457cc098 83870e99",
    "1 3 4 b 16 35 5f a2 110 376 5eb f72 1d66 285f 46fe a634 169ef 3a0e2 5ce19 8bc3e "
    "155bae 333406 740b4b dd4178 1fe2bfb 2603491 7855a7a 870f0b7 18ee7e46 28cc8c8f "
    "4ce2f272 d426c3d9",
)
_NETS = {
    1: (
        "1",
        "1",
        "1",
    ),
    2: (
        "2 1",
        "1 3",
        "3 1",
    ),
    3: (
        "6 2 5",
        "4 2 3",
        "5 2 6",
    ),
    4: (
        "e 3 7 c",
        "c f 6 8",
        "4 d a 2",
    ),
    5: (
        "13 f 18 1 11",
        "a 4 1b 1a 2",
        "15 e 1d b 17",
    ),
    6: (
        "31 5 27 d 3e 18",
        "32 b 25 5 a 3e",
        "1a 3d c 20 3 3b",
    ),
    7: (
        "40 65 37 56 4f 26 9",
        "60 5a 48 65 56 58 78",
        "4f 64 35 74 7 3a 52",
    ),
    8: (
        "8e c1 3e cc 5b fa da 21",
        "a7 4f ca 20 dd 38 6a d9",
        "ca 2c 85 5f d4 b2 2 2d",
    ),
    9: (
        "1a6 a4 77 155 11f e 18b 144 27",
        "121 124 18d 113 1f0 1bd 1ce 191 166",
        "66 18e ef 1d3 48 109 ac 19c 1f5",
    ),
    10: (
        "16c 201 388 111 27 37c 2f4 1b3 33d 168",
        "c6 210 104 125 11f 1f9 cc 8d 63 3cc",
        "3a2 1d7 91 365 24a 167 34c 28e 24 75",
    ),
    11: (
        "755 5c1 4c1 5a 1fc 69e 21f 48e 789 2b7 6a0",
        "392 4 4e4 7fd 38e 493 351 321 684 288 bd",
        "369 10c 681 14c 3c0 7b6 5c2 23f 382 48b 169",
    ),
    12: (
        "ca9 964 1e0 6f4 ed3 36b 8ea 11a 7ad 9d5 56c 740",
        "ffb 4b3 619 4fe 4f0 c8c a39 4f8 9ff 30b dd6 1aa",
        "4dc 889 30e ef5 677 9fa e70 10e 741 b1c 75a 34a",
    ),
}


@functools.cache
def net_digits(bits: int) -> NDArray[np.uint32] | None:
    """Return which digits each bit of an index flips, in a net of 2^bits points.

    The net of [Larcher2003]: the index itself, from its highest bit down, and what a
    triangle of ones makes of its bits. Its points keep away from one another.

    Returns
    -------
    ndarray of shape (8, DIGITS) or None
        By coordinate and bit; the first digit behind the point is the lowest bit. None
        where no matrices are known.
    """
    if bits not in _NETS:
        return None

    def first(point: int) -> int:
        return int(f"{point:0{bits}b}"[::-1], 2)

    def second(point: int) -> int:
        return functools.reduce(int.__xor__, (point >> k for k in range(bits)))

    return _table([_powers(bits), *(_numbers(text) for text in _NETS[bits])], first, second)


@functools.cache
def sequence_digits() -> NDArray[np.uint32]:
    """Return the same for any number of points: the sequence of [Sobol1967].

    Its first coordinate is the index read backwards; the matrix of the second is Pascal's
    triangle. The matrices of the pairs are triangular, so that the first 2^m points stay
    the first 2^m; where the search ended, their columns are as good as random.
    """

    def second(point: int) -> int:
        digits = 0
        for k in range(DIGITS):
            if point >> k & 1:  # C(k, r) is odd where r has no bit that k lacks
                digits ^= sum(1 << r for r in range(k + 1) if r & ~k == 0)
        return digits

    pairs = [_powers(DIGITS), *(_numbers(text) for text in _SEQUENCE)]
    return _table(pairs, lambda point: point, second)


def _powers(count: int) -> list[int]:
    return [1 << k for k in range(count)]


def _numbers(text: str) -> list[int]:
    return [int(column, 16) for column in text.split()]


def _table(
    pairs: list[list[int]], first: Callable[[int], int], second: Callable[[int], int]
) -> NDArray[np.uint32]:
    table = np.zeros((8, DIGITS), np.uint32)
    for pair, columns in enumerate(pairs):
        for bit, point in enumerate(columns):
            table[2 * pair : 2 * pair + 2, bit] = first(point), second(point)
    return table
