"""Kernels for passes over the vertices and triangles of a mesh; each reads memory once.

Sums are in double precision and in NumPy's order.
"""

from __future__ import annotations

import numpy as np

from renderer.kernels.jit import entry_kernel, kernel


@entry_kernel
def place_vertices(begin, end, points, matrix, placed):
    """Write points under an affine transform, rounded as in `transforms.place_points`.

    Returns
    -------
    largest, error
        The largest absolute coordinate in double precision, and the largest difference of
        the rounded coordinates; infinite if one of them is NaN.
    """
    largest = error = 0.0
    for k in range(begin, end):
        for i in range(3):
            exact, rounded = matrix[i, 3], np.float32(matrix[i, 3])
            for j in range(3):
                exact += matrix[i, j] * points[k, j]
                single = np.float64(np.float32(matrix[i, j]))
                product = single * np.float64(np.float32(points[k, j]))
                rounded = np.float32(product + np.float64(rounded))
            placed[k, i] = rounded
            largest = _larger(abs(exact), largest)
            error = _larger(abs(np.float64(rounded) - exact), error)
    return largest, error


@kernel
def _larger(value, most):
    """Return the maximum; infinity if `value` is NaN."""
    return most if value <= most else (value if value > most else np.inf)


@entry_kernel
def mark_flat(begin, end, vertices, faces, part, least, flat):
    """Set `flat` where 2 area <= `part` longest edge^2, or 2 area < `least`."""
    for k in range(begin, end):
        a, b, c = faces[k, 0], faces[k, 1], faces[k, 2]
        side_b, side_c = _edge(vertices, a, b), _edge(vertices, a, c)
        x, y, z = _edge(vertices, b, c)
        longest = max(_squared(side_b), max(x * x + y * y + z * z, _squared(side_c)))
        twice_area = np.sqrt(_squared(_cross(side_b, side_c)))
        flat[k] = twice_area <= part * longest or twice_area < least


@entry_kernel
def measure_corners(begin, end, vertices, faces, normals, across, along):
    """Write unit normals of faces, and for each corner |difference| and |sum| of its sides.

    These are the squared lengths for sides of length 1. Half of the corner's angle is the
    arc tangent of the ratio of the lengths, which is accurate where arccos is not (Kahan).
    """
    for k in range(begin, end):
        a, b, c = faces[k, 0], faces[k, 1], faces[k, 2]
        n = _unit(_cross(_edge(vertices, a, b), _edge(vertices, a, c)))
        normals[k, 0], normals[k, 1], normals[k, 2] = n
        before, after = _unit(_edge(vertices, c, a)), _unit(_edge(vertices, a, b))
        for j in range(3):
            # the side before a corner points to the corner
            less = after[0] + before[0], after[1] + before[1], after[2] + before[2]
            more = after[0] - before[0], after[1] - before[1], after[2] - before[2]
            across[k, j] = _squared(less)
            along[k - begin, j] = _squared(more)
            a, b, c = b, c, a
            before, after = after, _unit(_edge(vertices, a, b))


@entry_kernel
def add_at_corners(corner, faces, normals, half_angles, sums):
    """Add the angle-weighted normals of faces to `sums` of the vertices at one corner."""
    for k in range(faces.shape[0]):
        vertex, angle = faces[k, corner], 2.0 * half_angles[k, corner]
        for j in range(3):
            sums[vertex, j] += normals[k, j] * angle


@entry_kernel
def unit_sums(begin, end, first, second, third, normals):
    """Write the direction of the sums over all corners; (1, 0, 0) where they are 0."""
    for k in range(begin, end):
        x = (first[k, 0] + second[k, 0]) + third[k, 0]
        y = (first[k, 1] + second[k, 1]) + third[k, 1]
        z = (first[k, 2] + second[k, 2]) + third[k, 2]
        length = np.sqrt(_squared((x, y, z)))
        if length == 0.0:
            x, y, z, length = 1.0, 0.0, 0.0, 1.0
        normals[k, 0], normals[k, 1], normals[k, 2] = x / length, y / length, z / length


@kernel
def _edge(vertices, a, b):
    return (
        np.float64(vertices[b, 0]) - np.float64(vertices[a, 0]),
        np.float64(vertices[b, 1]) - np.float64(vertices[a, 1]),
        np.float64(vertices[b, 2]) - np.float64(vertices[a, 2]),
    )


@kernel
def _cross(p, q):
    return p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]


@kernel
def _squared(p):
    return (p[0] * p[0] + p[1] * p[1]) + p[2] * p[2]


@kernel
def _unit(p):
    length = np.sqrt(_squared(p))
    return p[0] / length, p[1] / length, p[2] / length
