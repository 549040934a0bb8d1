"""Where a bounding volume hierarchy is split."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

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
from renderer.exercises.vectors import INFINITY, Vector


def split_boxes(
    lower: Vector, upper: Vector, *, variants: Variants = RIGHT
) -> list[int] | None:
    """Return how a node of a bounding volume hierarchy is split at the least cost.

    Sort the boxes by their centres along x, along y and along z. Each of the three orders
    can be cut after its first box, its second box, and so on. The cost of a cut is

        1 + (A_L n_L + A_R n_R) / A

    with A the surface area of the box around all, A_L and A_R those of the boxes around
    either part, and n_L and n_R the numbers of boxes in them. The cost of a leaf is n.

    Parameters
    ----------
    lower, upper : ndarray of shape (n, 3)
        The corners of the boxes, n >= 1.

    Returns
    -------
    list of int or None
        The numbers, from 0 to n - 1, of the boxes of one of the two parts of the cheapest
        cut, in any order. None if no cut is cheaper than a leaf.
    """
    count = len(lower)
    centers = lower if "lower-corners" in variants else (lower + upper) / 2.0
    spans = (lower, upper)
    if "center-boxes" in variants:
        spans = (centers, centers)
    whole = _area(spans[0], spans[1], variants)
    axes = [0, 1, 2]
    extent = upper.max(axis=0) - lower.min(axis=0)
    if "longest-axis" in variants:
        axes = [int(np.argmax(extent))]
    if "first-axis" in variants:
        axes = [0]
    best, found = INFINITY, None
    for axis in axes:
        order = np.argsort(centers[:, axis], kind="stable")
        cuts = list(range(1, count))
        if "median" in variants:
            cuts = [count // 2] if count > 1 else []
        if "middle" in variants:
            middle = (centers[:, axis].min() + centers[:, axis].max()) / 2.0
            cuts = [k for k in [int(np.sum(centers[:, axis] < middle))] if 0 < k < count]
        for cut in cuts:
            left, right = order[:cut], order[cut:]
            area_l = _area(spans[0][left], spans[1][left], variants)
            area_r = _area(spans[0][right], spans[1][right], variants)
            if "right-is-whole" in variants:
                area_r = whole
            n_l, n_r = len(left), len(right)
            if "no-counts" in variants:
                n_l = n_r = 1
            if "counts-exchanged" in variants:
                n_l, n_r = n_r, n_l
            cost = 1.0 + (area_l * n_l + area_r * n_r) / whole
            if "not-divided" in variants:
                cost = 1.0 + area_l * n_l + area_r * n_r
            if "no-traversal" in variants:
                cost -= 1.0
            if cost < best:
                best, found = cost, left
    if found is None or (best >= count and "never-a-leaf" not in variants):
        return None
    return [int(k) for k in found]


def _area(lower: Vector, upper: Vector, variants: Variants = RIGHT) -> float:
    """Return the surface area of the box around boxes."""
    x, y, z = (upper.max(axis=0) - lower.min(axis=0)).tolist()
    return x * y * z if "volume" in variants else 2.0 * (x * y + y * z + z * x)


def _half_with_first(count: int, answer: Any) -> Any:
    """Return which of two parts has box 0; anything that is no part as it is."""
    try:
        part = {int(k) for k in answer}
    except (TypeError, ValueError):
        return answer
    if len(part) != len(answer) or not part <= set(range(count)):
        return answer
    return sorted(part if 0 in part else set(range(count)) - part)


def _bvh_cases(random: Generator) -> Iterator[Case]:
    def case(about: str, lower: Vector, upper: Vector) -> Case:
        read = partial(_half_with_first, len(lower))
        return Case(about, "split_boxes", (lower, upper), read=read)

    def row(*starts: float, axis: int = 0) -> tuple[Vector, Vector]:
        lower = np.zeros((len(starts), 3))
        lower[:, axis] = starts
        return lower, lower + 1.0

    yield case("two boxes far apart", *row(0.0, 5.0))
    yield case("one box", *row(0.0))
    yield case("two boxes at the same place", *row(0.0, 0.0))
    yield case("two boxes that overlap much", *row(0.0, 0.3))
    yield case("three boxes and one far away", *row(0.0, 0.5, 1.0, 20.0))
    yield case("the same along z", *row(0.0, 0.5, 1.0, 20.0, axis=2))
    yield case("small boxes", *(0.01 * one for one in row(0.0, 3.0, 4.5, 20.0)))
    for _ in range(100):
        count = random.integers(3, 12)
        size = random.choice([0.2, 1.0, 2.0])
        scale = random.uniform(0.3, 3.0, 3)
        lower = random.normal(size=(count, 3)) * scale
        yield case("random boxes", lower, lower + random.exponential(size, (count, 3)))


def _bvh_picture(f: Functions) -> Vector:
    """Draw through how many boxes of the tree a line of sight passes."""
    random = np.random.default_rng(5)
    clusters = random.uniform(-0.8, 0.8, (6, 3))
    lower = np.repeat(clusters, 8, axis=0) + random.normal(scale=0.12, size=(48, 3))
    upper = lower + random.uniform(0.02, 0.1, (48, 3))
    places = (np.arange(40) + 0.5) / 20.0 - 1.0
    passed = np.zeros((40, 40))

    def build(numbers: list[int]) -> None:
        low, high = lower[numbers].min(axis=0), upper[numbers].max(axis=0)
        inside_x = (low[0] <= places) & (places <= high[0])
        inside_y = (low[1] <= places[::-1]) & (places[::-1] <= high[1])
        passed[np.ix_(inside_y, inside_x)] += 1.0
        part = f.split_boxes(lower[numbers], upper[numbers])
        if part is None or not 0 < len(set(part)) < len(numbers):
            return
        build([numbers[k] for k in part])
        build([n for k, n in enumerate(numbers) if k not in set(part)])

    try:
        build(list(range(48)))
    except Exception:  # the answers to the cases tell what is wrong
        passed[:] = np.nan
    return np.stack([passed / 14.0, passed / 22.0, 0.2 + passed / 40.0], axis=2)


BVH = Exercise(
    name="bvh",
    summary="Where to split a node of a BVH: the surface area heuristic",
    task="""
        A ray that meets a box meets a smaller box in it with a probability near the
        quotient of their surface areas. So the cost of two children can be told before
        they are built. Try every cut along every axis, and return the cheapest.

        The picture to reach shows how many boxes of the whole tree a line of sight
        passes.""",
    source="MacDonald and Booth, Heuristics for Ray Tracing Using Space Subdivision, 1990 "
    "[MacDonald1990]; Wald, On Fast Construction of SAH-based Bounding Volume Hierarchies, "
    "2007 [Wald2007]",
    functions=(split_boxes,),
    hints=(
        "Write a function of the surface area of the box around some boxes first: "
        "2 (x y + y z + z x).",
        "For an axis: order = np.argsort(centre along it), then for each cut from 1 to "
        "n - 1 the parts are order[:cut] and order[cut:].",
        "Keep the part with the least cost over all axes and cuts. At the end compare that "
        "cost with n.",
    ),
    mistakes=mistakes_of("""
        median: The boxes are split into halves of equal number. | Try every cut, from 1 to
            n - 1.
        middle: The boxes are split in the middle between them. | Try every cut, from 1 to
            n - 1.
        volume: Volumes take the place of surface areas. | The probability that a ray meets
            a box goes with its surface.
        one-axis (first-axis, longest-axis): Only one axis is tried. | Try all three.
        no-counts: The numbers of boxes do not matter. | Multiply each area by the number of
            boxes in that part.
        counts-exchanged: The numbers of boxes belong to the other parts. | A_L belongs to
            n_L.
        right-is-whole: The box around the second part is too large. | Compute it from the
            boxes of that part alone.
        not-divided: The areas are not divided by that of the node. | Divide by A, so that
            the cost does not depend on the unit of length.
        never-a-leaf: A node is split although a leaf is cheaper. | Return None if the cost
            is not below n.
        no-traversal: The cost of the node itself is missing. | Add 1 to the cost of a cut.
        lower-corners: The boxes are sorted by their lower corners. | Sort by their centres.
        center-boxes: The areas are those around the centres. | Take the corners of the
            boxes.
        """),
    cases=_bvh_cases,
    picture=_bvh_picture,
)

EXERCISES = (BVH,)
