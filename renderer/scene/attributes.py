"""Whether each shape has the attributes that its BSDFs' textures show."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.plugins.textures.mesh_attribute import check_attribute
from renderer.scene.materials import MaterialTables, leaves
from renderer.scene_file.description import Mesh, MeshAttributeTexture, Shape

LARGEST = 1e9  # of what a path is multiplied by; four of them fit float32


def check_attributes(
    shapes: Sequence[Shape], materials: MaterialTables, group_of: NDArray[np.int64]
) -> None:
    """Refuse textures of attributes that a shape with this BSDF lacks.

    `group_of` is 0 for a shape of the scene, above for those of groups.

    Raises
    ------
    SceneError
        With the lines of the texture and of the shape.
    """
    asked = [
        [
            (leaf, rows == 1)
            for value, rows in materials.parameters_of(bsdf)
            for leaf in leaves(value)
            if isinstance(leaf, MeshAttributeTexture)
        ]
        for bsdf in materials.bsdfs
    ]
    if not any(asked):
        return
    for k, shape in enumerate(shapes):
        for bsdf in {materials.front[k], materials.back[k]} - {-1}:
            for texture, as_number in asked[bsdf]:
                check_attribute(texture, shape, bool(group_of[k]), as_number)
                _check_size(texture, shape)


def _check_size(texture: MeshAttributeTexture, shape: Shape) -> None:
    assert isinstance(shape, Mesh)
    values = shape.attributes[texture.name]
    largest = float(np.abs(values).max(initial=0.0)) * abs(texture.scale)
    if not largest <= LARGEST:
        raise SceneError(
            f'{texture.location}: texture "mesh_attribute", property "scale": found '
            f"values of the shape at {shape.location} up to {largest:.4g}, expected at "
            f"most {LARGEST:g}: paths multiply them until single precision overflows"
        )
