"""What an accelerator does for a ray, in counts: no clock is looked at."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.records.batch import NODES, PRIMITIVES
from reports.accelerator_trials.contenders import build, reach_of
from reports.accelerator_trials.meshes import StudyMesh, View, triangle_surfaces
from reports.accelerator_trials.rays import RayBatches, camera_rays
from reports.accelerator_trials.tracing import make_query, tallied

UNIT = "nodes, cells and triangles a ray"
SIDE = 16  # pixels
NO_VIEW = View((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), 45.0, (0.0, 0.0, 0.0))


def seen_from(mesh: StudyMesh, side: int = SIDE) -> RayBatches:
    """Return one ray a pixel of the mesh's own view."""
    return camera_rays(mesh.view, side, side)


def work_of_a_ray(name: str, mesh: StudyMesh, rays: RayBatches | None = None) -> float:
    """Return the nodes or cells that a ray visits and the triangles that it tests, mean.

    Parameters
    ----------
    name
        The accelerator.
    rays
        None: those of the mesh's own view.
    """
    tally = counted(name, mesh, seen_from(mesh) if rays is None else rays)
    return float((tally[NODES] + tally[PRIMITIVES]).mean())


def counted(
    name: str, mesh: StudyMesh, rays: RayBatches, *, coherent: bool = False
) -> NDArray[np.int32]:
    """Return what each ray cost, (rows of the tally, rays); `coherent`: in packets."""
    # from beyond the reach a ray tests every triangle of a structure of cells
    start = float(np.abs(rays.rows()[0]).sum(axis=1).max())
    accel, _ = build(name, triangle_surfaces(mesh), max(reach_of(mesh), start))
    query = make_query("random", rays)
    return tallied(accel, query, query.batches, coherent)


def soup_mesh(corners: np.ndarray, view: View = NO_VIEW) -> StudyMesh:
    """Return triangles (n, 3 corners, 3), each with corners of its own."""
    n = len(corners)
    return StudyMesh(
        "soup",
        "",
        "",
        np.ascontiguousarray(corners.reshape(-1, 3), np.float32),
        np.arange(3 * n, dtype=np.int32).reshape(n, 3),
        view,
    )
