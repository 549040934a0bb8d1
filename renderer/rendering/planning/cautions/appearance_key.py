"""Whether two shapes look the same wherever they lie on one another."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from renderer.scene.materials import is_textured, kind_of
from renderer.scene_file.description import (
    Blend,
    Disk,
    Location,
    Mask,
    Mesh,
    Shape,
    TwoSided,
)

Digests = dict[int, bytes]  # of arrays by their id, as long as their scene lives


class Look(NamedTuple):
    """What tells a shape's surface from another's; equal values may still differ by these.

    The direction of brushed materials is not among them.
    """

    values: Any  # of material and light; equal where they are
    one_sided: bool  # it is another one from behind
    textured: bool  # it is another one from place to place


def look_of(shape: Shape, digests: Digests) -> Look:
    """Return what a shape looks like; `digests` is filled, for images that shapes share."""
    given = (shape.bsdf, shape.radiance)
    textured = any(is_textured(part) for part in _parts(given))
    values = values_of(given, digests)
    if textured:  # the places in a disk's texture are no other shape's
        attributes = shape.attributes if isinstance(shape, Mesh) else {}
        values = values, isinstance(shape, Disk), values_of(attributes, digests)
    return Look(values, shape.radiance is not None or _one_sided(shape.bsdf), textured)


def values_of(look: Any, digests: Digests) -> Any:
    """Return something hashable that is equal for equal descriptions, arrays by value."""
    if isinstance(look, Location):
        return None
    if isinstance(look, np.ndarray):
        if id(look) not in digests:
            digests[id(look)] = hashlib.sha256(look.tobytes()).digest()
        return look.shape, look.dtype.str, digests[id(look)]
    if isinstance(look, tuple | list):
        return type(look), tuple(values_of(value, digests) for value in look)
    if (inside := _fields(look)) is not None:
        values = ((name, values_of(value, digests)) for name, value in inside.items())
        return type(look), tuple(values)
    try:
        hash(look)
    except TypeError:  # of a plugin that is not ours
        return id(look)
    return look


def _fields(look: Any) -> Mapping[Any, Any] | None:
    if dataclasses.is_dataclass(look):
        return {f.name: getattr(look, f.name) for f in dataclasses.fields(look)}
    return look if isinstance(look, Mapping) else None


def _parts(look: Any) -> Iterator[Any]:
    """Yield a description and all that is in it."""
    yield look
    inside = _fields(look)
    for value in inside.values() if inside is not None else ():
        yield from _parts(value)
    if isinstance(look, tuple | list):
        for value in look:
            yield from _parts(value)


def _one_sided(bsdf: Any) -> bool:
    """Return whether a BSDF is known to look another way from behind.

    Of what lets light through, nothing is known here.
    """
    if isinstance(bsdf, TwoSided):
        if bsdf.front is bsdf.back:
            return False
        digests: Digests = {}
        return bool(values_of(bsdf.front, digests) != values_of(bsdf.back, digests))
    if isinstance(bsdf, Mask):
        return _one_sided(bsdf.nested)
    if isinstance(bsdf, Blend):
        return _one_sided(bsdf.first) or _one_sided(bsdf.second)
    kind = kind_of(bsdf)
    return not kind.both_sides
