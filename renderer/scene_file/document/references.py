"""References of a document: to other objects by id, to parameters by `$name`."""

from __future__ import annotations

import re
from collections.abc import Mapping

from renderer.errors import SceneError
from renderer.scene_file.description import Location
from renderer.scene_file.numbers import quoted
from renderer.scene_file.tree import Element, Reference, Tree

# --------------------------------------------------------------------------- references
# Replaces `<ref>` by the referenced elements, and detects cycles.

_DEEPEST = 200  # keeps recursion far below Python's limit


def resolve(tree: Tree) -> Element:
    """Return the root, with each reference replaced by the referenced element.

    An element that is referenced twice is then shared: the tree becomes an acyclic graph.

    Raises
    ------
    SceneError
        If an id does not exist, or references form a cycle.
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


# --------------------------------------------------------------------------- parameters
# `$name` in attributes: values from `<default>`, overridden from outside (-D name=value).
#
# The rules are Mitsuba's: a parameter is replaced wherever its name follows a dollar sign,
# longer names first (`$width2` before `$width`). `\\$` is a plain dollar sign. A
# `<default>` applies to the lines after it. A parameter that is never used is an error.

# Each <default> can double the length of the previous one.
_LONGEST = 1 << 20  # [characters] of a value with a parameter in it
_UNRESOLVED = re.compile(r"(?<!\\)\$([A-Za-z0-9_]*)")


class Parameters:
    """The parameters of one scene, shared by the file and its includes."""

    def __init__(self, given: Mapping[str, object]) -> None:
        self._values = {name: _as_text(value) for name, value in given.items()}
        self._unused = set(self._values)
        self._from_outside = frozenset(self._values)
        self._seen: set[str] = set()  # names with a <default> in the file

    def add_default(self, name: str, value: str) -> None:
        """Set a parameter, unless it has a value."""
        self._values.setdefault(name, value)
        self._seen.add(name)

    def substitute(self, text: str, location: Location) -> str:
        """Return `text` with every parameter replaced by its value.

        Raises
        ------
        SceneError
            If a parameter has no value.
        """
        if "$" not in text:
            return text
        for name in sorted(self._values, key=len, reverse=True):
            pattern = re.compile(r"(?<!\\)\$" + re.escape(name))
            text, count = pattern.subn(self._values[name].replace("\\", r"\\"), text)
            if count and len(text) > _LONGEST:
                raise SceneError(
                    f"{location}: a value with ${name} in it grows to more than {_LONGEST} "
                    "characters"
                )
            if count:
                self._unused.discard(name)
        if unresolved := _UNRESOLVED.search(text):
            known = ", ".join(f"${name}" for name in sorted(self._values)) or "none"
            raise SceneError(
                f"{location}: undefined parameter ${unresolved[1]}; defined here: {known} "
                '(add <default name="..." value="..."/> before this line)'
            )
        return text.replace("\\$", "$")

    def check_all_used(self, source: str) -> None:
        """Refuse given parameters that the scene never used, as in Mitsuba.

        Raises
        ------
        SceneError
            Names them, and the parameters of the file.
        """
        if self._unused:
            unused = ", ".join(
                f"{name}={self._values[name]}" for name in sorted(self._unused)
            )
            known = ", ".join(sorted(self._seen)) or "none"
            raise SceneError(
                f"{source}: no use of the parameter {unused}; the scene has: {known}"
            )


def _as_text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
