"""What the emitters of scene files share: where they are."""

from __future__ import annotations

from typing import Any

STRETCH = 1e-4  # relative difference of two axes that counts as rounding


def one_of(properties: Any, name: str) -> None:
    """Refuse a property that is given together with `to_world`, which replaces it."""
    if properties.has(name) and properties.has("to_world"):
        properties.fail(name, 'a value beside "to_world"', "one of the two")
