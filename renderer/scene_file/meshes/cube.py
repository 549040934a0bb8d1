"""The `cube` plugin: [-1, 1]^3 as a mesh of 24 vertices and 12 triangles."""

from __future__ import annotations

import numpy as np

from renderer.scene_file.meshes.mesh_data import MeshData

# Each side's four corners, in the order of Mitsuba's cube so that primitive indices and
# uv agree: two triangles (0, 1, 2) and (3, 0, 2) a side, uv (0,1) (1,1) (1,0) (0,0).
_SIDES = (
    ((0, -1, 0), ((1, -1, -1), (1, -1, 1), (-1, -1, 1), (-1, -1, -1))),
    ((0, 1, 0), ((1, 1, -1), (-1, 1, -1), (-1, 1, 1), (1, 1, 1))),
    ((1, 0, 0), ((1, -1, -1), (1, 1, -1), (1, 1, 1), (1, -1, 1))),
    ((0, 0, 1), ((1, -1, 1), (1, 1, 1), (-1, 1, 1), (-1, -1, 1))),
    ((-1, 0, 0), ((-1, -1, 1), (-1, 1, 1), (-1, 1, -1), (-1, -1, -1))),
    ((0, 0, -1), ((1, 1, -1), (1, -1, -1), (-1, -1, -1), (-1, 1, -1))),
)
_UV = ((0, 1), (1, 1), (1, 0), (0, 0))
_TRIANGLES = ((0, 1, 2), (3, 0, 2))


def cube_mesh() -> MeshData:
    """Return the cube of edge 2 around the origin, normals outward.

    Its corners have one normal a side, so `face_normals` means nothing to it (Mitsuba
    ignores the property here): call `build_mesh` with False.
    """
    first_corners = 4 * np.arange(6, dtype=np.int32)[:, None, None]
    return MeshData(
        vertices=np.array([p for _, side in _SIDES for p in side], dtype=np.float64),
        faces=(np.array(_TRIANGLES, dtype=np.int32) + first_corners).reshape(12, 3),
        normals=np.repeat(np.array([n for n, _ in _SIDES], dtype=np.float64), 4, axis=0),
        uvs=np.tile(np.array(_UV, dtype=np.float64), (6, 1)),
        source="cube",
    )
