"""A path tracer: one estimate of the light along a ray."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from renderer.exercises.answers import Estimate
from renderer.exercises.exercise import (
    RIGHT,
    Case,
    Exercise,
    Functions,
    Variants,
    mistakes_of,
)
from renderer.exercises.pictures import scan
from renderer.exercises.vectors import Vector, cross, unit, vector


class Hit(NamedTuple):
    """A point of a surface."""

    x: Vector
    normal: Vector
    albedo: float
    emission: float


@dataclass(frozen=True)
class Room:
    """The inside of the unit sphere: two halves, and perhaps a hole at the top."""

    albedo: tuple[float, float]  # where z < 0, and where z >= 0
    emission: tuple[float, float]  # where z < bright, and where z >= bright
    hole: float = 2.0  # there is no wall above this z
    bright: float = 0.0

    def __call__(self, origin: Vector, direction: Vector) -> Hit | None:
        """Return where a ray meets the wall."""
        a, b = float(direction @ direction), float(origin @ direction)
        c = float(origin @ origin) - 1.0
        t = (-b + math.sqrt(max(b * b - a * c, 0.0))) / a
        x = origin + t * direction
        # from a wall, into what is behind it
        if t < 1e-4 or x[2] > self.hole:
            return None
        x = x / math.sqrt(x @ x)
        albedo = self.albedo[int(x[2] >= 0.0)]
        return Hit(x, -x, albedo, self.emission[int(x[2] >= self.bright)])


def path_radiance(
    origin: Vector,
    direction: Vector,
    closest_hit: Callable[[Vector, Vector], Hit | None],
    random: Callable[[], float],
    bounces: int,
    *,
    variants: Variants = RIGHT,
) -> float:
    """Return an estimate of the light that arrives along a ray, by one path.

    Parameters
    ----------
    origin, direction : ndarray of shape (3,)
        The ray; the direction has length 1. The light travels against it.
    closest_hit : function
        closest_hit(origin, direction) gives the nearest surface, or None if there is none
        and no light. A surface has the attributes x and normal (ndarrays of shape (3,); the
        normal has length 1 and is on the side of the ray), albedo in [0, 1], and emission,
        its radiance in W/(m^2 sr). It reflects diffusely. A ray that starts at x does not
        meet x.
    random : function
        random() gives a new number in [0, 1).
    bounces : int
        How often the light may be reflected. With 0 only emission is seen.

    Returns
    -------
    float
        The estimate, in W/(m^2 sr). Its mean over many calls is the radiance.
    """
    found, throughput = 0.0, 1.0
    if "one-bounce-fewer" in variants:
        bounces -= 1
    if "one-bounce-more" in variants:
        bounces += 1
    for bounce in range(bounces + 1):
        hit = closest_hit(origin, direction)
        if hit is None:
            break
        seen = throughput * hit.emission
        if ("first-emission-only" in variants and bounce > 0) or (
            "no-first-emission" in variants and bounce == 0
        ):
            seen = 0.0
        if "no-throughput" in variants:
            seen = hit.emission
        found = seen if "last-emission-only" in variants else found + seen
        direction, weight = _scatter(hit.normal, random, variants)
        if "no-albedo" not in variants:
            weight *= hit.albedo
        throughput = weight if "last-albedo-only" in variants else throughput * weight
        origin = hit.x
    return found


def _scatter(
    normal: Vector, random: Callable[[], float], variants: Variants
) -> tuple[Vector, float]:
    """Return a direction, and pi f cos / (albedo pdf)."""
    u1, angle = random(), 2.0 * math.pi * random()
    uniform = variants & {"uniform-no-cosine", "uniform-pdf-cosine", "uniform-half"}
    z = 1.0 - u1 if uniform else math.sqrt(1.0 - u1)
    if "whole-sphere" in variants:
        z = 1.0 - 2.0 * u1
    r = math.sqrt(1.0 - z * z)
    aside = vector(1, 0, 0) if abs(normal[0]) < 0.6 else vector(0, 1, 0)
    s = unit(cross(normal, aside))
    if "around-z" in variants:
        s, normal = vector(1, 0, 0), vector(0, 0, 1)
    t = cross(normal, s)
    weight = 1.0
    if "extra-cosine" in variants:
        weight = z
    if "extra-two-cosines" in variants:
        weight = 2.0 * z
    if "uniform-no-cosine" in variants:
        weight = 2.0
    if "uniform-half" in variants:
        weight = z
    if "over-pi" in variants:
        weight /= math.pi
    if "times-pi" in variants:
        weight *= math.pi
    direction: Vector = r * math.cos(angle) * s + r * math.sin(angle) * t + z * normal
    return direction, weight


def _mean(
    f: Functions, room: Room, start: tuple[Vector, Vector], bounces: int, count: int
) -> Estimate:
    """Return the mean of some paths, and its standard deviation."""
    random = np.random.default_rng(count + bounces).random
    values = np.array(
        [
            float(f.path_radiance(start[0].copy(), start[1].copy(), room, random, bounces))
            for _ in range(count)
        ]
    )
    error = float(values.std()) / math.sqrt(len(values) - 1.0)
    return Estimate(float(values.mean()), error)


def _leave_outwards(f: Functions, start: tuple[Vector, Vector]) -> bool:
    room, random = PATH_CASES[0][1], np.random.default_rng(0).random
    outwards = []

    def closest_hit(origin: Vector, direction: Vector) -> Hit | None:
        on_wall = float(origin @ origin) > 1.0 - 1e-6
        outwards.append(not on_wall or float(direction @ origin) < 1e-9)
        return room(origin, direction)

    for _ in range(30):
        f.path_radiance(start[0].copy(), start[1].copy(), closest_hit, random, 2)
    return all(outwards)


PATH_CASES = (  # on paper: L = e + a M_n, with M_n = mean(e) + mean(a) M_(n - 1), M_0 = 0
    ("emission alone, no reflection", Room((0.5, 0.5), (1.0, 1.0)), 0),
    ("one reflection where all shines alike", Room((0.5, 0.5), (1.0, 1.0)), 1),
    ("two reflections where all shines alike", Room((0.5, 0.5), (1.0, 1.0)), 2),
    ("five reflections where all shines alike", Room((0.8, 0.8), (1.0, 1.0)), 5),
    ("no reflection, and light from above alone", Room((0.6, 0.6), (0.0, 1.0)), 0),
    ("one reflection, light from above alone", Room((0.6, 0.6), (0.0, 1.0)), 1),
    ("three reflections, a dark half and a bright one", Room((0.2, 0.9), (0.0, 1.0)), 3),
    ("three reflections, a bright half and a dark one", Room((0.9, 0.2), (0.0, 1.0)), 3),
    ("a room with a hole, three reflections", Room((0.9, 0.9), (1.0, 1.0), 0.5), 3),
    ("one reflection, a dark floor", Room((0.9, 0.9), (0.0, 1.0), 2.0, -0.6), 1),
)


def _path_cases(random: Generator) -> Iterator[Case]:
    down = (vector(0, 0, 0.3), vector(0.6, 0, -0.8))
    for about, room, bounces in PATH_CASES:
        count = 400 if room.bright else 200  # enough to tell the cosine from none
        yield Case(
            f"the mean of {count} paths: {about}",
            "path_radiance",
            measure=partial(_mean, room=room, start=down, bounces=bounces, count=count),
        )
    yield Case(
        "whether all rays leave a surface on the side of its normal",
        "path_radiance",
        measure=partial(_leave_outwards, start=down),
    )
    away = (vector(0, 0, 0.3), vector(0, 0, 1))
    yield Case(
        "a ray that meets nothing",
        "path_radiance",
        measure=lambda f: f.path_radiance(*away, PATH_CASES[-2][1], lambda: 0.5, 3),
    )


def _in_the_box(origin: Vector, direction: Vector) -> Hit:
    """Return what a ray meets in a cube with a bright ceiling and a ball in it."""
    o, d = origin.tolist(), direction.tolist()
    walls = ((math.copysign(1.0, d[k]), k) for k in range(3) if d[k])
    t, k = min(((side - o[k]) / d[k], k) for side, k in walls)
    center, radius = (0.2, -0.55, 0.1), 0.45
    from_center = [a - b for a, b in zip(o, center, strict=True)]
    b = sum(x * y for x, y in zip(from_center, d, strict=True))
    discriminant = b * b - sum(x * x for x in from_center) + radius * radius
    if discriminant > 0.0 and 1e-4 < (near := -b - math.sqrt(discriminant)) < t:
        x = origin + near * direction
        return Hit(x, (x - center) / radius, 0.9, 0.0)
    x = origin + t * direction
    normal = np.zeros(3)
    normal[k] = -math.copysign(1.0, d[k])
    lamp = k == 1 and d[1] > 0.0
    return Hit(x, normal, 0.3 if k == 0 and d[0] < 0.0 else 0.8, 1.0 if lamp else 0.0)


def _path_picture(f: Functions) -> Vector:
    random = np.random.default_rng(11).random
    eye = vector(0, 0, 0.98)

    def colour(x: float, y: float) -> Vector:
        direction = unit(vector(x, y, -1.2))
        paths = [f.path_radiance(eye, direction, _in_the_box, random, 3) for _ in range(10)]
        return np.full(3, math.sqrt(max(0.0, sum(paths) / 10.0)))

    return scan(colour, 28, 28)


PATH = Exercise(
    name="path",
    summary="A path tracer: one estimate of the light along a ray",
    task="""
        The light that leaves a surface is what it emits, and what it reflects. Take the
        emission, then choose one direction at random and go on with the light from there.
        The throughput is the product of f cos / pdf along the path. Any density of
        directions is right that leaves none out.

        The check compares means of 200 to 400 paths. A right file fails by chance in fewer
        than 1 of 10,000 cases.""",
    source="Kajiya, The Rendering Equation, 1986 [Kajiya1986]; the lecture's rendering "
    "equation",
    functions=(path_radiance,),
    hints=(
        "In a loop over bounces: meet the scene, add throughput times emission, choose a "
        "direction around the normal, multiply the throughput.",
        "f = albedo / pi. With directions of density cos / pi the factor f cos / pdf is "
        "the albedo; with equally likely ones it is 2 albedo cos.",
        "With bounces = 0 the loop meets the scene once, with 1 twice: "
        "for bounce in range(bounces + 1).",
    ),
    mistakes=mistakes_of("""
        bounces (one-bounce-fewer, one-bounce-more): The light is reflected once too few
            or too often. | With bounces = 0 the scene is met once, with 1 twice.
        first-emission-only: Only the first surface's light is added. | Add throughput
            times emission at every surface.
        no-first-emission: The light of the first surface is missing. | Emission is added
            before the direction is chosen, at the first surface too.
        last-emission-only: Only the last surface's light is returned. | Add to the sum;
            do not replace it.
        last-albedo-only: The throughput is that of the last surface alone. | Multiply the
            throughput; do not replace it.
        no-albedo (no-albedo, no-throughput): No light is absorbed on the way. | Multiply
            the throughput with the albedo, and the emission with the throughput.
        extra-cosine (extra-cosine, extra-two-cosines): The cosine counts twice: in the
            density of directions, and as a factor. | With pdf = cos / pi it cancels; the
            factor 2 cos is that of equally likely directions.
        other-pdf (uniform-no-cosine, uniform-pdf-cosine, uniform-half): The factor is not
            the one of the directions, which are equally likely. | Their pdf is 1 / (2
            pi), and so f cos / pdf = 2 albedo cos.
        pi (over-pi, times-pi): A factor of pi is wrong at each reflection. | f = albedo /
            pi, and pdf = cos / pi: pi cancels.
        around-z: Directions are chosen around the z axis. | Build a frame around the
            normal.
        whole-sphere: Directions go into the surface. | Choose from the half sphere around
            the normal.
        """),
    cases=_path_cases,
    picture=_path_picture,
    slow=True,
)

EXERCISES = (PATH,)
