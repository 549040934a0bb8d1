"""Mistakes that change how a scene is rendered: each is rendered, and compared.

A mistake in reading the scene is an edit of its description, rendered by our renderer. One
in the algorithm is a mutation: a copy of our renderer that has it renders in a process of
its own, once for each scene, and compiles for some seconds. `mistakes.toml` has their
sentences.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import renderer
from mitsuba_ref.diagnosis.image_mistakes import Floats, Prediction, told
from mitsuba_ref.mutations.defects.catalogue import CATALOGUE, read_mutations
from mitsuba_ref.mutations.mutant import Mutant, MutantError
from mitsuba_ref.mutations.mutation import Mutation
from mitsuba_ref.records.request import RenderRequest
from renderer.advice.simplifications import simplified
from renderer.errors import SceneError
from renderer.scene.scene import build_scene
from renderer.scene_file.description import PerspectiveCamera, SceneDescription

TABLE = Path(__file__).with_name("mistakes.toml")
DEEPEST = 6  # segments: more bounces than that are hardly told apart


@dataclass(frozen=True)
class AlgorithmMistake:
    """A row of mistakes.toml: a mutation, and what a user reads."""

    name: str
    mutation: Mutation
    sentence: str
    advice: str


def _has(part: str) -> Callable[[SceneDescription], bool]:
    """Return whether the kinds of a scene's materials and shapes name something."""
    return lambda scene: part in _kinds(scene)


FEATURES: dict[str, Callable[[SceneDescription], bool]] = {
    "lights": lambda scene: bool(scene.emitters) or _emits(scene),
    "area lights": lambda scene: _emits(scene),
    "several lights": lambda scene: len(scene.emitters) + _lamps(scene) > 1,
    "bounces": lambda scene: not 0 <= scene.integrator.max_depth <= 2,
    "roulette": lambda scene: scene.integrator.rr_depth < _depth(scene),
    "normals": _has("vertex normals"),
    "textures": _has("Bitmap"),
    "glass": _has("Dielectric"),
    "instances": lambda scene: bool(scene.instances),
}


def _depth(scene: SceneDescription) -> float:
    depth = scene.integrator.max_depth
    return math.inf if depth < 0 else depth


def _emits(scene: SceneDescription) -> bool:
    return _lamps(scene) > 0


def _lamps(scene: SceneDescription) -> int:
    return sum(getattr(s, "radiance", None) is not None for s in scene.every_shape)


def _kinds(scene: SceneDescription) -> str:
    """Return the names of all classes in the materials of a scene, and of normals."""
    words = [repr(shape.bsdf) for shape in scene.every_shape]
    if any(getattr(shape, "normals", None) is not None for shape in scene.every_shape):
        words.append("vertex normals")
    return " ".join(words)


def algorithm_mistakes(scene: SceneDescription) -> list[AlgorithmMistake]:
    """Return the mistakes that can show in a scene, in the order of the table."""
    edits = read_mutations(TABLE.with_name("mistakes_edits.toml"))
    own = {mutation.name: mutation for mutation in (*CATALOGUE, *edits)}
    rows = tomllib.loads(TABLE.read_text(encoding="utf-8"))["mistakes"]
    return [
        AlgorithmMistake(
            name, own[row.get("mutation", name)], row["sentence"], row["advice"]
        )
        for name, row in rows.items()
        if all(FEATURES[need](scene) for need in row.get("needs", ()))
    ]


def reading_mistakes(scene: SceneDescription) -> Iterator[tuple[str, str, str, Any]]:
    """Yield (name, sentence, advice, edited scene) of scenes that were read wrongly."""
    integrator, depth = scene.integrator, scene.integrator.max_depth
    has_depth = integrator.name in ("path", "whitted")
    depths = {*range(1, DEEPEST + 1), depth - 1, depth + 1} if has_depth else set()
    for other in sorted(one for one in depths if one > 0):
        if other != depth and (other < depth or depth < 0 or other == depth + 1):
            name = (
                "one-bounce-fewer"
                if other == depth - 1
                else "one-bounce-more"
                if other == depth + 1
                else "depth-limited"
            )
            segments = f"{other} segment{'s' if other > 1 else ''}"
            limit = "no limit" if depth < 0 else depth
            text = told(name, "other-depth", segments=segments, limit=limit)
            yield *text, replace(scene, integrator=replace(integrator, max_depth=other))
    camera = scene.camera
    if isinstance(camera, PerspectiveCamera) and camera.film.width != camera.film.height:
        aspect = camera.film.width / camera.film.height
        half = math.tan(math.radians(camera.fov_x) / 2.0)
        for factor, axis in ((aspect, "height"), (1.0 / aspect, "width")):
            fov = math.degrees(2.0 * math.atan(half * factor))
            edited = replace(scene, camera=replace(camera, fov_x=fov))
            yield *told("fov-axis", axis=axis), edited
    for word, name in (
        ("normals=flat", "normals-not-interpolated"),
        ("textures=mean", "textures-missing"),
    ):
        try:
            edited = simplified(scene, word)
        except SceneError:
            continue
        if "nothing changes" not in edited.simplified[-1]:
            yield *told(name), edited
    for number, emitter in enumerate(scene.emitters[:8]):
        others = [one for one in scene.emitters if one is not emitter]
        text = told("light-missing", number=number + 1, kind=type(emitter).__name__)
        yield *text, replace(scene, emitters=tuple(others))
    lamps = [
        shape for shape in scene.shapes if getattr(shape, "radiance", None) is not None
    ]
    for lamp in lamps[:8]:
        dark = [replace(one, radiance=None) if one is lamp else one for one in scene.shapes]
        text = told("light-missing", "lamp-missing", shape=lamp.id or lamp.location)
        yield *text, replace(scene, shapes=tuple(dark))


def render_reading_mistakes(
    scene: SceneDescription, spp: int, seed: int
) -> Iterator[Prediction]:
    """Render scenes that were read wrongly; a refused one is left out."""
    for name, sentence, advice, edited in reading_mistakes(scene):
        try:
            image = renderer.render(build_scene(edited), spp=spp, seed=seed)
        except SceneError:
            continue
        yield Prediction(name, sentence, advice, np.asarray(image, np.float64))


def render_algorithm_mistake(
    mistake: AlgorithmMistake, request: RenderRequest
) -> Prediction | None:
    """Render a scene with a copy of our renderer that has a mistake; None if it fails."""
    with Mutant(mistake.mutation) as mutant:
        try:
            pixels: Floats = mutant.render(request).pixels.astype(np.float64)
        except (MutantError, SceneError):
            return None
    return Prediction(mistake.name, mistake.sentence, mistake.advice, pixels)
