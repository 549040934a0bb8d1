"""Rays from the camera, and where they meet spheres."""

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
    direction_cases,
    mistakes_of,
)
from renderer.exercises.pictures import BACKGROUND, of_normal, scan, through
from renderer.exercises.vectors import INFINITY, Vector, cross, random_unit, unit, vector

# ------------------------------------------------------------------------------- camera


def camera_ray(
    x: float,
    y: float,
    width: int,
    height: int,
    origin: Vector,
    target: Vector,
    up: Vector,
    fov: float,
    *,
    variants: Variants = RIGHT,
) -> Vector:
    """Return the direction of a camera's ray.

    Parameters
    ----------
    x, y : float
        Place in the picture, in pixels from its upper left corner: x grows to the right, y
        downwards. The centre of the first pixel is (0.5, 0.5).
    width, height : int
        Size of the picture, in pixels. Pixels are squares.
    origin, target : ndarray of shape (3,)
        Position of the camera, and the point that is seen in the centre of the picture.
    up : ndarray of shape (3,)
        A direction that is vertical in the picture. It need not have length 1, and need
        not be perpendicular to the view.
    fov : float
        Angle between the left and the right edge of the picture, in degrees.

    Returns
    -------
    ndarray of shape (3,)
        The direction from the camera through the place, of length 1.
    """
    forward = unit(target - origin)
    right = cross(forward, up)
    if "right-not-unit" not in variants:
        right = unit(right)
    if "turned" in variants:
        right = -right
    above = cross(right, forward)
    if "up-not-perpendicular" in variants:
        above = unit(up)
    angle = fov if "degrees" in variants else math.radians(fov)
    half = math.tan(angle if "whole-angle" in variants else angle / 2.0)
    size = height if "vertical-fov" in variants else width
    centre = 0.5 if "half-pixel" in variants else 0.0
    a = (2.0 * (x + centre) / width - 1.0) * half * width / size
    b = (1.0 - 2.0 * (y + centre) / height) * half * height / size
    if "square-picture" in variants:
        b = (1.0 - 2.0 * (y + centre) / height) * half
    if "mirrored" in variants:
        a = -a
    if "upside-down" in variants:
        b = -b
    direction: Vector = forward + a * right + b * above
    return direction if "not-unit" in variants else unit(direction)


def _camera_cases(random: Generator) -> Iterator[Case]:
    o, front, y = np.zeros(3), vector(0, 0, -1), vector(0, 1, 0)
    for about, place in (
        ("the centre of the picture", (32.0, 24.0)),
        ("the upper left corner", (0.0, 0.0)),
        ("the centre of the right edge", (64.0, 24.0)),
        ("the centre of the lower edge", (32.0, 48.0)),
    ):
        arguments = (*place, 64, 48, o, front, y, 90.0)
        yield from direction_cases(about, "camera_ray", arguments)
    tilted = vector(0, 3, -1)
    yield Case(
        "an `up` that is not perpendicular to the view, and not unit",
        "camera_ray",
        (10.0, 40.0, 64, 48, o, front, tilted, 50.0),
    )
    for _ in range(100):
        width, height = (int(n) for n in random.integers(8, 200, 2))
        place = (random.uniform(0, width), random.uniform(0, height))
        view = (random.normal(size=3), random.normal(size=3), random.normal(size=3))
        fov = random.uniform(20, 120)
        arguments = (*place, width, height, *view, fov)
        yield from direction_cases("a random camera", "camera_ray", arguments)


def _camera_picture(f: Functions) -> Vector:
    eye, target = vector(0, 1, 3), vector(0.2, 0.4, 0)

    def colour(x: float, y: float) -> Vector:
        place = (24.0 * (x + 1.0), 16.0 * (1.0 - y))
        d = np.asarray(f.camera_ray(*place, 48, 32, eye, target, vector(0, 2, 0), 60.0))
        ball = intersect_sphere(eye, d, target, 0.4, 0.0, INFINITY)
        if ball is not None:
            return of_normal(unit(eye + ball * d - target))
        if d[1] >= 0.0:
            return vector(0.5, 0.7, 1)
        floor = eye - eye[1] / d[1] * d
        return np.full(3, 0.8 if (math.floor(floor[0]) + math.floor(floor[2])) % 2 else 0.3)

    return scan(colour, 48, 32)


CAMERA = Exercise(
    name="camera",
    summary="The ray of a pinhole camera through a place of the picture",
    task="""
        A picture is a rectangle before the camera. Build three vectors of length 1 that are
        perpendicular to one another: forward, to the right, and above. Walk from the centre
        of the picture to the place, and make the direction unit.""",
    source="the lecture's slides on ray generation; Appel, Some Techniques for Shading "
    "Machine Renderings of Solids, 1968 [Appel1968]",
    functions=(camera_ray,),
    hints=(
        "Draw the camera from above. At distance 1 half of the picture has the width "
        "tan(fov / 2).",
        "right = unit(cross(forward, up)) and above = cross(right, forward).",
        "With a = (2 x / width - 1) tan(fov / 2), and b = (1 - 2 y / height) tan(fov / 2) "
        "height / width, the direction is forward + a right + b above.",
    ),
    mistakes=mistakes_of("""
        mirrored: Left and right are exchanged. | x grows to the right in the picture: 2 x
            / width - 1, along cross(forward, up).
        turned: The picture is turned by half a turn. | To the right is cross(forward,
            up), in this order; the vector above follows from it.
        upside-down: Up and down are exchanged. | y grows downwards in the picture: 1 - 2
            y / height.
        not-unit: The direction is right, but its length is not 1. | Divide it by its
            length.
        degrees: The angle is used as if it were in radians. | math.tan takes radians:
            math.radians(fov).
        whole-angle: The tangent is that of the whole angle of view. | From the centre to
            the edge it is half of the angle.
        vertical-fov: The angle of view is taken from the lower to the upper edge. | fov
            is the angle between the left and the right edge.
        square-picture: The picture is stretched as if it were a square. | Scale the
            vertical part by height / width: pixels are squares.
        half-pixel: The place is half a pixel off. | x and y are places already; the
            caller adds the 0.5 of a centre.
        right-not-unit: The vector to the right does not have length 1. | cross(forward,
            up) is as long as the sine of their angle times |up|.
        up-not-perpendicular: `up` itself is used as the vertical vector. | The vertical
            vector of the picture is cross(right, forward).
    """),
    cases=_camera_cases,
    picture=_camera_picture,
)


# ------------------------------------------------------------------------------- sphere


def intersect_sphere(
    origin: Vector,
    direction: Vector,
    center: Vector,
    radius: float,
    t_min: float,
    t_max: float,
    *,
    variants: Variants = RIGHT,
) -> float | None:
    """Return where a ray meets a sphere first.

    Parameters
    ----------
    origin, direction : ndarray of shape (3,)
        The ray x(t) = origin + t direction. The direction may have any length but 0.
    center : ndarray of shape (3,)
        The centre of the sphere.
    radius : float
        Its radius, above 0.
    t_min, t_max : float
        Only hits with t_min < t < t_max count; t_max may be infinite.

    Returns
    -------
    float or None
        The smallest t of a hit. None if there is none.
    """
    from_center = origin if "center-forgotten" in variants else origin - center
    a = 1.0 if "unit-direction" in variants else float(direction @ direction)
    b = float(from_center @ direction)
    if "b-doubled" in variants:
        b *= 2.0
    if "b-halved" in variants:
        b /= 2.0
    squared = radius if "radius-not-squared" in variants else radius * radius
    c = float(from_center @ from_center) - squared
    discriminant = b * b - (a * c / 4.0 if "quarter-of-ac" in variants else a * c)
    if "no-discriminant-test" not in variants and discriminant < 0.0:
        return None
    root = float(np.sqrt(discriminant))
    near, far = (-b - root) / a, (-b + root) / a
    if "sign-of-b" in variants:
        near, far = (b - root) / a, (b + root) / a
    if "roots-doubled" in variants:
        near, far = 2.0 * near, 2.0 * far
    roots = [near, far]
    if "near-only" in variants:
        roots = [near]
    if "far-first" in variants:
        roots = [far, near]
    for t in roots:
        early = not t_min < t
        if "no-t-min" in variants:
            early = False
        late = not t < t_max and "no-t-max" not in variants
        if not early and not late:
            return t
    return float("nan") if math.isnan(root) else None


def _sphere_cases(random: Generator) -> Iterator[Case]:
    forward, far = vector(0, 0, -1), INFINITY
    center, above = vector(0, 0, -5), vector(0, 0, 3)
    inside = vector(0.1, 0.2, -4.5)
    for about, origin, direction, limits in (
        ("a ray through the centre", above, forward, (0.0, far)),
        ("a ray that passes the sphere", vector(3, 0, 3), forward, (0.0, far)),
        ("a sphere behind the ray", above, -forward, (0.0, far)),
        ("a ray from inside", inside, forward, (0.0, far)),
        ("a ray from inside that ends inside", inside, forward, (0.0, 0.5)),
        ("a ray that ends before the sphere", above, forward, (0.0, 5.0)),
        ("t_min within the sphere", above, forward, (8.0, far)),
        ("t_min behind the sphere", above, forward, (50.0, far)),
        ("a direction of length 4", above, 4.0 * forward, (0.0, far)),
        ("a grazing ray", vector(1.9999, 0, 3), forward, (0.0, far)),
        ("a ray from the surface, away from it", vector(0, 0, -3), -forward, (1e-4, far)),
        (
            "a ray from the surface to the other side",
            vector(0, 0, -3),
            forward,
            (1e-4, far),
        ),
    ):
        yield Case(about, "intersect_sphere", (origin, direction, center, 2.0, *limits))
    for _ in range(200):
        center, radius = random.normal(size=3), random.uniform(0.2, 2.0)
        aside = random.uniform(0.0, 1.6) * radius
        direction = random_unit(random)
        across = unit(cross(direction, random_unit(random)))
        origin = center + aside * across - random.uniform(-2.0, 6.0) * direction
        if abs(aside - radius) < 0.01 * radius:
            continue
        direction = direction * random.choice([1.0, 0.3, 3.0])
        limits = (0.0, far) if random.random() < 0.8 else (0.5, 2.0)
        yield Case(
            "a random sphere",
            "intersect_sphere",
            (origin, direction, center, radius, *limits),
        )


SPHERES = (
    (vector(-0.6, 0.3, 0.3), 0.7),
    (vector(0.7, -0.2, 0), 0.6),
    (vector(0, -0.9, 0.9), 0.4),
)


def _sphere_picture(f: Functions) -> Vector:
    def colour(x: float, y: float) -> Vector:
        origin, direction = through(x, y)
        nearest, found = INFINITY, BACKGROUND
        for center, radius in SPHERES:
            t = f.intersect_sphere(origin, direction, center, radius, 0.0, nearest)
            if t is not None:
                nearest = t
                found = of_normal((origin + t * direction - center) / radius)
        return found

    return scan(colour)


SPHERE = Exercise(
    name="sphere",
    summary="Where a ray meets a sphere first",
    task="""
        Put the ray into |x - center|^2 = radius^2. The result is a quadratic equation for
        t. Choose the smallest of its roots that counts: a ray may start inside.""",
    source="the lecture's slides on implicit surfaces; Haines and "
    "others, Precision Improvements for Ray/Sphere Intersection, 2019 [Haines2019]",
    functions=(intersect_sphere,),
    hints=(
        "With o = origin - center the equation is a t^2 + 2 b t + c = 0, where "
        "a = dot(direction, direction) and b = dot(o, direction).",
        "c = dot(o, o) - radius^2. Without a root b^2 - a c is negative.",
        "t = (-b - root) / a if that counts, else (-b + root) / a if that counts.",
    ),
    mistakes=mistakes_of("""
        near-only: A ray from inside does not hit the sphere. | If the nearer root does
            not count, try the other.
        far-first: The far side of the sphere is hit. | Try the smaller root first.
        no-t-min: Hits before t_min count, such as those behind the ray's origin. | A root
            counts if t_min < t < t_max.
        no-t-max: Hits after t_max count. | A root counts if t_min < t < t_max.
        unit-direction: The direction is taken to have length 1. | Divide by a =
            dot(direction, direction).
        factor-of-two (b-doubled, b-halved, quarter-of-ac, roots-doubled): Two forms of
            the quadratic formula are mixed. | Either b = 2 dot(o, direction), b^2 - 4 a c
            and 2 a, or all three without.
        radius-not-squared: The radius is not squared. | c = dot(o, o) - radius^2.
        sign-of-b: The roots have the wrong sign of b. | The roots are (-b - root) / a and
            (-b + root) / a.
        no-discriminant-test: A ray that passes the sphere has an imaginary root. | Return
            None if b^2 - a c < 0.
        center-forgotten: The sphere is in the origin of the world. | Subtract the centre
            from the origin of the ray first.
    """),
    cases=_sphere_cases,
    picture=_sphere_picture,
)

EXERCISES = (CAMERA, SPHERE)
