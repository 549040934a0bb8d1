"""dp/du of triangles, from the texture coordinates of their vertices."""

from __future__ import annotations

import numpy as np

from renderer.kinds.shapes.triangle import TriangleSurfaces


def with_tangents(triangles: TriangleSurfaces) -> TriangleSurfaces:
    """Return the surfaces with dp/du; it is 0 where u and v span no area.

    Meshes without texture coordinates have those of their barycentric ones.
    """
    edge1, edge2 = triangles.edge1.astype(float), triangles.edge2.astype(float)
    along_u = edge1
    if triangles.uvs.size:
        u0, v0, u1, v1, u2, v2 = triangles.uvs.astype(float)
        area = (u1 - u0) * (v2 - v0) - (v1 - v0) * (u2 - u0)
        with np.errstate(all="ignore"):
            along_u = ((v2 - v0) * edge1 - (v1 - v0) * edge2) / area
        along_u = np.where((area != 0.0) & np.isfinite(along_u), along_u, 0.0)
    return triangles._replace(tangents=np.ascontiguousarray(along_u, np.float32))
