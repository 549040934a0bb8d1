"""From how many primitives on a tree pays: brute force against the BVH, ray by ray.

`python -m reports.accelerator_trials.brute_or_tree` prints nanoseconds per ray of both,
measured in turn in one run on one thread: the small end of what the page "accelerators"
shows. Hits are compared before anything is timed.
"""

from __future__ import annotations

import argparse
import sys
from typing import Any

import numpy as np

from renderer.kernels.records.batch import CAPACITY
from reports.accelerator_trials.contenders import build, reach_of
from reports.accelerator_trials.meshes import soup, triangle_surfaces
from reports.accelerator_trials.rays import TILE, camera_rays, random_rays
from reports.accelerator_trials.tracing import Query, answers, make_query, trace

COUNTS = (4, 8, 16, 32, 64, 128, 256, 1024, 16384, 327680)
PAIRS_OF_TURNS = 5


def _nanoseconds(accel: Any, query: Query, repeats: int) -> float:
    """Trace the one batch again and again; return nanoseconds per ray."""
    return trace(accel, query, np.zeros(repeats, np.int64)) / (repeats * CAPACITY) * 1e9


def _row(count: int, kind: str) -> tuple[float, float, float]:
    """Return nanoseconds per ray of brute force and of the BVH, and the build's seconds."""
    mesh = soup(count)
    surfaces, reach = triangle_surfaces(mesh), reach_of(mesh)
    brute, _ = build("brute", surfaces, reach)
    tree, seconds = build("bvh", surfaces, reach)
    if kind == "camera":
        query = make_query(kind, camera_rays(mesh.view, TILE, TILE))
    else:
        query = make_query(kind, random_rays(mesh, CAPACITY))
    truth = answers(brute, query, query.batches)
    if truth.differing(answers(tree, query, query.batches)):
        raise AssertionError(f"{count} triangles: the hits differ, nothing was timed")
    repeats = max(1, 40_000 // count)
    times = [
        (_nanoseconds(brute, query, repeats), _nanoseconds(tree, query, repeats))
        for _ in range(PAIRS_OF_TURNS)
    ]
    best = np.min(times, axis=0)
    return float(best[0]), float(best[1]), seconds


def main(arguments: list[str] | None = None) -> int:
    """Print the table."""
    argparse.ArgumentParser(description=__doc__).parse_args(arguments)
    _row(4, "camera")  # compiles
    write = sys.stdout.write
    write("triangles   rays     brute ns/ray    BVH ns/ray   ratio   build s\n")
    for kind in ("camera", "random"):
        for count in COUNTS:
            brute, tree, seconds = _row(count, kind)
            write(
                f"{count:9d}   {kind:6s}   {brute:12.2f}   {tree:11.2f}"
                f"   {brute / tree:5.2f}   {seconds:7.3f}\n"
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
