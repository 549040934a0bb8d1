"""A kind of shape outside of kernels: from the description to its tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class ShapeKind:
    """One kind of shape; its kernels implement the interfaces of this folder.

    Parameters
    ----------
    name
        Of its primitives, in the plural.
    description
        The class of the scene's description.
    surfaces
        (shapes, first primitive id) -> the record that surface points come from.
    orientation
        shape -> -1 where its normal is opposite to the one that the kernels compute.
    corners
        record -> arrays (3, n) of points whose box holds each primitive.
    hull
        (record, columns) -> points (3, 4, n), radius (n,) and normal (3, n): a primitive
        lies in the hull of the points, grown by the radius, and in the plane across the
        normal (0 where it is not flat).
    areas
        (record, columns) -> surface areas (n,), float64.
    group
        (record, columns, padded ids, padding) -> the primitives as an accelerator keeps
        them.
    plugins
        Name in scene files -> what makes the description from the properties of a file and
        the fields that all shapes have.
    wide
        Whether eight primitives can lie side by side in a leaf; `blocks` says how.
    primitives
        shape -> how many it has; faces of meshes are counted by `build_scene`.
    """

    name: str
    description: type
    surfaces: Callable[[list[Any], int], Any]
    orientation: Callable[[Any], float]
    corners: Callable[[Any], list[NDArray[np.float32]]]
    hull: Callable[[Any, Any], tuple[Any, Any, Any]]
    areas: Callable[[Any, Any], NDArray[np.float64]]
    group: Callable[[Any, Any, Any, Callable[[Any], Any]], Any]
    plugins: Mapping[str, Callable[[Any, dict[str, Any]], Any]]
    wide: bool = True
    primitives: Callable[[Any], int] = lambda shape: 1


@dataclass(frozen=True)
class ShapePlugin:
    """A plugin of scene files, and the kind that its shapes are of."""

    kind: ShapeKind
    make: Callable[[Any, dict[str, Any]], Any]

    def read(self, properties: Any, common: dict[str, Any]) -> Any:
        """Return the description; `common` are the fields of `description.Shape`."""
        return self.make(properties, common)


def flipped(shape: Any) -> float:
    """Return the orientation of shapes whose normals only the file turns around."""
    return -1.0 if shape.flip_normals else 1.0
