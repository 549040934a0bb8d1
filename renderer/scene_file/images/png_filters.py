"""Kernel that reverses the row filters of PNG."""

from __future__ import annotations

import numpy as np

from renderer.kernels.jit import entry_kernel


@entry_kernel
def undo_filters(rows, values, step):  # type: ignore[no-untyped-def]
    """Fill `values`, preceded by a row and a pixel of zeros, from filtered `rows`.

    Each byte is predicted from its neighbours a (left), b (above), c (above left).
    """
    for y in range(rows.shape[0]):
        method = rows[y, 0]
        for x in range(rows.shape[1] - 1):
            a = np.int32(values[y + 1, x])
            b = np.int32(values[y, x + step])
            c = np.int32(values[y, x])
            if method == 0:
                predicted = np.int32(0)
            elif method == 1:
                predicted = a
            elif method == 2:
                predicted = b
            elif method == 3:
                predicted = (a + b) >> 1
            else:  # Paeth: whichever neighbour is nearest to a + b - c
                to_a, to_b, to_c = abs(b - c), abs(a - c), abs(a + b - 2 * c)
                if to_a <= to_b and to_a <= to_c:
                    predicted = a
                elif to_b <= to_c:
                    predicted = b
                else:
                    predicted = c
            values[y + 1, x + step] = np.uint8((np.int32(rows[y, x + 1]) + predicted) & 255)
