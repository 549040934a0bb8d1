"""What cases measure with: vectors, the renderer's own hits and work, pictures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.build import build_accelerator
from renderer.kernels.records.batch import NODES, PRIMITIVES
from renderer.rendering.picture.picture import srgb_from_linear
from reports.look.heat_map import RAMP
from reports.trials.meshes import StudyMesh, View, triangle_surfaces
from reports.trials.rays import (
    RayBatches,
    camera_rays,
    flat,
    in_batches,
    pixel_order,
)
from reports.trials.structures import build, reach_of
from reports.trials.tracing import make_query, tallied, trace

Rows = NDArray[Any]  # (n, 3), or (n, m, 3)
Floats = NDArray[np.float32]
Shown = NDArray[np.uint8]  # (height, width, 3), sRGB

# ---------------------------------------------------- vectors, in the precision they have


def dot(a: Rows, b: Rows) -> NDArray[Any]:
    """Return inner products, summed in the precision of the rows."""
    return np.asarray(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2])


def unit(rows: Rows) -> Rows:
    """Return the rows with length 1."""
    return np.asarray(rows / np.sqrt(dot(rows, rows))[..., None])


def directions(count: int, generator: np.random.Generator) -> NDArray[np.float64]:
    """Return unit vectors (count, 3) without a preferred direction."""
    return unit(generator.standard_normal((count, 3)))


def single(rows: Any) -> Floats:
    """Return numbers in float32."""
    return np.asarray(rows, np.float32)


# ------------------------------------------------------------------ the renderer's own hits


def nearest_hits(
    kind: str, surfaces: Any, origin: Any, direction: Any, name: str = "brute"
) -> tuple[Floats, NDArray[np.int32]]:
    """Return where rays (n, 3), (n, 3) first hit primitives, and which; -1 is a miss.

    Parameters
    ----------
    kind, surfaces
        One kind of primitive, as a scene stores it.
    name
        The accelerator.
    """
    order = np.arange(surfaces.end - surfaces.first)
    reach = float(np.abs(origin).sum(axis=1).max())
    accel = build_accelerator(kind, surfaces, order, name, reach)
    query = make_query("random", in_batches(origin, direction, np.inf))
    trace(accel, query, query.batches)
    return flat(query.hits.t, query.rays), flat(query.hits.prim, query.rays)


# -------------------------------------------------- work of an accelerator, without a clock

NO_VIEW = View((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), 45.0, (0.0, 0.0, 0.0))


def soup_mesh(corners: NDArray[Any], view: View = NO_VIEW) -> StudyMesh:
    """Return triangles (n, 3 corners, 3), each with corners of its own."""
    vertices = np.ascontiguousarray(corners.reshape(-1, 3), np.float32)
    faces = np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)
    return StudyMesh("soup", vertices, faces, view)


def counted(
    name: str, mesh: StudyMesh, rays: RayBatches, *, coherent: bool = False
) -> NDArray[np.int32]:
    """Return what each ray cost, (rows of the tally, rays); `coherent`: in packets."""
    # from beyond the reach a ray tests every triangle of a structure of cells
    start = float(np.abs(rays.rows()[0]).sum(axis=1).max())
    accel, _ = build(name, triangle_surfaces(mesh), max(reach_of(mesh), start))
    query = make_query("random", rays)
    return tallied(accel, query, query.batches, coherent)


def work_of_a_ray(name: str, mesh: StudyMesh, rays: RayBatches | None = None) -> float:
    """Return the nodes or cells that a ray visits and the triangles that it tests, mean.

    Parameters
    ----------
    name
        The accelerator.
    rays
        None: 16 x 16 of the mesh's own view.
    """
    tally = counted(name, mesh, camera_rays(mesh.view, 16, 16) if rays is None else rays)
    return float((tally[NODES] + tally[PRIMITIVES]).mean())


# --------------------------------------------------------------------------------- pictures


def on_screen(
    pictures: Sequence[NDArray[np.floating[Any]]],
    *,
    exposure: float = 1.0,
    enlarged: int = 2,
) -> Shown:
    """Return linear pictures side by side.

    Parameters
    ----------
    pictures
        Of the same height, (H, W, 3) or grey (H, W).
    exposure
        That they are multiplied by; 1 is white then.
    enlarged
        How many pixels of the screen a pixel has each way.
    """
    shown = []
    for picture in pictures:
        color = picture if picture.ndim == 3 else np.repeat(picture[..., None], 3, axis=2)
        shown.append(np.round(srgb_from_linear(color * exposure) * 255.0).astype(np.uint8))
    return side_by_side([one.repeat(enlarged, 0).repeat(enlarged, 1) for one in shown])


def side_by_side(pictures: Sequence[NDArray[np.uint8]], gap: int = 8) -> Shown:
    """Return pictures (H, W, 3) or (H, W) with a white gap between them."""
    columns = []
    for picture in pictures:
        color = picture if picture.ndim == 3 else np.repeat(picture[..., None], 3, axis=2)
        columns += [color, np.full((len(color), gap, 3), 255, np.uint8)]
    return np.concatenate(columns[:-1], axis=1)


def work_maps(views: Sequence[tuple[str, StudyMesh]], side: int = 128) -> Shown:
    """Return the work of each pixel by (accelerator, mesh); 1 is darkest, 4000 lightest."""
    order, shown = pixel_order(side, side), []
    for name, mesh in views:
        tally = counted(name, mesh, camera_rays(mesh.view, side, side))
        work = np.empty(side * side)
        work[order] = np.maximum(tally[NODES] + tally[PRIMITIVES], 1)
        brightness = np.log(work).reshape(side, side) / np.log(4000.0)
        at = np.linspace(0.0, 1.0, len(RAMP))
        channels = [np.interp(brightness, at, RAMP[:, k]) for k in range(3)]
        shown.append(np.round(np.stack(channels, axis=-1)).astype(np.uint8))
    return side_by_side(shown)
