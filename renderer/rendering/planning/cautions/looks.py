"""Whether two shapes look the same wherever they lie on one another."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from renderer.kinds.bsdfs.nesting import Structure
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


class Look(NamedTuple):
    """What tells a shape's surface from another's; equal values may still differ by these.

    The direction of brushed materials is not among them.
    """

    values: Any  # of material and light; equal where they are
    one_sided: bool  # it is another one from behind
    textured: bool  # it is another one from place to place


def look_of(shape: Shape) -> Look:
    """Return what a shape looks like."""
    given = (shape.bsdf, shape.radiance)
    textured = any(is_textured(part) for part in _parts(given))
    values = values_of(given)
    if textured:  # the places in a disk's texture are no other shape's
        attributes = shape.attributes if isinstance(shape, Mesh) else {}
        values = values, isinstance(shape, Disk), values_of(attributes)
    return Look(values, shape.radiance is not None or _one_sided(shape.bsdf), textured)


def values_of(look: Any) -> Any:
    """Return something hashable that is equal for equal descriptions, arrays by value."""
    if isinstance(look, Location):
        return None
    if isinstance(look, np.ndarray):
        data = np.ascontiguousarray(look)
        return look.shape, look.dtype.str, hashlib.sha256(data.tobytes()).digest()
    if isinstance(look, tuple | list):
        return tuple(values_of(value) for value in look)
    if (inside := _fields(look)) is not None:
        return type(look), tuple((name, values_of(value)) for name, value in inside.items())
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
        return bool(values_of(bsdf.front) != values_of(bsdf.back))
    if isinstance(bsdf, Mask):
        return _one_sided(bsdf.nested)
    if isinstance(bsdf, Blend):
        return _one_sided(bsdf.first) or _one_sided(bsdf.second)
    kind = kind_of(bsdf)
    return not isinstance(kind, Structure) and not kind.transmits
