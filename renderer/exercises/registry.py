"""All exercises, by the chapters of the lecture."""

from __future__ import annotations

from renderer.exercises.chapters import (
    boxes_and_grids,
    bsdf,
    bvh,
    cosine_sampling,
    kd_tree,
    mirrors,
    multiple_importance,
    path_tracing,
    rays,
    shading,
    triangles,
)
from renderer.exercises.exercise import Exercise

CHAPTERS = {
    "Rays and surfaces": (*rays.EXERCISES, *triangles.EXERCISES),
    "Shading": shading.EXERCISES,
    "Faster: boxes, grids and trees": (
        *boxes_and_grids.EXERCISES,
        *kd_tree.EXERCISES,
        *bvh.EXERCISES,
    ),
    "Mirrors and glass": mirrors.EXERCISES,
    "All light: Monte Carlo": (
        *cosine_sampling.EXERCISES,
        *multiple_importance.EXERCISES,
        *path_tracing.EXERCISES,
        *bsdf.EXERCISES,
    ),
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
