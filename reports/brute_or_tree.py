"""From how many primitives on a tree pays: brute force against the BVH, ray by ray.

`python -m reports.brute_or_tree` prints nanoseconds per ray of both, measured in turn in
one run on one thread; `renderer.accelerators.build.FEW` comes from it. Hits are compared
before anything is timed.
"""

from __future__ import annotations

import argparse
import sys
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.build import build_accelerator
from renderer.accelerators.dispatch import closest_hit
from renderer.batch import CAPACITY, Workspace, make_workspace
from renderer.jit import entry_kernel
from renderer.kernel_scene import TriangleSurfaces
from renderer.scene import unit_normals
from renderer.stages.intersect import reset_hits

COUNTS = (4, 8, 16, 32, 64, 128, 256, 1024, 16384, 327680)
PAIRS_OF_TURNS = 5


@entry_kernel
def _trace(accel: Any, rays: Any, hits: Any, coherent: bool, repeats: int) -> None:
    for _ in range(repeats):
        reset_hits(hits, 0, CAPACITY)
        closest_hit(accel, rays, hits, 0, CAPACITY, coherent, None)


def _soup(count: int, generator: np.random.Generator) -> TriangleSurfaces:
    """Small triangles in the unit cube, of a size that keeps the hit rate alike."""
    corner = generator.uniform(-1.0, 1.0, (3, count)).astype(np.float32)
    edge1, edge2 = (
        (generator.normal(size=(3, count)) / np.sqrt(count)).astype(np.float32)
        for _ in range(2)
    )
    normal = unit_normals(edge1, edge2)
    return TriangleSurfaces(0, count, corner, edge1, edge2, normal, None, None)


def _work(coherent: bool, generator: np.random.Generator) -> Workspace:
    """Camera rays through neighbouring pixels, or rays from anywhere to anywhere."""
    work = make_workspace(
        ray_capacity=CAPACITY, shadow_capacity=CAPACITY, channels=3, depths=1
    )
    if coherent:
        side = int(CAPACITY**0.5)
        x, y = np.meshgrid(np.linspace(-0.1, 0.1, side), np.linspace(-0.1, 0.1, side))
        # 16 neighbouring rays are 4 x 4 pixels, as in the renderer's tiles
        blocks = [a.reshape(side // 4, 4, side // 4, 4).swapaxes(1, 2) for a in (x, y)]
        direction = np.stack([blocks[0].ravel(), blocks[1].ravel(), np.ones(CAPACITY)])
        origin: NDArray[Any] = np.array([[0.0], [0.0], [-3.0]])
    else:
        direction = generator.normal(size=(3, CAPACITY))
        origin = generator.uniform(-1.0, 1.0, (3, CAPACITY))
    work.rays.origin[:, :CAPACITY] = origin
    work.rays.direction[:, :CAPACITY] = direction / np.linalg.norm(direction, axis=0)
    return work


def _seconds(accel: Any, work: Workspace, coherent: bool, repeats: int) -> float:
    start = time.perf_counter()
    _trace(accel, work.rays, work.hits, coherent, repeats)
    return time.perf_counter() - start


def _row(count: int, coherent: bool) -> tuple[float, float, float]:
    """Return nanoseconds per ray of brute force and of the BVH, and the build's seconds."""
    generator = np.random.default_rng(count)
    soup = _soup(count, generator)
    order = np.arange(count)
    start = time.perf_counter()
    tree = build_accelerator("triangles", soup, order, "bvh")
    build = time.perf_counter() - start
    brute = build_accelerator("triangles", soup, order, "brute")
    work = _work(coherent, generator)
    found = []
    for accel in (brute, tree):
        _trace(accel, work.rays, work.hits, coherent, 1)
        found.append(work.hits.prim[:CAPACITY].copy())
    if not np.array_equal(found[0], found[1]):
        raise AssertionError(f"{count} triangles: the hits differ, nothing was timed")
    repeats = max(1, 40_000 // count)
    times = [
        (_seconds(brute, work, coherent, repeats), _seconds(tree, work, coherent, repeats))
        for _ in range(PAIRS_OF_TURNS)
    ]
    best = np.min(times, axis=0) / (repeats * CAPACITY) * 1e9
    return float(best[0]), float(best[1]), build


def main(arguments: list[str] | None = None) -> int:
    """Print the table."""
    argparse.ArgumentParser(description=__doc__).parse_args(arguments)
    _row(4, True)  # compiles
    write = sys.stdout.write
    write("triangles   rays         brute ns/ray    BVH ns/ray   ratio   build s\n")
    for coherent in (True, False):
        for count in COUNTS:
            brute, tree, build = _row(count, coherent)
            kind = "coherent" if coherent else "incoherent"
            write(
                f"{count:9d}   {kind:10s}   {brute:12.2f}   {tree:11.2f}"
                f"   {brute / tree:5.2f}   {build:7.3f}\n"
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
