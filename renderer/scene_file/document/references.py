"""Puts the referenced elements in the place of `<ref>`, and finds circles."""

from __future__ import annotations

from renderer.errors import SceneError
from renderer.scene_file.numbers import quoted
from renderer.scene_file.tree import Element, Reference, Tree

_DEEPEST = 200  # keeps the recursive readers far from Python's limit


def resolve(tree: Tree) -> Element:
    """Return the root, with the referenced element as the value of each reference.

    An element that is referenced twice then stands in two places: the tree has become a
    graph, without circles.

    Raises
    ------
    SceneError
        If an id does not exist, or following the references would never end.
    """
    done: set[int] = set()
    _resolve(tree.root, tree.elements, done, [])
    return tree.root


def _resolve(
    element: Element, elements: dict[str, Element], done: set[int], chain: list[Element]
) -> None:
    if id(element) in done:
        return
    if len(chain) >= _DEEPEST:
        raise SceneError(
            f"{element.location}: more than {_DEEPEST} elements inside each other by <ref>"
        )
    chain.append(element)
    for property_ in element.properties.values():
        value = property_.value
        if isinstance(value, Reference):
            if value.id not in elements:
                known = ", ".join(sorted(elements)) or "none"
                raise SceneError(
                    f"{property_.location}: <ref> to the unknown id {quoted(value.id)}; "
                    "ids in "
                    f"this scene: {known}"
                )
            value = property_.value = elements[value.id]
        if isinstance(value, Element):
            if value in chain:
                circle = [*chain[chain.index(value) :], value]
                names = " -> ".join(e.id or str(e) for e in circle)
                raise SceneError(f"{property_.location}: cyclic <ref>: {names}")
            _resolve(value, elements, done, chain)
    chain.pop()
    done.add(id(element))
