"""Normals between the corners of a mesh, and the light of point lights."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

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
from renderer.exercises.vectors import INFINITY, Vector, random_unit, unit, vector

# ------------------------------------------------------------------------------ normals


def shading_normal(
    n1: Vector,
    n2: Vector,
    n3: Vector,
    u: float,
    v: float,
    world_from_object: Vector,
    *,
    variants: Variants = RIGHT,
) -> Vector:
    """Return the normal for shading at a point of a triangle.

    Parameters
    ----------
    n1, n2, n3 : ndarray of shape (3,)
        The normals at the corners, of length 1, in the space of the object.
    u, v : float
        The place on the triangle, p1 + u (p2 - p1) + v (p3 - p1).
    world_from_object : ndarray of shape (3, 3)
        Takes points and directions of the object into the world. It can be inverted; it may
        stretch one axis more than another.

    Returns
    -------
    ndarray of shape (3,)
        The interpolated normal in the world, of length 1.
    """
    weights = [1.0 - u - v, u, v]
    for name in ("132", "213", "231", "312", "321"):
        if name in variants:
            weights = [weights[int(k) - 1] for k in name]
    if "first-corner" in variants:
        weights = [1.0, 0.0, 0.0]
    if "mean" in variants:
        weights = [1.0 / 3.0] * 3
    normal = weights[0] * n1 + weights[1] * n2 + weights[2] * n3
    if "unit-too-early" in variants:
        normal = unit(normal)
    matrix = np.linalg.inv(world_from_object).T
    if "as-direction" in variants:
        matrix = world_from_object
    if "not-transposed" in variants:
        matrix = matrix.T
    if "not-inverted" in variants:
        matrix = world_from_object.T
    if "not-transformed" in variants:
        matrix = np.eye(3)
    found: Vector = matrix @ normal
    return found if variants & {"not-unit", "unit-too-early"} else unit(found)


def _normal_cases(random: Generator) -> Iterator[Case]:
    corners = (vector(0, 0, 1), unit(vector(0.5, 0, 1)), unit(vector(0, 0.7, 1)))
    same = np.eye(3)
    for about, place, matrix in (
        ("the first corner", (0.0, 0.0), same),
        ("the second corner", (1.0, 0.0), same),
        ("the third corner", (0.0, 1.0), same),
        ("the middle of the triangle", (0.3, 0.3), same),
        ("an object that is turned", (0.2, 0.1), same[[1, 2, 0]]),
        ("an object that is three times as large", (0.2, 0.1), 3.0 * same),
        ("an object that is stretched along x", (0.8, 0.1), np.diag([4.0, 1, 1])),
        ("an object that is sheared", (0.3, 0.3), vector(1, 0, 2, 0, 1, 0, 0, 0, 1)),
    ):
        arguments = (*corners, *place, matrix.reshape(3, 3))
        yield from direction_cases(about, "shading_normal", arguments)
    for _ in range(100):
        up = random_unit(random)
        normals = [unit(up + 0.6 * random_unit(random)) for _ in range(3)]
        u, v = np.sort(random.random(2))
        matrix = random.normal(size=(3, 3)) + 2.0 * np.eye(3)
        arguments = (*normals, u, v - u, matrix)
        yield from direction_cases("a random triangle", "shading_normal", arguments)


def _normal_picture(f: Functions) -> Vector:
    """Draw a pyramid of four faces with the normals of an ellipsoid."""
    stretched = np.diag([1.0, 0.6, 1.0])
    light = unit(vector(1, 1, 1))
    axes = [vector(1, 0, 0), vector(0, 1, 0), vector(0, 0, 1)]

    def colour(x: float, y: float) -> Vector:
        a, b = x / 0.9, y / 0.9
        if abs(a) + abs(b) > 1.0:
            return BACKGROUND
        corners = (
            axes[2],
            math.copysign(1.0, a) * axes[0],
            math.copysign(1.0, b) * axes[1],
        )
        normal = np.asarray(f.shading_normal(*corners, abs(a), abs(b), stretched))
        return of_normal(normal) * (0.3 + 0.7 * max(0.0, float(normal @ light)))

    return scan(colour)


NORMALS = Exercise(
    name="normals",
    summary="The normal for shading, between the corners of a triangle",
    task="""
        A mesh looks smooth if the normal changes from corner to corner. Mix the three
        normals with the weights of the place, and take the result into the world. A normal
        stays perpendicular to its surface, which a stretched direction does not.""",
    source="Phong, Illumination for Computer Generated Pictures, 1975; Pharr, Jakob, "
    "Humphreys, Physically Based Rendering, 4th edition, sections 3.10 and 6.5 [Pharr2023]",
    functions=(shading_normal,),
    hints=(
        "The weight of the first corner is 1 - u - v.",
        "A tangent t becomes M t, and the normal must be perpendicular to it: n' M t = 0.",
        "Multiply with the transpose of the inverse, and divide by the length at the end.",
    ),
    mistakes=mistakes_of("""
        not-unit (not-unit, unit-too-early): The normal does not have length 1. | Divide
            by the length last: mixing and transforming both change it.
        corners-exchanged (132, 213, 231, 312, 321): The weights belong to other corners.
            | The weights of p1, p2 and p3 are 1 - u - v, u and v.
        flat (first-corner, mean): The normal is the same at every place. | Mix the three
            normals with the weights 1 - u - v, u and v.
        as-direction: The normal is transformed as if it were a direction. | Use the
            transpose of the inverse of the matrix.
        not-transposed: The inverse of the matrix is not transposed. | Use the transpose
            of the inverse of the matrix.
        not-inverted: The matrix is transposed, but not inverted. | Use the transpose of
            the inverse of the matrix.
        not-transformed: The normal is that of the object. | Use `world_from_object`.
        """),
    cases=_normal_cases,
    picture=_normal_picture,
)


# -------------------------------------------------------------------------- point light


@dataclass(frozen=True)
class Blockers:
    """What can lie between a point and a light: spheres, and the surface of the point."""

    spheres: Sequence[tuple[Vector, float]]  # centre, radius
    point: Vector
    normal: Vector

    def __call__(
        self, origin: Vector, direction: Vector, t_min: float, t_max: float
    ) -> bool:
        """Return whether anything is met at t_min < t < t_max."""
        # rounding has put the surface this far before the point
        along = float(direction @ self.normal)
        height = float((np.asarray(origin) - self.point) @ self.normal)
        own = (1e-6 - height) / along if along else INFINITY
        return t_min < own < t_max or any(
            t_min < t < t_max for s in self.spheres for t in _roots(origin, direction, *s)
        )

    def __repr__(self) -> str:
        """Say what is in the way."""
        spheres = [f"radius {r:g} at {np.round(c, 3).tolist()}" for c, r in self.spheres]
        return f"<the surface itself, and spheres: {', '.join(spheres) or 'none'}>"


def _roots(
    origin: Vector, direction: Vector, center: Vector, radius: float
) -> tuple[float, ...]:
    from_center = origin - center
    a, b = float(direction @ direction), float(from_center @ direction)
    discriminant = b * b - a * (float(from_center @ from_center) - radius * radius)
    if discriminant < 0.0:
        return ()
    root = math.sqrt(discriminant)
    return (-b - root) / a, (-b + root) / a


def direct_light(
    x: Vector,
    normal: Vector,
    albedo: float,
    lights: Sequence[tuple[Vector, float]],
    is_blocked: Blockers,
    *,
    variants: Variants = RIGHT,
) -> float:
    """Return the light of point lights that a diffuse surface reflects.

    Parameters
    ----------
    x, normal : ndarray of shape (3,)
        The point, and the normal of its surface, of length 1. Only light from the side of
        the normal is reflected.
    albedo : float
        The part of the light that is reflected, in [0, 1]: k_d of the lecture.
    lights : list of tuples (position, intensity)
        Positions are ndarrays of shape (3,). Intensities are in W/sr.
    is_blocked : function
        is_blocked(origin, direction, t_min, t_max) tells whether the ray
        origin + t direction meets anything with t_min < t < t_max. The surface of x is a
        part of the scene. Rounding may put it slightly before x; t_min = 1e-4 is enough.

    Returns
    -------
    float
        The reflected radiance, in W/(m^2 sr).
    """
    found = 0.0
    for position, intensity in lights[:1] if "first-light" in variants else lights:
        to_light = position - x
        distance = math.sqrt(to_light @ to_light)
        wi = to_light / distance
        cosine = float(wi @ normal)
        if "absolute-cosine" in variants:
            cosine = abs(cosine)
        elif "negative-cosine" not in variants and cosine < 0.0:
            continue
        t_min = 0.0 if "self-shadow" in variants else 1e-4
        t_max = INFINITY if "beyond-the-light" in variants else distance - 1e-4
        if "no-shadow" not in variants and is_blocked(x, wi, t_min, t_max):
            if "all-dark" in variants:
                return 0.0
            continue
        falloff = distance * distance
        if "no-falloff" in variants:
            falloff = 1.0
        if "linear-falloff" in variants:
            falloff = distance
        if "four-pi" in variants:
            falloff *= 4.0 * math.pi
        if "no-cosine" in variants:
            cosine = 1.0
        found += intensity / falloff * cosine
        if "first-lit" in variants:
            break
    return albedo * found if "no-pi" in variants else albedo / math.pi * found


def _light_cases(random: Generator) -> Iterator[Case]:
    x, up = vector(0, 0, 0), vector(0, 1, 0)
    above, aside = (vector(0, 2, 0), 10.0), (vector(3, 4, 0), 50.0)
    low, weak = (vector(2, -1, 0), 10.0), (vector(-1, 1, 1), 5.0)
    for about, lights, spheres in (
        ("a light above the surface", [above], []),
        ("a light from the side", [aside], []),
        ("two lights", [above, aside], []),
        ("no light", [], []),
        ("a light behind the surface", [low], []),
        ("a light behind the surface and one before it", [low, above], []),
        ("a sphere between the light and the point", [above], [(vector(0, 1, 0), 0.3)]),
        ("a sphere behind the light", [above], [(vector(0, 3, 0), 0.3)]),
        (
            "a sphere in the shadow ray of one light",
            [weak, above],
            [(vector(0, 1, 0), 0.3)],
        ),
        ("a sphere that passes the shadow ray", [above], [(vector(1, 1, 0), 0.3)]),
    ):
        yield Case(about, "direct_light", (x, up, 0.5, lights, Blockers(spheres, x, up)))
    for _ in range(120):
        point, normal = random.normal(size=3), random_unit(random)
        lights = [
            (point + random.uniform(1, 5) * random_unit(random), random.uniform(1, 20))
            for _ in range(random.integers(1, 4))
        ]
        spheres = []
        for position, _ in lights:
            to_light = position - point
            center = point + random.choice([0.5, 1.5]) * to_light
            if random.random() < 0.4:
                spheres.append((center, 0.2 * math.sqrt(to_light @ to_light)))
        cosines = [abs(unit(position - point) @ normal) for position, _ in lights]
        if min(cosines) < 0.05:
            continue
        blockers = Blockers(spheres, point, normal)
        arguments = (point, normal, random.uniform(0.1, 1.0), lights, blockers)
        yield Case("random lights", "direct_light", arguments)


def _light_picture(f: Functions) -> Vector:
    spheres = [(vector(-0.5, -0.2, 0), 0.6), (vector(0.7, -0.4, 0.6), 0.4)]
    lights = [(vector(2, 3, 2), 22.0), (vector(-2.5, 1.5, 2), 9.0)]

    def colour(x: float, y: float) -> Vector:
        origin, direction = through(x, y)
        nearest, found, normal = INFINITY, None, vector(0, 1, 0)
        if direction[1] < 0.0:
            nearest = (-0.8 - origin[1]) / direction[1]
            found = origin + nearest * direction
        for center, radius in spheres:
            for t in _roots(origin, direction, center, radius)[:1]:
                if t < nearest:
                    nearest, found = t, origin + t * direction
                    normal = (found - center) / radius
        if found is None or nearest > 8.0:
            return BACKGROUND
        # away from the spheres by a little, so that rounding darkens no pixel of the truth
        blockers = Blockers([(c, 0.999 * r) for c, r in spheres], found, normal)
        light = f.direct_light(found, normal, 0.8, lights, blockers)
        return np.full(3, math.sqrt(max(light, 0.0)))

    return scan(colour)


POINT_LIGHT = Exercise(
    name="point_light",
    summary="The light of point lights on a diffuse surface, with shadows",
    task="""
        Sum over the lights: what the surface reflects into every direction, times what
        arrives from the light. No light arrives from behind the surface, and none if
        something lies between.""",
    source="the lecture's slides on direct light; Appel, Some Techniques for Shading "
    "Machine Renderings of Solids, 1968 [Appel1968]",
    functions=(direct_light,),
    hints=(
        "The formula of the lecture has four factors for each light: f, I / r^2, V and the "
        "cosine.",
        "For a diffuse surface f = albedo / pi. The cosine is dot(normal, wi), where wi "
        "points to the light and has length 1.",
        "With that wi the shadow ray goes from t = 1e-4 to r. With to_light = r wi as its "
        "direction it goes to t = 1.",
    ),
    mistakes=mistakes_of("""
        no-falloff: The distance to the light does not matter. | Divide by the square of
            the distance.
        linear-falloff: The light falls with the distance, and not with its square. |
            Divide by the square of the distance; the cosine needs a vector of length 1.
        no-cosine: The angle of the light to the surface does not matter. | Multiply by
            dot(normal, wi).
        light-from-behind (negative-cosine, absolute-cosine): A light behind the surface
            counts. | Leave a light out if dot(normal, wi) is negative.
        no-shadow: Nothing casts a shadow. | Leave a light out if is_blocked(...).
        beyond-the-light: What lies behind the light casts a shadow. | The shadow ray ends
            at the light: t_max is the distance.
        self-shadow: The surface lies in its own shadow. | The shadow ray begins at t_min
            = 1e-4, and not at 0.
        all-dark: One light that is blocked darkens the others. | Go on with the next
            light.
        first-light (first-light, first-lit): Only the first light counts. | Sum over all
            lights; return after the loop.
        no-pi: The result is pi times too large. | The BRDF is albedo / pi.
        four-pi: The intensity is divided by 4 pi. | An intensity is a power for each
            steradian already.
        """),
    cases=_light_cases,
    picture=_light_picture,
)

EXERCISES = (NORMALS, POINT_LIGHT)
