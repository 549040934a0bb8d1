"""Estimates the memory of a render before it starts, and refuses it if there is not enough.

Each part is an upper bound; for accelerators it is the peak of their builders. A test
compares the sum with the memory that is really allocated.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import reduce
from typing import Any, NamedTuple

import numpy as np

from renderer.accelerators.choice import choose_structures
from renderer.errors import NotAllowed
from renderer.process import memory
from renderer.rendering.film.band import FilmShape
from renderer.rendering.job import film_shape, workspace_of
from renderer.rendering.planning.plan import Plan
from renderer.rendering.render_options import RenderOptions
from renderer.scene.scene import Scene

# Bytes per primitive at the peak of a build, measured with 51,200 triangles in a mesh and
# as separate triangles; afterwards a third or less remains.
_OF_STRUCTURE = {
    "brute": 210,
    "boxes": 210,
    "bvh": 220,
    "bvh-median": 220,
    "bvh-middle": 220,
    "wide": 290,
    "grid": 330,
    "grid-without-mailboxes": 330,
    "grid-clusters": 450,
    "grid-nested": 610,
    "bsp": 750,
    "kd-middle": 950,
    "kd-median": 950,
    "kd-sah": 950,
    "octree": 980,
}
_OF_GROUPS = 380  # per primitive: 8-wide BVHs over all kinds
_OF_TABLES = 80  # per primitive: lights, derivatives, copies without uv
_OF_TILE = 160  # a row of `Film.tiles`, counts, and temporary copies
_STREAM = 24  # per pixel of a replay: state of its random numbers
_PARAMETERS = 64  # rows per BSDF; the largest have 30
# The machine code of the kernels, and the compiler at the first use [bytes].
_KERNELS = 150 << 20
_OF_KERNELS = "the kernels"

_loaded = False  # whether a render of this process has loaded the kernels


class Estimate(NamedTuple):
    """Bytes that a render needs in addition to the scene, by purpose."""

    parts: dict[str, int]

    @property
    def total(self) -> int:
        """The sum of all parts."""
        return sum(self.parts.values())

    def together(self, other: Estimate) -> Estimate:
        """Return the estimate for this render and another simultaneous one."""
        parts = {
            what: self.parts.get(what, 0) + other.parts.get(what, 0)
            for what in self.parts | other.parts
        }
        kernels = (each.parts.get(_OF_KERNELS, 0) for each in (self, other))
        return Estimate(parts | {_OF_KERNELS: max(kernels)})  # shared by the process

    def __str__(self) -> str:
        """Return the parts that matter, in descending order."""
        largest = sorted(self.parts.items(), key=lambda part: -part[1])
        return ", ".join(
            f"{what} {memory.shown(size)}"
            for what, size in largest
            if size > max(self.total / 100, memory.SMALL)
        )


def estimate(
    scene: Scene, plan: Plan, options: RenderOptions, band: int | None = None
) -> Estimate:
    """Return the estimate of a render; `band`: rows of tiles in memory, None: all."""
    shape = film_shape(scene, plan)
    rows = shape.rows if band is None else min(band, shape.rows)
    sums = rows * shape.bytes_of_row
    pixels = rows * 32 * shape.width if band else shape.height * shape.width
    picture = 4 * pixels * shape.channels
    film = sums + _OF_TILE * rows * shape.columns * shape.layers
    if band is not None:
        film += shape.carried * shape.bytes_of_row
    parts = {
        _OF_KERNELS: 0 if _loaded else _KERNELS,
        "the film's sums": film,
        # the developed picture, its displayed copy, and one channel at a time for a file
        "the picture": (2 if band is None else 4) * picture,
        **_of_tracing(scene, plan, options),
    }
    if options.has_goal:
        # copies of the sums, and temporary arrays of the error estimate
        parts["both halves of a goal"] = 2 * sums + 18 * picture
    if options.checkpoint is not None:
        # the copies are written while samples are added to the sums
        parts["a copy for the checkpoint"] = (3 if options.has_goal else 1) * sums
    if plan.replay:
        parts["streams of random numbers"] = _STREAM * shape.width * shape.height
    return Estimate(parts)


def estimate_workers(
    scene: Scene,
    plan: Plan,
    options: RenderOptions,
    *,
    workers: int = 1,
    kernels: bool | None = None,
    scene_bytes: int = 0,
) -> Estimate:
    """Return the estimate for `workers` processes that trace portions with their threads.

    Their films are never written to, and the sums of a portion are small. `kernels` tells
    whether they must load the kernels (None: if this process must). `scene_bytes` is the
    size of the scene in each, 0 if it is there already.
    """
    each = {
        _OF_KERNELS: _KERNELS if (not _loaded if kernels is None else kernels) else 0,
        "the scene": scene_bytes,
        **_of_tracing(scene, plan, options),
    }
    return Estimate({what: workers * size for what, size in each.items()})


def _of_tracing(scene: Scene, plan: Plan, options: RenderOptions) -> dict[str, int]:
    threads = options.thread_count
    each = _workspace(scene, plan, film_shape(scene, plan))
    return {
        "accelerators": _accelerators(scene, plan, options.accelerator),
        "tables of the scene": _OF_TABLES * scene.shape.size,
        f"working arrays of {threads} threads": threads * each,
    }


def estimate_all(
    renders: Iterable[tuple[Scene, Plan]], options: RenderOptions, band: int | None = None
) -> Estimate:
    """Return the estimate for simultaneous renders; see `estimate`."""
    each = (estimate(scene, plan, options, band) for scene, plan in renders)
    return reduce(Estimate.together, each)


def check_room(found: Estimate, source: str, possible: str) -> None:
    """Refuse a render that needs more memory than is available.

    Raises
    ------
    NotAllowed
        Names the memory that is needed and available, and an alternative.
    """
    if found.total > memory.room():
        raise NotAllowed(
            f"{source}: rendering takes about {memory.shown(found.total)} of memory more "
            f"({found}); {memory.whose_room()}; possible: {possible}"
        )
    global _loaded  # from here on kernels are loaded, once in a process
    _loaded = True


def rows_at_once(shape: FilmShape, room: int) -> int:
    """Return the number of rows of tiles of a band: enough for all threads.

    It is at least one more than a band passes on to the next, even without memory for it.
    """
    a_row = shape.bytes_of_row + shape.columns * (
        _OF_TILE * shape.layers + 16 * 32 * 32 * shape.channels
    )
    wanted = -(-_TILES_OF_BAND // shape.columns)
    fitting = room // 2 // a_row
    return max(shape.carried + 1, min(wanted + shape.carried, fitting))


_TILES_OF_BAND = 4096


def _accelerators(scene: Scene, plan: Plan, accel: str) -> int:
    chosen = choose_structures(scene, accel, plan.rays)
    total = 0
    for kind, surfaces in scene.surfaces.items():
        alone = int(scene.starts[kind][0])  # the others are in groups
        name = chosen[kind].name if kind in chosen else "octree"
        total += _OF_STRUCTURE[name] * alone
        total += _OF_GROUPS * (surfaces.end - surfaces.first - alone)
    # once more without area lights; once more for panes and area lights (disjoint)
    total *= 1 + plan.hide_emitters + plan.through_panes
    if scene.placements is not None:
        total += _OF_STRUCTURE["wide"] * len(scene.description.instances)
    return total


def _workspace(scene: Scene, plan: Plan, shape: FilmShape) -> int:
    work = workspace_of(
        plan,
        shape.channels,
        shape.border,
        level=plan.level,
        kinds=len(scene.materials.kinds),
        parameters=_PARAMETERS,
        previous_points=plan.replay,
    )
    return _size(work)


def _size(record: Any) -> int:
    """Return the bytes of all arrays of nested records."""
    if isinstance(record, np.ndarray):
        return record.nbytes
    return sum(map(_size, record)) if isinstance(record, tuple) else 0
