"""The interfaces of a kind of texture."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import interface

# luminance of linear sRGB: a colour bitmap as a scalar
LUMINANCE = (0.212671, 0.715160, 0.072169)


class TexturePoint(NamedTuple):
    """Points of look-ups, in 16 lanes."""

    u: Any  # transformed by the texture's `to_uv`
    v: Any
    prim: Any  # primitive id; None where there is no surface, as for a spot light
    position: Any  # in the world


class TextureMethods(NamedTuple):
    """Record that is passed to the kernels of one kind; columns by texture id."""

    table: Any  # table of the kind
    to_uv: NDArray[np.float32]  # (6, n) first two rows of the affine matrix
    nested: Any  # see `look_up.nested_boards`; None without nested checkerboards


def _alike(texture: Any) -> Hashable:
    return None


@dataclass(frozen=True)
class TextureKind:
    """One kind of texture.

    Parameters
    ----------
    name
        Name of the plugin in scene files.
    description
        Class of the scene description.
    read
        (properties, use) -> description; `use` limits the possible colours.
    table
        (descriptions by texture id, None for those of other tables; scene) -> the table.
    table_class
        Class of the table.
    color, scalar
        Kernels (table, texture, point, mask) -> RGB or scalar at a `TexturePoint`.
    mean
        (description, mean_of) -> the mean of `scalar`, for decisions before rendering;
        `mean_of` returns that of a nested texture.
    group
        description -> key. Textures with different keys are in different tables, perhaps
        of other types, for which kernels are compiled separately.
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
    """Return textures as scalars, for a roughness, an opacity, ..."""
