"""A ray and a box, and a ray's way through the cells of a grid."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.random import Generator

from renderer.exercises.exercise import (
    RIGHT,
    Case,
    Exercise,
    Functions,
    Variants,
    mistakes_of,
)
from renderer.exercises.pictures import BACKGROUND, scan, through
from renderer.exercises.vectors import INFINITY, Vector, vector

# ---------------------------------------------------------------------------------- box


def intersect_box(
    origin: Vector,
    direction: Vector,
    lower: Vector,
    upper: Vector,
    t_min: float,
    t_max: float,
    *,
    variants: Variants = RIGHT,
) -> tuple[float, float] | None:
    """Return the part of a ray that lies in a box.

    Parameters
    ----------
    origin, direction : ndarray of shape (3,)
        The ray x(t) = origin + t direction. The direction may have any length but 0, and
        any of its numbers may be 0 or -0.
    lower, upper : ndarray of shape (3,)
        The corners of the box, lower <= upper. A box may be flat.
    t_min, t_max : float
        The ends of the ray; t_max may be infinite.

    Returns
    -------
    tuple (t_enter, t_exit) or None
        The ray is in the box for t_enter <= t <= t_exit, within t_min to t_max. None if
        it is nowhere in the box.
    """
    enter, leave = t_min, t_max
    if "from-zero" in variants:
        enter = 0.0
    if "line" in variants or "inside-negative" in variants:
        enter = -INFINITY
    if "no-t-max" in variants:
        leave = INFINITY
    for axis in range(2 if "two-axes" in variants else 3):
        o, d = float(origin[axis]), float(direction[axis])
        if d == 0.0:
            if "division-raises" in variants:
                raise ZeroDivisionError
            if "minus-zero" in variants:  # -0 < 0 is false: the values stay exchanged
                with np.errstate(all="ignore"):
                    a = float((lower[axis] - o) / np.float64(d))
                    b = float((upper[axis] - o) / np.float64(d))
                enter, leave = max(enter, a), min(leave, b)
                continue
            outside = not lower[axis] <= o <= upper[axis]
            if "parallel-misses" in variants or (
                outside and "parallel-hits" not in variants
            ):
                return None
            continue
        a, b = (float(lower[axis]) - o) / d, (float(upper[axis]) - o) / d
        if "not-ordered" not in variants:
            a, b = min(a, b), max(a, b)
        if "any-slab" in variants:
            enter, leave = (a, b) if axis == 0 else (min(enter, a), max(leave, b))
        else:
            enter = a if "enter-replaced" in variants else max(enter, a)
            leave = b if "exit-replaced" in variants else min(leave, b)
    if "inside-negative" in variants and leave < t_min:
        return None
    missed = enter >= leave if "flat-missed" in variants else enter > leave
    return None if missed else (enter, leave)


def _box_cases(random: Generator) -> Iterator[Case]:
    lower, upper, far = vector(-1, -1, -1), vector(1, 1, 1), (0.0, INFINITY)
    slanted = vector(1, 0.2, 0.3)
    for about, origin, direction, limits in (
        ("a ray through the box", vector(-3, 0.1, 0.2), slanted, far),
        ("the same ray backwards", vector(3, 0.1, 0.2), -slanted, far),
        ("a ray that passes the box", vector(-3, 1.5, 0.2), slanted, far),
        ("a box behind the ray", vector(3, 0.1, 0.2), slanted, far),
        ("a ray from inside", vector(0.5, 0.1, 0.2), slanted, far),
        ("a ray that ends before the box", vector(-3, 0.1, 0.2), slanted, (0.0, 1.5)),
        ("a ray that ends in the box", vector(-3, 0.1, 0.2), slanted, (0.0, 3.0)),
        ("t_min in the box", vector(-3, 0.1, 0.2), slanted, (2.5, INFINITY)),
        ("t_min behind the box", vector(-3, 0.1, 0.2), slanted, (6.0, INFINITY)),
        ("a negative t_min", vector(3, 0.1, 0.2), slanted, (-9.0, INFINITY)),
        ("a ray along x", vector(-3, 0.1, 0.2), vector(1, 0, 0), far),
        ("a ray along -y", vector(0.1, 4, 0.2), vector(0, -1, 0), far),
        ("a ray along x that passes the box", vector(-3, 1.5, 0), vector(1, 0, 0), far),
        ("a ray along z that passes the box", vector(0, 1.5, -3), vector(0, 0, 1), far),
        ("a direction with -0", vector(-3, 0.1, 0.2), vector(1, -0.0, -0.0), far),
        ("a direction with -0, from inside", vector(0, 0, 0), vector(-0.0, 1, -0.0), far),
        ("a direction of length 4", vector(-3, 0.1, 0.2), vector(4, 0, 0), far),
    ):
        yield Case(about, "intersect_box", (origin, direction, lower, upper, *limits))
    for about, direction in (("a", vector(1, 0, 0)), ("a slanted ray and a", slanted)):
        flat = (vector(0.5, -1, -1), vector(0.5, 1, 1))
        arguments = (vector(-3, 0, 0), direction, *flat, *far)
        yield Case(f"{about} flat box", "intersect_box", arguments)
    for _ in range(150):
        corners = np.sort(random.normal(size=(2, 3)), axis=0)
        inside = corners[0] + random.uniform(-0.3, 1.3, 3) * (corners[1] - corners[0])
        direction = random.normal(size=3)
        origin = inside - random.uniform(-0.5, 2.0) * direction
        limits = far if random.random() < 0.8 else (0.5, 1.5)
        yield Case("a random box", "intersect_box", (origin, direction, *corners, *limits))


BOXES = (
    (vector(-1.1, -0.9, -0.6), vector(-0.3, 0.8, 0.2)),
    (vector(0.1, -0.9, -0.5), vector(1.1, -0.2, 0.6)),
    (vector(-0.1, 0.2, -1.4), vector(1.2, 0.9, -0.4)),
)


def _box_picture(f: Functions) -> Vector:
    def colour(x: float, y: float) -> Vector:
        origin, direction = through(x, y)
        found, nearest = BACKGROUND, INFINITY
        for k, (lower, upper) in enumerate(BOXES):
            hit = f.intersect_box(origin, direction, lower, upper, 0.0, INFINITY)
            if hit is not None and hit[0] < nearest:
                nearest = hit[0]
                depth = hit[1] - hit[0]  # as if the boxes were of coloured glass
                found = np.array([0.95, 0.95, 0.95]) * np.exp(
                    -depth * np.roll([0.2, 0.9, 1.4], k)
                )
        return found

    return scan(colour)


BOX = Exercise(
    name="box",
    summary="Where a ray is in a box, by slabs",
    task="""
        A box is what three slabs have in common, a slab being the space between two
        parallel planes. Compute where the ray is in each, and what is common to the three
        intervals and to the ray's own.

        A ray that lies exactly in a face may count as in the box or not.""",
    source="Kay and Kajiya, Ray Tracing Complex Scenes, 1986 [Kay1986]; the lecture's "
    "slides on bounding volumes",
    functions=(intersect_box,),
    hints=(
        "The planes of an axis are met at (lower - origin) / direction and at "
        "(upper - origin) / direction. Which one comes first depends on the direction.",
        "Begin with t_enter = t_min and t_exit = t_max. The largest of the entries and the "
        "smallest of the exits remain.",
        "If a number of the direction is 0, the ray is always in that slab or never: "
        "compare the origin with lower and upper.",
    ),
    mistakes=mistakes_of("""
        not-ordered: A ray against an axis misses. | Exchange the two values of an axis if
            the direction is negative.
        line: What lies behind the ray counts. | Begin with t_enter = t_min.
        inside-negative: A ray from inside enters before its own beginning. | Begin with
            t_enter = t_min.
        from-zero: The ray begins at 0, and not at t_min. | Begin with t_enter = t_min.
        no-t-max: What lies behind the end of the ray counts. | Begin with t_exit = t_max.
        any-slab: The intervals are united. | Take the largest of the entries, and the
            smallest of the exits.
        replaced (enter-replaced, exit-replaced): A slab replaces what the others gave. |
            Keep the largest of the entries, and the smallest of the exits.
        two-axes: The box has no end along z. | There are three slabs.
        parallel-misses: A ray parallel to a face always misses. | It does not if its
            origin is between the two planes.
        parallel-hits: A ray parallel to a face is always in that slab. | It is not if its
            origin is not between the two planes.
        division-by-zero (division-raises, minus-zero): A ray parallel to a face divides
            by 0. | Compare the origin with the planes if a number of the direction is 0.
        flat-missed: A flat box is missed. | It is hit if t_enter == t_exit.
        """),
    cases=_box_cases,
    picture=_box_picture,
)


# --------------------------------------------------------------------------------- grid


def walk_grid(
    origin: Vector,
    direction: Vector,
    lower: Vector,
    cell_size: Vector,
    resolution: Sequence[int],
    *,
    variants: Variants = RIGHT,
) -> list[tuple[int, ...]]:
    """Return the cells of a grid that a ray passes, in their order along the ray.

    Parameters
    ----------
    origin, direction : ndarray of shape (3,)
        The ray x(t) = origin + t direction, t >= 0. Any numbers of the direction may be 0,
        but not all.
    lower : ndarray of shape (3,)
        The lower corner of the grid.
    cell_size : ndarray of shape (3,)
        The size of a cell along x, y and z, above 0.
    resolution : tuple of three int
        How many cells the grid has along x, y and z.

    Returns
    -------
    list of tuples (i, j, k)
        Cell (i, j, k) begins at lower + (i, j, k) * cell_size. The list is empty if the
        ray does not meet the grid.
    """
    counts = np.array(resolution)
    box = (lower, lower + counts * cell_size)
    begin = -INFINITY if "behind" in variants else 0.0
    inside = intersect_box(origin, direction, *box, begin, INFINITY)
    if inside is None:
        return []
    start = origin + inside[0] * direction
    if variants & {"starts-outside", "clamped-start"}:
        start = origin
    cell = np.floor((start - lower) / cell_size).astype(int)
    if "starts-outside" not in variants:
        cell = np.clip(cell, 0, counts - 1)
    step, t_next, t_delta = [0, 0, 0], [INFINITY] * 3, [INFINITY] * 3
    for axis in range(3):
        d = float(direction[axis])
        if d == 0.0:
            if "division-raises" in variants:
                raise ZeroDivisionError
            if "steps-at-zero" in variants:
                step[axis], t_next[axis] = 1, -INFINITY
            continue
        step[axis] = 1 if d > 0.0 or "only-upwards" in variants else -1
        above = 1 if d > 0.0 or "upper-plane" in variants else 0
        plane = lower[axis] + (cell[axis] + above) * cell_size[axis]
        t_next[axis] = float(plane - origin[axis]) / d
        t_delta[axis] = float(cell_size[axis]) / abs(d)
        if "delta-is-size" in variants:
            t_delta[axis] = float(cell_size[axis])
        if d < 0.0 and "upwards-to-lower-plane" in variants:
            step[axis], t_delta[axis] = 1, -t_delta[axis]
        if "delta-is-signed" in variants:
            t_delta[axis] = float(cell_size[axis]) / d
    cells = []
    for _ in range(3 * int(counts.sum())):
        if np.any(cell < 0) or np.any(cell >= counts + ("up-to-resolution" in variants)):
            break
        cells.append(tuple(cell.tolist()))
        axis = int(np.argmax(t_next) if "farthest" in variants else np.argmin(t_next))
        cell[axis] += step[axis]
        t_next[axis] += t_delta[axis]
    if "one-beyond" in variants:
        cells.append(tuple(cell.tolist()))
    if "no-first" in variants or (inside[0] == 0.0 and "no-first-inside" in variants):
        del cells[:1]
    if "no-last" in variants:
        del cells[-1:]
    return cells


def _grid_cases(random: Generator) -> Iterator[Case]:
    lower, size, resolution = vector(0, 0, 0), vector(1, 1, 1), (4, 3, 2)
    for about, origin, direction in (
        ("a ray along x", vector(-1, 0.5, 0.5), vector(1, 0, 0)),
        ("a ray along -x", vector(6, 1.5, 0.5), vector(-1, 0, 0)),
        ("a ray along y, from inside", vector(2.5, 0.5, 1.5), vector(0, 1, 0)),
        ("a ray in the plane of x and y", vector(-1, 0.2, 0.5), vector(1, 0.43, 0)),
        ("a slanted ray from inside", vector(0.4, 0.3, 0.2), vector(1, 0.7, 0.3)),
        ("a ray that passes the grid", vector(-1, 5, 0.5), vector(1, 0.1, 0)),
        ("a grid behind the ray", vector(6, 1.5, 0.5), vector(1, 0.1, 0)),
        ("a ray against all axes", vector(5, 3.6, 2.4), vector(-1, -0.7, -0.45)),
    ):
        yield Case(about, "walk_grid", (origin, direction, lower, size, resolution))
    for _ in range(150):
        lower, size = random.normal(size=3), random.uniform(0.3, 2.0, 3)
        counts = random.integers(1, 7, 3)
        direction = random.normal(size=3) * random.choice([1.0, 0.1, 10.0])
        inside = lower + random.random(3) * counts * size
        outside = random.random() < 0.7
        distance = random.uniform(2.0, 9.0) / math.sqrt(direction @ direction)
        origin = inside - distance * direction if outside else inside
        resolution = tuple(counts.tolist())
        arguments = (origin, direction, lower, size, resolution)
        yield Case("a random grid", "walk_grid", arguments)


def _grid_picture(f: Functions) -> Vector:
    """Draw the cells of four rays in a grid of one layer."""
    picture = np.tile(BACKGROUND, (40, 40, 1))
    for k, (x, y, dx, dy) in enumerate(
        ((-3, 5, 1, 0.4), (43, 30, -1, -0.13), (4, -2, 0.3, 1), (20.5, 45, 0, -1))
    ):
        shade = np.roll([1.0, 0.6, 0.2], k) if k < 3 else np.ones(3)
        try:
            arguments = (vector(x, y, 0.5), vector(dx, dy, 0), vector(0, 0, 0))
            cells = f.walk_grid(*arguments, vector(1, 1, 1), (40, 40, 1))
            for i, j, _ in cells:
                picture[39 - j, i] = shade
        except Exception:  # the answers to the cases tell what is wrong
            picture[:] = np.nan
    return picture


GRID = Exercise(
    name="grid",
    summary="The cells that a ray passes in a grid, by 3D-DDA",
    task="""
        Find the cell in which the ray enters the grid, or begins. For each axis keep the t
        at which the ray meets the next plane between cells, and by how much t grows from
        plane to plane. Then step along the axis whose plane comes first, until the ray
        leaves the grid.

        No ray of the check passes exactly through an edge of a cell.""",
    source="Amanatides and Woo, A Fast Voxel Traversal Algorithm for Ray Tracing, 1987 "
    "[Amanatides1987]; the lecture's slides on grids",
    functions=(walk_grid,),
    hints=(
        "Clip the ray to the box of the grid first, as in the exercise box. The first cell "
        "is floor((x - lower) / cell_size), within 0 to resolution - 1.",
        "The next plane along an axis is the upper one of the cell if the direction is "
        "positive, and the lower one if it is negative.",
        "t grows by cell_size / |direction| from plane to plane. If the direction is 0, "
        "the next plane is at infinity.",
    ),
    mistakes=mistakes_of("""
        only-upwards (only-upwards, upwards-to-lower-plane): The cell number always grows.
            | Step by -1 along an axis whose direction is negative.
        upper-plane: The next plane is always the upper one of the cell. | It is the lower
            one if the direction is negative.
        starts-outside (starts-outside, clamped-start): The first cell is that of the
            ray's origin, outside of the grid. | Take the point where the ray enters the
            grid.
        behind: Cells behind the ray's origin are listed. | Begin at t = 0 if the origin
            is inside.
        delta (delta-is-size, delta-is-signed): t grows by a wrong amount from plane to
            plane. | It grows by cell_size / |direction|.
        farthest: The step is taken along the axis whose plane comes last. | Take the axis
            with the smallest t.
        zero-direction (division-raises, steps-at-zero): An axis whose direction is 0 is
            stepped along. | Its next plane is at infinity.
        no-first (no-first, no-first-inside): The first cell is missing. | List the cell
            before the step.
        no-last: The last cell is missing. | The ray leaves the grid when the cell's
            number is -1 or the resolution.
        one-beyond (one-beyond, up-to-resolution): A cell outside of the grid is listed. |
            Test the cell's number before it is listed.
        """),
    cases=_grid_cases,
    picture=_grid_picture,
)

EXERCISES = (BOX, GRID)
