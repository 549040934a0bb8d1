"""The interface of a kind of texture."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import interface

# luminance of linear sRGB: what a bitmap of colours returns for one number
LUMINANCE = (0.212671, 0.715160, 0.072169)


class TexturePoint(NamedTuple):
    """Where textures are looked up, in 16 lanes."""

    u: Any  # transformed by the texture's `to_uv`
    v: Any
    prim: Any  # primitive id; None where there is no surface, as in a light's cone
    position: Any  # in the world


class TextureMethods(NamedTuple):
    """The record that the kernels of one kind are given; columns by texture id."""

    table: Any  # of the kind
    to_uv: NDArray[np.float32]  # (6, n) first two rows of the affine map
    nested: Any  # see `look_up.nested_boards`; None in scenes without such checkerboards


def _alike(texture: Any) -> Hashable:
    return None


@dataclass(frozen=True)
class TextureKind:
    """One kind of texture.

    Parameters
    ----------
    name
        Of the plugin in scene files.
    description
        The class of its record in the description.
    read
        (properties, use) -> description; the use decides which colours are possible.
    table
        (descriptions by texture id, None for those that are not in it; scene) -> record
        that the kernels are given.
    table_class
        The class of that record.
    color, scalar
        (table, texture, point, mask) -> RGB or one number, at a `TexturePoint`.
    mean
        (description, mean_of) -> the mean of `scalar`, for what is decided before
        rendering; `mean_of` gives that of a texture inside of it.
    group
        Textures of which this differs have tables of their own, which may be of other
        types, so that a kernel is compiled for each.
    """

    name: str
    description: type
    read: Callable[[Any, Any], Any]
    table: Callable[[list[Any], Any], Any]
    table_class: type
    color: Any
    scalar: Any
    mean: Callable[[Any, Any], float]
    group: Callable[[Any], Hashable] = _alike


@interface
def texture_color(table: Any, texture: Any, point: TexturePoint, mask: Any) -> Any:
    """Return the colours of textures, by id."""


@interface
def texture_scalar(table: Any, texture: Any, point: TexturePoint, mask: Any) -> Any:
    """Return textures as one number, for a roughness, an opacity, ..."""
