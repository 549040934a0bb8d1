"""Where a ray meets a triangle, in two ways."""

from __future__ import annotations

import math
from collections.abc import Iterator

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
from renderer.exercises.vectors import INFINITY, Vector, cross, vector

# ----------------------------------------------------------------------------- triangle


def intersect_triangle(
    origin: Vector,
    direction: Vector,
    p1: Vector,
    p2: Vector,
    p3: Vector,
    t_min: float,
    t_max: float,
    *,
    variants: Variants = RIGHT,
) -> tuple[float, float, float] | None:
    """Return where a ray meets a triangle.

    Parameters
    ----------
    origin, direction : ndarray of shape (3,)
        The ray x(t) = origin + t direction. The direction may have any length but 0.
    p1, p2, p3 : ndarray of shape (3,)
        The corners. Both faces of the triangle can be hit. A triangle without area is not.
    t_min, t_max : float
        Only hits with t_min < t < t_max count; t_max may be infinite.

    Returns
    -------
    tuple (t, u, v) or None
        The hit is origin + t direction = p1 + u (p2 - p1) + v (p3 - p1), with u >= 0,
        v >= 0 and u + v <= 1. None if there is no hit.
    """
    e1, e2 = p2 - p1, p3 - p1
    p = cross(direction, e2)
    determinant = float(e1 @ p)
    smallest = 1e-3 if "large-epsilon" in variants else 0.0
    facing = abs(determinant)
    if variants & {"culled-back", "culled-front"}:
        facing = determinant if "culled-back" in variants else -determinant
    if facing <= smallest:
        if "division-raises" in variants:
            raise ZeroDivisionError
        if "division-is-nan" not in variants:
            return None
    scale = np.float64(1.0) / determinant
    if "not-divided" in variants:
        scale = np.float64(1.0)
    s = origin - p1
    q = cross(s, e1)
    t, u, v = (
        float(scale * (e2 @ q)),
        float(scale * (s @ p)),
        float(scale * (direction @ q)),
    )
    if "order-of-q" in variants:  # cross(e1, s)
        t, v = -t, -v
    if "sign-of-s" in variants:
        t, u, v = -t, -u, -v
    if "distance" in variants:
        t *= math.sqrt(direction @ direction)
    outside = u < 0.0 or v < 0.0 or u + v > 1.0
    if "parallelogram" in variants:
        outside = u < 0.0 or v < 0.0 or u > 1.0 or v > 1.0
    if "whole-plane" in variants:
        outside = False
    if "no-lower-bounds" in variants:
        outside = u + v > 1.0
    if "u-v-exchanged" in variants:
        u, v = v, u
    late = t >= t_max and "no-t-max" not in variants
    early = t <= t_min and "no-t-min" not in variants
    if "zero-t-min" in variants:
        early = t <= 0.0
    return None if outside or early or late else (t, u, v)


TRIANGLE = (np.zeros(3), vector(2, 0, 0), vector(0, 1, 0))


def triangle_cases(random: Generator, function: str) -> Iterator[Case]:
    """Give rays and triangles; no hit is within rounding of an edge."""
    down, far = vector(0, 0, -1), INFINITY
    above = vector(0.5, 0.25, 3)
    for about, origin, direction, limits in (
        ("a ray straight onto the triangle", above, down, (0.0, far)),
        ("a ray onto the other face", above * (1, 1, -1), -down, (0.0, far)),
        ("a triangle behind the ray", above, -down, (0.0, far)),
        ("a hit before t_min", above, down, (3.5, far)),
        ("a hit after t_max", above, down, (0.0, 2.5)),
        ("a negative t_min, and a hit behind the origin", above, -down, (-5.0, 5.0)),
        ("a direction of length 2", above, 2.0 * down, (0.0, 2.0)),
        ("a direction of length 1e-3", above, 1e-3 * down, (0.0, far)),
        ("a ray outside of the edge p2 p3", vector(1.5, 0.75, 3), down, (0.0, far)),
        ("a ray outside of the edge p1 p3", vector(-0.5, 0.25, 3), down, (0.0, far)),
        ("a ray outside of the edge p1 p2", vector(0.5, -0.25, 3), down, (0.0, far)),
        ("a ray parallel to the triangle", above, vector(1, 0, 0), (0.0, far)),
        (
            "a ray in the plane of the triangle",
            vector(-1, 0.25, 0),
            vector(1, 0, 0),
            (0.0, far),
        ),
        ("a grazing ray", vector(-999.5, 0.25, 1), vector(1, 0, -1e-3), (0.0, far)),
    ):
        yield Case(about, function, (origin, direction, *TRIANGLE, *limits))
    tiny = tuple(1e-3 * p for p in TRIANGLE)
    yield Case("a small triangle", function, (1e-3 * above, down, *tiny, 0.0, far))
    upright = (np.zeros(3), vector(2, 0, 0), vector(0, 0, 1))
    for about, x in (("a hit on", 0.5), ("a ray that passes", 2.5)):
        yield Case(
            f"{about} a triangle in the plane of x and z",
            function,
            (vector(x, 3, 0.25), vector(0, -1, 0), *upright, 0.0, far),
        )
    line = (np.zeros(3), vector(1, 0, 0), vector(2, 0, 0))
    yield Case("a triangle without area", function, (above, down, *line, 0.0, far))
    for _ in range(200):
        corners = random.normal(size=(3, 3))
        u, v = random.uniform(-0.4, 1.4, 2)
        if min(abs(u), abs(v), abs(1.0 - u - v)) < 0.01:
            continue
        x = corners[0] + u * (corners[1] - corners[0]) + v * (corners[2] - corners[0])
        direction = random.normal(size=3)
        origin = x - random.choice([-1.0, 1.0, 1.0, 1.0]) * direction
        limits = (0.0, far) if random.random() < 0.8 else (0.5, 0.8)
        yield Case("a random triangle", function, (origin, direction, *corners, *limits))


TURN = np.array([[0.8, 0.0, -0.6], [0.24, 0.917, 0.32], [0.55, -0.4, 0.733]])
PYRAMID = [
    tuple(TURN @ p for p in (vector(a, 0, 0), vector(0, b, 0), vector(0, 0, 1.2)))
    for a in (-1.3, 1.3)
    for b in (-1.3, 1.3)
]


def _triangle_picture(f: Functions) -> Vector:
    def colour(x: float, y: float) -> Vector:
        origin, direction = through(x, y)
        nearest, found = INFINITY, BACKGROUND
        for corners in PYRAMID:
            hit = f.intersect_triangle(origin, direction, *corners, 0.0, INFINITY)
            if hit is not None and hit[0] < nearest:
                nearest = hit[0]
                found = np.array([hit[1], hit[2], 1.0 - hit[1] - hit[2]])
        return found

    return scan(colour)


TRIANGLE_MISTAKES = mistakes_of("""
        no-t-min: Hits before t_min count, such as those behind the ray's origin. | Return
            None unless t_min < t.
        no-t-max: Hits after t_max count. | Return None unless t < t_max.
        zero-t-min: t is compared with 0, and not with t_min. | t_min may be larger than
            0, and smaller.
        no-parallel-test (division-raises, division-is-nan): A ray parallel to the
            triangle divides by 0. | Return None if the divisor is 0, before the division.
        whole-plane: Every point of the triangle's plane counts. | Return None for points
            outside of an edge.
        large-epsilon: Small triangles, or rays with a short direction, are missed. | The
            divisor has no scale: compare it with 0, or with something like 1e-15.
        """)

MOELLER_TRUMBORE = Exercise(
    name="triangle",
    summary="Where a ray meets a triangle, by Moeller and Trumbore",
    task="""
        Solve origin + t direction = p1 + u (p2 - p1) + v (p3 - p1) for t, u and v by
        Cramer's rule. The determinants are triple products, which share two cross products.

        Rays that pass exactly through an edge or a corner may count as hits or not.""",
    source="Moeller and Trumbore, Fast, Minimum Storage Ray/Triangle Intersection, 1997 "
    "[Moeller1997]; the lecture's slide on rays and triangles",
    functions=(intersect_triangle,),
    hints=(
        "With e1 = p2 - p1, e2 = p3 - p1 and s = origin - p1 the equation is "
        "u e1 + v e2 - t direction = s: three equations for three numbers.",
        "With p = cross(direction, e2) and q = cross(s, e1) the determinant is dot(e1, p), "
        "and u = dot(s, p) / determinant.",
        "v = dot(direction, q) / determinant and t = dot(e2, q) / determinant. Test the "
        "determinant for 0 first, then u, v, u + v, and t last.",
    ),
    mistakes=(
        *TRIANGLE_MISTAKES,
        *mistakes_of("""
        culled (culled-back, culled-front): One face of the triangle is not hit. | The
            determinant may be negative: both faces count.
        parallelogram: The other half of the parallelogram is hit too. | The third edge is
            u + v <= 1, and not u <= 1 and v <= 1.
        no-lower-bounds: Points outside of the edges at p1 count. | Return None if u < 0
            or v < 0.
        sign (order-of-q, sign-of-s): A vector or a cross product is turned round. | s is
            origin - p1, and q is cross(s, e1), in this order.
        u-v-exchanged: u and v are exchanged. | u belongs to p2 and v to p3.
        not-divided: t, u and v are not divided by the determinant. | Cramer's rule is a
            quotient of determinants.
        distance: t is the distance, and not the parameter of the ray. | t counts lengths
            of `direction`, which need not be 1.
        """),
    ),
    cases=lambda random: triangle_cases(random, "intersect_triangle"),
    picture=_triangle_picture,
)


# -------------------------------------------------------------------------- barycentric


def intersect_barycentric(
    origin: Vector,
    direction: Vector,
    p1: Vector,
    p2: Vector,
    p3: Vector,
    t_min: float,
    t_max: float,
    *,
    variants: Variants = RIGHT,
) -> tuple[float, float, float, float] | None:
    """Return where a ray meets a triangle, with the weights of the corners.

    Parameters
    ----------
    origin, direction : ndarray of shape (3,)
        The ray x(t) = origin + t direction. The direction may have any length but 0.
    p1, p2, p3 : ndarray of shape (3,)
        The corners. Both faces of the triangle can be hit. A triangle without area is not.
    t_min, t_max : float
        Only hits with t_min < t < t_max count; t_max may be infinite.

    Returns
    -------
    tuple (t, b1, b2, b3) or None
        The hit is origin + t direction = b1 p1 + b2 p2 + b3 p3, where no weight is
        negative and their sum is 1. None if there is no hit.
    """
    normal = cross(p2 - p1, p3 - p1)
    divisor = float(normal @ direction)
    smallest = 1e-3 if "large-epsilon" in variants else 0.0
    if abs(divisor) <= smallest:
        if "division-raises" in variants:
            raise ZeroDivisionError
        if "division-is-nan" not in variants:
            return None
    corner = -p1 if "plane-sign" in variants else p1
    t = float(np.float64(normal @ (corner - origin)) / divisor)
    x = origin + t * direction
    seen_from = vector(0, 0, 1) * normal if "projected" in variants else normal
    edges = ((p2, p3), (p3, p1), (p1, p2))
    areas = [float(cross(b - a, x - a) @ seen_from) for a, b in edges]
    if "projected-miss" in variants and normal[2] == 0.0:
        return None
    if "unsigned-areas" in variants:
        areas = [abs(area) for area in areas]
    whole = float(sum(areas))
    if "half-area" in variants:
        whole /= 2.0
    if "not-normalized" in variants:
        whole = math.sqrt(normal @ normal)
    b1, b2, b3 = (float(np.float64(area) / whole) for area in areas)
    outside = min(b1, b2, b3) < 0.0
    if "whole-plane" in variants:
        outside = False
    if "sum-only" in variants:
        outside = b2 + b3 > 1.0
    for name in ("132", "213", "231", "312", "321"):
        if name in variants:
            weights = (b1, b2, b3)
            b1, b2, b3 = (weights[int(k) - 1] for k in name)
    late = t >= t_max and "no-t-max" not in variants
    early = t <= t_min and "no-t-min" not in variants
    if "zero-t-min" in variants:
        early = t <= 0.0
    return None if outside or early or late else (t, b1, b2, b3)


def _barycentric_picture(f: Functions) -> Vector:
    def colour(x: float, y: float) -> Vector:
        origin, direction = through(x, y)
        nearest, found = INFINITY, BACKGROUND
        for corners in PYRAMID:
            hit = f.intersect_barycentric(origin, direction, *corners, 0.0, INFINITY)
            if hit is not None and hit[0] < nearest:
                nearest, found = hit[0], np.array(hit[1:])
        return found

    return scan(colour)


BARYCENTRIC = Exercise(
    name="barycentric",
    summary="The same by the plane, and the areas between the hit and the edges",
    task="""
        Meet the plane of the triangle first. Then divide the triangle into three at the
        hit. The weight of a corner is the area of the small triangle opposite of it over
        the area of the whole. An area is negative if the hit is on the outer side of its
        edge.

        Rays that pass exactly through an edge or a corner may count as hits or not.""",
    source="the lecture's slide on rays and triangles; Pharr, Jakob, Humphreys, "
    "Physically Based Rendering, 4th edition, section 6.5 [Pharr2023]",
    functions=(intersect_barycentric,),
    hints=(
        "The normal is cross(p2 - p1, p3 - p1), and all x in the plane have "
        "dot(normal, x - p1) = 0.",
        "The length of cross(p3 - p2, x - p2) is twice the area of the triangle p2 p3 x. "
        "The vector points along the normal if x is on the inner side.",
        "b1 = dot(normal, cross(p3 - p2, x - p2)) / dot(normal, normal); the same for b2 "
        "with p3 and p1, and for b3 with p1 and p2.",
    ),
    mistakes=(
        *TRIANGLE_MISTAKES,
        *mistakes_of("""
        corners-exchanged (132, 213, 231, 312, 321): The weights belong to other corners.
            | The weight of p1 is the area at the opposite edge, from p2 to p3.
        unsigned-areas: Areas have no sign, so that points outside count. | Multiply with
            the normal instead of taking the length.
        half-area: The weights are twice as large as they should be. | The cross products
            are all twice an area: divide alike by alike.
        not-normalized: The weights do not have the sum 1. | Divide by dot(normal,
            normal), and not by the length of the normal.
        projected (projected, projected-miss): The triangle is seen from z, whatever its
            orientation. | Take the areas in the plane of the triangle, or drop the axis
            along which the normal is longest.
        sum-only: A weight may be negative. | Test all three weights.
        plane-sign: The plane is mirrored at the origin of the world. | t = dot(normal, p1
            - origin) / dot(normal, direction).
        """),
    ),
    cases=lambda random: triangle_cases(random, "intersect_barycentric"),
    picture=_barycentric_picture,
)

EXERCISES = (MOELLER_TRUMBORE, BARYCENTRIC)
