"""How deep BSDFs and textures may be inside of one another."""

from __future__ import annotations

from renderer.errors import SceneError
from renderer.scene_file.tree import Element


def check_nesting(element: Element, deepest: int) -> None:
    """Refuse an element that holds too many of its tag inside of one another.

    By references alone a file of a few lines can hold 2^30 of them. A loop over all of
    them would never end.

    Raises
    ------
    SceneError
        If there are more than `deepest`.
    """
    depth, level = 0, {id(element): element}
    while level and depth <= deepest:
        depth += 1
        inside = (p.value for e in level.values() for p in e.properties.values())
        level = {
            id(e): e for e in inside if isinstance(e, Element) and e.tag == element.tag
        }
    if depth > deepest:
        raise SceneError(
            f"{element.location}: {element} nests more than {deepest} {element.tag}s; "
            f"at most {deepest} inside of one another are possible"
        )
