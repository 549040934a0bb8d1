"""Whether each shape has the attributes that its BSDFs' textures show."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from renderer.kinds.textures.mesh_attribute import check_attribute
from renderer.scene.materials import MaterialTables, leaves
from renderer.scene_file.description import MeshAttributeTexture, Shape


def check_attributes(
    shapes: Sequence[Shape], materials: MaterialTables, group_of: NDArray[np.int64]
) -> None:
    """Refuse what no look-up could find.

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
