"""All exercises, by the chapters of the lecture."""

from __future__ import annotations

from renderer.exercises.chapters import rays, triangles
from renderer.exercises.exercise import Exercise

CHAPTERS = {
    "Rays and surfaces": (*rays.EXERCISES, *triangles.EXERCISES),
}
EXERCISES = {one.name: one for exercises in CHAPTERS.values() for one in exercises}


def exercise_named(name: str) -> Exercise:
    """Return an exercise.

    Raises
    ------
    KeyError
        If there is none of that name.
    """
    return EXERCISES[name]
