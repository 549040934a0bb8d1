"""Three functions for every kind of primitive, resolved by type at compile time.

They have no branch on the kind at run time, so an accelerator is written once for all
kinds.
"""

from __future__ import annotations

from typing import Any

from renderer.kernels.jit import interface


@interface
def primitive_at(group: Any, k: int) -> Any:
    """Return primitive k of a group as scalars."""


@interface
def primitives_from(group: Any, k: int) -> Any:
    """Return primitives k to k + 15 of a group as lanes."""


@interface
def hit_primitive(
    group: Any, primitive: Any, origin: Any, direction: Any, t_max: Any
) -> Any:
    """Intersect a primitive that came from `group`; return an `Intersection`."""
