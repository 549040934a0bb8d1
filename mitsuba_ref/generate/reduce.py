"""The smallest scene that still shows a difference: parts of it are left out, one by one.

A part may be left out, replaced by what is inside of it, by a simpler plugin, or by a
rounder number, if an oracle says of what is left that it still differs. Whatever no
renderer takes, it says no to. So nothing here knows the grammar.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Callable, Iterator
from xml.etree.ElementTree import Element

from mitsuba_ref.generate.drawing import DrawnScene, number_text

StillDiffers = Callable[[DrawnScene], bool]

MOST = 600
"""Scenes that are tried; a reduction of a usual scene takes 150."""

SIMPLER = {  # plugins by tag, the simplest first
    "bsdf": ("diffuse", "conductor", "dielectric"),
    "sampler": ("independent",),
    "sensor": ("perspective",),
    "shape": ("rectangle", "sphere", "cube"),
    "emitter": ("constant", "point"),
    "integrator": ("direct", "path"),
}
KEPT = {"film", "transform", "sampler", "bsdf", "emitter", "ref", "sample_count"}
"""Tags and names of what stays inside of a plugin that becomes a simpler one."""

_NUMBER = re.compile(r"-?\d+\.?\d*(?:e-?\d+)?")


def reduce_scene(
    scene: DrawnScene, still_differs: StillDiffers, most: int = MOST
) -> DrawnScene:
    """Return a scene of which no part can be left out.

    Parameters
    ----------
    scene
        It differs.
    still_differs
        The oracle.
    most
        How many scenes are tried; then the smallest so far is returned.
    """
    left = [most]

    def accept(candidate: DrawnScene) -> bool:
        left[0] -= 1
        return left[0] >= 0 and still_differs(candidate)

    while True:
        before = size_of(scene)
        for candidates in (
            _without_elements,
            _with_inner,
            _simpler_plugins,
            _smaller_files,
            _rounder_numbers,
        ):
            scene = _descend(scene, candidates, accept)
        if left[0] < 0 or size_of(scene) >= before:
            return _used_files(scene)


def size_of(scene: DrawnScene) -> int:
    """Return how large a scene is: elements, characters of values, bytes of files."""
    elements = list(scene.root.iter())
    text = sum(len(v) for e in elements for key, v in e.attrib.items() if key != "type")
    content = sum(map(len, _used_files(scene).files.values()))
    return 20 * len(elements) + text + content + sum(map(_complexity, elements))


def _complexity(element: Element) -> int:
    """Return how far a plugin is from the simplest one of its tag."""
    simpler = SIMPLER.get(element.tag, ())
    plugin = element.get("type", "")
    return simpler.index(plugin) if plugin in simpler else len(simpler)


def _descend(
    scene: DrawnScene,
    candidates: Callable[[DrawnScene, int], Iterator[DrawnScene]],
    accept: Callable[[DrawnScene], bool],
) -> DrawnScene:
    """Go through the places of a scene; at each keep the first smaller one that differs."""
    place = 0
    while place < sum(1 for _ in scene.root.iter()):
        size = size_of(scene)
        for candidate in candidates(scene, place):
            if size_of(candidate) < size and accept(candidate):
                scene = candidate
                break
        else:
            place += 1
    return scene


def _edited(scene: DrawnScene, place: int) -> tuple[DrawnScene, Element, Element | None]:
    """Return a copy, its element at a place of the document's order, and the parent."""
    root = copy.deepcopy(scene.root)
    element = list(root.iter())[place]
    parents = {child: parent for parent in root.iter() for child in parent}
    return DrawnScene(root, dict(scene.files)), element, parents.get(element)


def _without_elements(scene: DrawnScene, place: int) -> Iterator[DrawnScene]:
    candidate, element, parent = _edited(scene, place)
    if parent is not None:
        parent.remove(element)
        yield candidate


def _with_inner(scene: DrawnScene, place: int) -> Iterator[DrawnScene]:
    """Yield scenes with an element replaced by one inside of it, of the same tag."""
    count = len(list(scene.root.iter())[place])
    for k in range(count):
        candidate, element, parent = _edited(scene, place)
        inner = element[k]
        if parent is None or inner.tag != element.tag:
            continue
        inner.attrib.pop("name", None)
        if "name" in element.attrib:
            inner.set("name", element.attrib["name"])
        parent[list(parent).index(element)] = inner
        yield candidate


def _simpler_plugins(scene: DrawnScene, place: int) -> Iterator[DrawnScene]:
    original = list(scene.root.iter())[place]
    if "type" not in original.attrib:
        return
    if original.tag in ("texture", "spectrum") and "name" in original.attrib:
        candidate, element, parent = _edited(scene, place)
        assert parent is not None
        plain = Element("float", name=element.attrib["name"], value="0.5")
        parent[list(parent).index(element)] = plain
        yield candidate
    for plugin in SIMPLER.get(original.tag, ()):
        if plugin == original.get("type"):
            return  # those after it are not simpler
        candidate, element, _ = _edited(scene, place)
        element.set("type", plugin)
        for child in list(element):
            if not {child.tag, child.get("name")} & KEPT:
                element.remove(child)
        yield candidate


def _smaller_files(scene: DrawnScene, place: int) -> Iterator[DrawnScene]:
    """Yield scenes whose text files of faces have one face less."""
    element = list(scene.root.iter())[place]
    name = element.get("value", "")
    if element.get("name") != "filename" or not name.endswith(".obj"):
        return
    lines = scene.files.get(name, b"").splitlines(keepends=True)
    faces = [k for k, line in enumerate(lines) if line.startswith(b"f ")]
    if len(faces) < 2:
        return
    for k in faces:
        rest = b"".join(lines[:k] + lines[k + 1 :])
        yield DrawnScene(copy.deepcopy(scene.root), scene.files | {name: rest})


def _rounder_numbers(scene: DrawnScene, place: int) -> Iterator[DrawnScene]:
    original = list(scene.root.iter())[place]
    for key, value in original.attrib.items():
        if original.tag == "string" or key in ("type", "name", "id", "version"):
            continue
        for match in _NUMBER.finditer(value):
            for number in _rounder(match[0]):
                candidate, element, _ = _edited(scene, place)
                text = value[: match.start()] + number + value[match.end() :]
                element.set(key, text)
                yield candidate


def _rounder(text: str) -> Iterator[str]:
    """Yield shorter texts of numbers near one."""
    x = float(text)
    yield from ("0", "1", "0.1")
    if "." not in text and "e" not in text:
        yield str(int(x) // 2)
    # digits, not decimals: some scenes are a hundredth as large
    yield from (f"{x:.0f}", *(number_text(float(f"{x:.{n}g}")) for n in (1, 2)))


def _used_files(scene: DrawnScene) -> DrawnScene:
    named = {e.get("value") for e in scene.root.iter()}
    used = {name: content for name, content in scene.files.items() if name in named}
    return DrawnScene(scene.root, used)
