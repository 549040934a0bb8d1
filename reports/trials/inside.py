"""What the page draws of every structure: its cells, and the walks of a few rays.

One JavaScript file a structure, which calls `structureFile(name, data)`: a page that was
opened from a disk may load no JSON. Coordinates are 16-bit numbers over one box.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.build import BUILDERS
from renderer.kernels.records.batch import BOXES, NODES, PRIMITIVES, SAVED
from renderer.plugins.shapes.extents import extents_of
from renderer.textbook.bounding_volumes import which_hit
from renderer.textbook.cell_tree import CellTree
from renderer.textbook.volume_fits import VOLUMES, points_of_extents
from reports.trials.meshes import StudyMesh, triangle_surfaces
from reports.trials.rays import camera_rays, flat, in_batches
from reports.trials.structure_cells import (
    as_octree,
    drawn_cells,
    edges_of_cells,
    volume_edges,
)
from reports.trials.structure_walks import LEAF, SKIP, Walk, hit_distances, walk_through
from reports.trials.structures import NAIVE, build, reach_of
from reports.trials.tracing import make_query, tallied, trace

MOST_CELLS = 6000  # of a structure; deeper levels are left out
MOST_OBLIQUE = 1500  # cells whose edges are written one by one
VOLUME_NAME = "bounding-volumes"
FIT = 65535  # largest coordinate

Vector = NDArray[np.float32]  # (3,)


class Ray(NamedTuple):
    """A ray whose walks are shown."""

    title: str
    origin: Vector
    direction: Vector


def chosen_rays(mesh: StudyMesh, bvh: Any) -> list[Ray]:
    """Return three camera rays: a usual hit, the hit and the miss with the most work."""
    query = make_query("camera", camera_rays(mesh.view, 96, 72))
    counts = tallied(bvh, query, query.batches, coherent=False)
    trace(bvh, query, query.batches)
    work = counts[NODES] + counts[PRIMITIVES]
    hits = flat(query.hits.prim, query.rays) >= 0
    origin, direction, _ = query.rays.rows()
    usual = np.flatnonzero(hits)[np.argsort(work[hits], kind="stable")[hits.sum() // 2]]
    dearest = int(np.where(hits, work, -1).argmax())
    missing = int(np.where(hits, -1, work).argmax())
    titles = {"a usual hit": usual, "a costly hit": dearest, "a near miss": missing}
    return [Ray(title, origin[k], direction[k]) for title, k in titles.items()]


def kernel_counts(accel: Any, ray: Ray) -> tuple[int, ...]:
    """Return nodes, boxes, primitives and saved tests as the kernel counts them."""
    query = make_query("random", in_batches([ray.origin], [ray.direction], np.inf))
    counts = tallied(accel, query, query.batches, coherent=False)[:, 0]
    return tuple(int(counts[row]) for row in (NODES, BOXES, PRIMITIVES, SAVED))


def walked(accel: Any, ray: Ray, brute: Any) -> Walk:
    """Return the walk of a ray through a structure, to its end."""
    walk = Walk(ray.origin, ray.direction, hit_distances(brute, ray.origin, ray.direction))
    walk_through(accel, walk)
    return walk


class Inside(NamedTuple):
    """One structure: its walks, ray by ray, and what its file holds."""

    name: str
    walks: list[Walk]
    data: dict[str, Any]


class Looks:
    """The structures over one mesh, and the rays that walk through them."""

    def __init__(self, mesh: StudyMesh) -> None:
        self.mesh = mesh
        self.surfaces, self.reach = triangle_surfaces(mesh), reach_of(mesh)
        self.brute, _ = build(NAIVE, self.surfaces, self.reach)
        self.rays = chosen_rays(mesh, build("bvh", self.surfaces, self.reach)[0])
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        room = 0.5 * float(np.max(high - low))  # spheres and cubes reach beyond the mesh
        self.low, self.size = (low - room).astype(float), (high - low + 2 * room).max()

    def scene(self) -> dict[str, Any]:
        """Return what all structures share: the mesh, the rays, the scale."""
        return {
            "low": self.low.tolist(),
            "size": float(self.size),
            "vertices": self._points(self.mesh.vertices),
            "faces": _packed(self.mesh.faces, np.uint16),
            "rays": [
                {
                    "title": ray.title,
                    "origin": ray.origin.tolist(),
                    "direction": ray.direction.tolist(),
                }
                for ray in self.rays
            ],
        }

    def structures(self) -> Iterator[Inside]:
        """Yield every structure, the bounding volumes last."""
        for name in BUILDERS:
            accel, _ = build(name, self.surfaces, self.reach)
            walks = [walked(accel, ray, self.brute) for ray in self.rays]
            yield Inside(name, walks, self._structure(name, accel, walks))
        yield self._volumes()

    def _structure(self, name: str, accel: Any, walks: list[Walk]) -> dict[str, Any]:
        cells = drawn_cells(accel)
        cells = as_octree(cells) if name == "octree" else cells
        oblique = isinstance(accel, CellTree) and bool(
            (accel.plane[accel.child > 0, :3].max(axis=1) < 1.0).any()
        )
        most = MOST_OBLIQUE if oblique else MOST_CELLS
        deepest = int(cells.level[cells.shown].max())
        while (cells.shown & (cells.level <= deepest)).sum() > most and deepest > 1:
            deepest -= 1
        visited = sorted({s.item for walk in walks for s in walk.steps if s.item >= 0})
        kept = cells.shown & (cells.level <= deepest)
        kept[visited] = True
        numbers = np.flatnonzero(kept)
        place = np.full(len(kept), -1)
        place[numbers] = np.arange(len(numbers))
        drawn = cells.shown[numbers] & (cells.level[numbers] <= deepest)
        data = {
            "depth": deepest,
            "deepest": int(cells.level[cells.shown].max()),
            "cells": int(cells.shown.sum()),
            "boxes": self._points(cells.boxes[numbers].reshape(-1, 3)),
            # 255: only where a ray goes
            "level": _packed(np.where(drawn, cells.level[numbers], 255), np.uint8),
            "held": _packed(np.minimum(cells.held[numbers], FIT), np.uint16),
            "leaf": _packed(cells.leaf[numbers], np.uint8),
            "walks": [_steps(walk, place) for walk in walks],
        }
        if oblique:
            edges = edges_of_cells(accel, numbers.tolist())
            data |= self._edges([edges[k] for k in numbers.tolist()])
        return data

    def _volumes(self) -> Inside:
        """Return the bounding volumes of the whole mesh, each a level of its own."""
        columns = np.arange(self.mesh.triangles)
        points, radius = points_of_extents(extents_of("triangles", self.surfaces, columns))
        volumes = [(k, v.fit(points, radius), v) for k, v in VOLUMES.items()]
        walks = []
        for ray in self.rays:
            walk = Walk(ray.origin, ray.direction, np.full(1, np.inf, np.float32))
            rows = [np.zeros((3, 17), np.float32) for _ in range(2)]
            rows[0][:, 0], rows[1][:, 0] = ray.origin, ray.direction
            for item, (name, volume, _) in enumerate(volumes):
                found = np.zeros(17, np.int32)
                which_hit(volume, *rows, np.full(17, np.inf, np.float32), 1, found)
                walk.boxes += 1
                text = "all triangles would have to be tested" if found[0] else "done"
                said = "meets" if found[0] else "misses"
                text = f"The ray {said} the {name}: {text}."
                walk.note(text, item, LEAF if found[0] else SKIP)
            walks.append(walk)
        n = len(volumes)
        data = {
            "depth": n - 1,
            "deepest": n - 1,
            "cells": n,
            "titles": [
                f"{name}, surface {volume.area(record):.1f}"
                for name, record, volume in volumes
            ],
            "boxes": self._points(np.zeros((2 * n, 3))),
            "level": _packed(np.arange(n), np.uint8),
            "held": _packed(np.full(n, self.mesh.triangles), np.uint16),
            "leaf": _packed(np.zeros(n), np.uint8),
            "walks": [_steps(walk, np.arange(n)) for walk in walks],
            **self._edges([volume_edges(record) for _, record, _ in volumes]),
        }
        return Inside(VOLUME_NAME, walks, data)

    def _edges(self, edges: list[Any]) -> dict[str, str]:
        starts = np.cumsum([0, *(len(one) for one in edges)])
        ends = self._points(np.concatenate(edges).reshape(-1, 3))
        return {"edges": ends, "edgeStart": _packed(starts, np.uint32)}

    def _points(self, points: Any) -> str:
        return _packed(np.round(self._scaled(points) * FIT), np.uint16)

    def _scaled(self, points: Any) -> Any:
        return np.clip((np.asarray(points, np.float64) - self.low) / self.size, 0.0, 1.0)


def _steps(walk: Walk, place: Any) -> list[list[Any]]:
    """Return the steps as lists, in the order of the fields of `Step`."""
    found = []
    for step in walk.steps:
        item = int(place[step.item]) if step.item >= 0 else -1
        t = round(step.t, 4) if np.isfinite(step.t) else None
        # brute force tests all: the page need not list them
        tested = list(step.tested) if len(step.tested) < 400 else []
        found.append([step.text, item, step.kind, tested, *step[4:9], t, step.prim])
    return found


def _packed(values: Any, kind: Any) -> str:
    return base64.b64encode(np.ascontiguousarray(values, kind).tobytes()).decode("ascii")


def script(name: str, data: dict[str, Any]) -> bytes:
    """Return the file of a structure, or of the scene."""
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":"))
    return f"structureFile({json.dumps(name)}, {text});\n".encode()
