"""Sorting and the median, for builders: in place, without allocation."""

from __future__ import annotations

from renderer.kernels.jit import kernel


@kernel
def sort_few(values, count):
    """Sort the first `count` values, up to a few hundred, by Shell's method."""
    gap = 1
    while gap < count // 3:
        gap = 3 * gap + 1
    while gap > 0:
        for i in range(gap, count):
            value = values[i]
            j = i
            while j >= gap and values[j - gap] > value:
                values[j] = values[j - gap]
                j -= gap
            values[j] = value
        gap //= 3


@kernel
def median_of(values, count):
    """Return the value that comes `count // 2`th in order; others change places.

    Hoare's quickselect. It stops at equal values, so that many of them are halved.
    """
    middle = count // 2
    low, high = 0, count - 1
    while low < high:
        pivot = values[(low + high) // 2]
        i, j = low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while values[j] > pivot:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            break
    return values[middle]
