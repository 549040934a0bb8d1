"""What `limits` calls of the study of moving scenes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.build import primitive_group
from renderer.accelerators.bvh.bvh import Bvh, build_bvh
from renderer.plugins.shapes.extents import extents_of
from reports.trials.meshes import StudyMesh, triangle_surfaces


def group_of(mesh: StudyMesh) -> Callable[[NDArray[np.int64]], Any]:
    """Return what gives the mesh's triangles in the order of a tree's leaves."""
    surfaces = triangle_surfaces(mesh)
    return lambda chosen: primitive_group("triangles", surfaces, chosen)


def built(mesh: StudyMesh) -> Bvh:
    """Return a tree over the mesh as it is."""
    columns = np.arange(mesh.triangles)
    extents = extents_of("triangles", triangle_surfaces(mesh), columns)
    return build_bvh(extents, group_of(mesh))
