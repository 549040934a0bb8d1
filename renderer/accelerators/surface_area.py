"""Surface area of boxes: rays hit a convex body in proportion to its surface area."""

from __future__ import annotations

import numpy as np

from renderer.kernels.jit import kernel


@kernel
def half_area(box):
    """Return half the surface area of a box, in float64, which does not overflow.

    A box is its lower corner, then its upper one.
    """
    a = np.float64(box[3]) - np.float64(box[0])
    b = np.float64(box[4]) - np.float64(box[1])
    c = np.float64(box[5]) - np.float64(box[2])
    return a * b + b * c + c * a
