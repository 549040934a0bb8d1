"""`simplified`: a scene with less in it, each step with a name and a sentence.

`--simplify NAME=VALUE` names the same steps; `python -m reports.needs` measures what each
of them loses and saves.
"""

from __future__ import annotations

import dataclasses

from renderer.errors import SceneError
from renderer.scene.simplifications.paths import Step, to_depth
from renderer.scene.simplifications.steps import OF_EACH, SIMPLIFICATIONS
from renderer.scene_file.description import SceneDescription

MOST_DEPTH = 2**31 - 1


def words_of(description: SceneDescription) -> list[str]:
    """Return every `NAME=VALUE` except for `depth=K`, whose values are unlimited."""
    named = {name: one.steps(description) for name, one in OF_EACH.items()}
    of_each = [f"{name}={thing}" for name, steps in named.items() for thing in steps]
    return [*SIMPLIFICATIONS, *of_each]


def is_endless(description: SceneDescription) -> bool:
    """Return whether only roulette ends the paths, so that it cannot be left out."""
    asked = description.integrator
    while asked.nested is not None:
        asked = asked.nested
    return asked.name == "path" and asked.max_depth < 0


def offered(description: SceneDescription) -> tuple[list[str], list[str]]:
    """Return the words (`depth=K` apart) that change the scene, and those that do not.

    Left out are the parts of a single BSDF if no other BSDF has them, and words that would
    be refused: endless paths without roulette, more copies than fit into memory.
    """
    words = words_of(description)
    for name in ("no-specular", "no-diffuse"):
        if len(alone := [word for word in words if word.startswith(name + "=")]) == 1:
            words.remove(alone[0])
    changing: list[str] = []
    absent: list[str] = []
    for word in words:
        try:
            new = simplified(description, word)
        except SceneError:
            continue
        (changing if differs(description, new) else absent).append(word)
    return changing, absent


def simplified(description: SceneDescription, word: str) -> SceneDescription:
    """Return a description with one simplification; `simplified` of it says what that was.

    A scene without the feature stays the same, and its `simplified` says so.

    Raises
    ------
    SceneError
        For a name or a value that does not exist in this scene.
    """
    sentence, step = _found(description, word)
    new = step(description)
    if not differs(description, new):
        sentence += "; the scene has none, nothing changes"
    told = (*description.simplified, f"{word}: {sentence}")
    return dataclasses.replace(new, simplified=told)


def differs(one: SceneDescription, other: SceneDescription) -> bool:
    """Return whether a simplification changed anything except for `simplified`."""
    return not (
        len(one.every_shape) == len(other.every_shape)
        and all(a is b for a, b in zip(one.every_shape, other.every_shape, strict=True))
        and len(one.instances) == len(other.instances)
        and len(one.emitters) == len(other.emitters)
        and all(a is b for a, b in zip(one.emitters, other.emitters, strict=True))
        and one.camera is other.camera
        and one.integrator == other.integrator
    )


def _found(description: SceneDescription, word: str) -> tuple[str, Step]:
    """Return the sentence and the step that a word names."""
    if word in SIMPLIFICATIONS:
        return SIMPLIFICATIONS[word]
    name, equals, value = word.partition("=")
    if not equals:
        raise _unknown(description, word)
    if name == "depth":
        if not (value.isascii() and value.isdigit() and 1 <= int(value) <= MOST_DEPTH):
            raise _refused(description, name, value, [f"1 to {MOST_DEPTH}"])
        return f"paths of at most {value} segments", to_depth(int(value))
    if name in OF_EACH:
        steps = OF_EACH[name].steps(description)
        if value not in steps:
            raise _refused(description, name, value, list(steps) or ["none"])
        return OF_EACH[name].sentence.format(value), steps[value]
    possible = [
        known.removeprefix(f"{name}=")
        for known in SIMPLIFICATIONS
        if known.startswith(f"{name}=")
    ]
    if possible:
        raise _refused(description, name, value, possible)
    raise _unknown(description, word)


def _unknown(description: SceneDescription, word: str) -> SceneError:
    return SceneError(
        f"{description.source}: simplification {word!r} is unknown; there are: "
        f"depth=K, {', '.join(words_of(description))}"
    )


def _refused(
    description: SceneDescription, name: str, value: str, possible: list[str]
) -> SceneError:
    return SceneError(
        f"{description.source}: simplification {name}: {value!r} is not possible; "
        f"possible: {', '.join(possible)}"
    )
