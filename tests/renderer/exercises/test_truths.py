"""The right functions against the simple renderer, and against answers on paper."""

from __future__ import annotations

import math

import numpy as np
import pytest
from student_solutions import SOLUTIONS

from renderer.exercises.answers import CERTAIN
from renderer.exercises.chapters.path_tracing import PATH_CASES
from renderer.exercises.exercise import RIGHT
from renderer.exercises.judge import answers_of
from renderer.exercises.registry import EXERCISES
from renderer.scene_file import read_dict
from renderer.scene_file.description import Mesh, Sphere
from renderer.scene_file.transform_functions import look_at
from renderer.simple.bsdfs import fresnel, reflect, refract
from renderer.simple.camera import camera_ray
from renderer.simple.shapes import UNIT_SHAPES


def calls(exercise: str, function: str = ""):
    """Return arguments and right answers of the calls of an exercise."""
    found = EXERCISES[exercise]
    return [
        (case.arguments, answer)
        for case, answer in zip(found.questions(), answers_of(found, RIGHT), strict=True)
        if case.measure is None and case.function.startswith(function)
    ]


def test_the_sphere_is_that_of_the_simple_renderer():
    for (origin, direction, center, radius, t_min, t_max), found in calls("sphere"):
        with np.errstate(invalid="ignore"):
            p, d = (origin - center) / radius, direction / radius
            roots = UNIT_SHAPES[Sphere].roots(p[None], d[None])[0]
        counting = [t for t in roots if t_min < t < t_max]
        assert found == pytest.approx(min(counting)) if counting else found is None


@pytest.mark.parametrize("exercise", ["triangle", "barycentric"])
def test_the_triangle_is_that_of_the_simple_renderer(exercise):
    met = 0
    for (origin, direction, p1, p2, p3, t_min, t_max), found in calls(exercise):
        frame = np.column_stack([p2 - p1, p3 - p1, np.cross(p2 - p1, p3 - p1)])
        p, d = (np.linalg.pinv(frame) @ v for v in (origin - p1, direction))
        if abs(d[2]) < 1e-12 or np.linalg.det(frame) == 0.0:
            assert found is None
            continue
        t = UNIT_SHAPES[Mesh].roots(p[None], d[None])[0, 0]
        u, v, _ = p + t * d
        hit = UNIT_SHAPES[Mesh].contains(u, v, 0.0) and t_min < t < t_max
        assert (found is not None) == hit
        if hit:
            met += 1
            uv = found[1:] if exercise == "triangle" else found[2:]
            assert [found[0], *uv] == pytest.approx([t, u, v], abs=1e-9)
    assert met > 20


def test_the_camera_is_that_of_the_simple_renderer():
    checked = 0
    for (x, y, width, height, origin, target, up, fov), found in calls("camera")[:60]:
        if found is True:
            continue
        scene = {
            "type": "scene",
            "sensor": {
                "type": "perspective",
                "fov": fov,
                "to_world": look_at(origin, target, up),
                "film": {"type": "hdrfilm", "width": width, "height": height},
            },
        }
        _, direction, *_ = camera_ray(read_dict(scene).camera, x, y, (0.0, 0.0))
        assert found == pytest.approx(direction, abs=1e-6)
        checked += 1
    assert checked > 25


def test_mirrors_and_glass_are_those_of_the_simple_renderer():
    for (d, n), found in calls("refraction", "reflect"):
        assert found == pytest.approx(reflect(-d, n))
    for (d, n, eta), found in calls("refraction", "refract"):
        if found is None:
            assert eta * math.sqrt(1.0 - (d @ n) ** 2) > 1.0
        else:
            assert found == pytest.approx(refract(-d, n, 1.0 / eta), abs=1e-9)
    for (cos_i, eta), found in calls("fresnel"):
        assert found == pytest.approx(float(fresnel(cos_i, 1.0 / eta)), abs=1e-9)


def test_the_light_of_a_room_is_known_on_paper():
    """In a sphere each point sees all others alike [Pharr2023], so that the light is a sum.

    With e and a where the ray ends, and m(e), m(a) the means over the sphere, n reflections
    give e + a M_n, where M_n = m(e) + m(a) M_(n - 1) if emission and albedo do not depend
    on one another.
    """
    exercise = EXERCISES["path"]
    checked = 0
    for (_, room, bounces), found in zip(
        PATH_CASES, answers_of(exercise, RIGHT), strict=False
    ):
        bright = (1.0 - room.bright) / 2.0
        e = room.emission[0] * (1.0 - bright) + room.emission[1] * bright
        same = len({*room.albedo}) == 1 or len({*room.emission}) == 1
        if room.hole < 1.0 or not same:
            continue
        # the ray ends at z = -0.65
        light = sum(e * room.albedo[0] ** k for k in range(bounces))
        expected = room.emission[int(room.bright < -0.65)] + room.albedo[0] * light
        assert abs(found["mean"] - expected) <= CERTAIN * found["error"] + 1e-9
        checked += 1
    assert checked == 7


def test_half_of_the_exercises_have_two_right_solutions():
    """In other forms than ours, so that the check does not require ours."""
    assert SOLUTIONS.keys() == EXERCISES.keys()
    assert sum(len(sources) >= 2 for sources in SOLUTIONS.values()) >= len(EXERCISES) / 2
