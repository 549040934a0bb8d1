"""Embree through embreex: one thread, one ray a call inside; a second opinion on hits.

The package is not everywhere (no wheels for Linux on ARM), so its absence is a sentence,
not a failure.
"""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.float32]


class EmbreeAnswers(NamedTuple):
    """What Embree found for n rays."""

    t: Rows  # (n,)
    prim: NDArray[np.int32]  # (n,) -1 for a miss; for any hit 0 where something is met


class EmbreePeer:
    """A mesh in Embree.

    Parameters
    ----------
    vertices, faces
        (V, 3) float32 and (F, 3) int32.

    Raises
    ------
    ImportError
        If embreex is not installed, or does not run here.
    """

    def __init__(self, vertices: Rows, faces: NDArray[np.int32]) -> None:
        from embreex import mesh_construction, rtcore_scene

        self._new_scene: Any = rtcore_scene.EmbreeScene
        self._new_mesh: Any = mesh_construction.TriangleMesh
        self._vertices, self._faces = vertices, faces
        self.build()

    def build(self) -> float:
        """Build the tree, anew; return the seconds it took."""
        self._scene = self._new_scene()
        self._mesh = self._new_mesh(self._scene, self._vertices, self._faces)
        # The first query builds the tree. Copying the mesh before is not counted: it is a
        # loop of Python objects in the binding, no work of Embree's.
        ray = np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32)
        start = time.perf_counter()
        self._scene.run(*ray)
        return time.perf_counter() - start

    def trace(self, rows: tuple[Rows, Rows, Rows], *, any_hit: bool) -> float:
        """Trace rays (origins, directions, ends); return the seconds it took."""
        origin, direction, ends = rows
        ends = ends.copy()  # Embree shortens them
        query = "OCCLUDED" if any_hit else "INTERSECT"
        start = time.perf_counter()
        self._scene.run(origin, direction, dists=ends, query=query)
        return time.perf_counter() - start

    def found(self, rows: tuple[Rows, Rows, Rows], *, any_hit: bool) -> EmbreeAnswers:
        """Return the answers for rays (origins, directions, ends)."""
        origin, direction, ends = rows
        if any_hit:
            met = self._scene.run(origin, direction, dists=ends.copy(), query="OCCLUDED")
            return EmbreeAnswers(ends, np.where(met >= 0, 0, -1).astype(np.int32))
        given = self._scene.run(origin, direction, dists=ends.copy(), output=1)
        return EmbreeAnswers(given["tfar"], given["primID"])
