"""What a render will take of memory, said before it does, and refused if it is too much.

Each part is an upper estimate: of accelerators what their builders take at their peak. A
test compares the sum with what is really allocated.
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

# Bytes for a primitive at the peak of a build, measured with 51,200 triangles in a mesh and
# in a soup; what stays is a third of it or less.
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
_OF_GROUPS = 380  # trees of eight over all kinds together
_OF_TABLES = 80  # for a primitive: lights, derivatives, copies without uv
_OF_TILE = 160  # a row of `Film.tiles`, counts, and copies while they are made
_STREAM = 24  # for a pixel of a replay: the state of its random numbers
_PARAMETERS = 64  # rows for a BSDF; the largest have 30
# The machine code of the kernels, with the compiler that makes it the first time [bytes].
_KERNELS = 150 << 20
_OF_KERNELS = "the kernels"

_loaded = False  # whether a render of this process has them


class Estimate(NamedTuple):
    """Bytes that a render takes in addition to the scene, by what takes them."""

    parts: dict[str, int]

    @property
    def total(self) -> int:
        """The sum."""
        return sum(self.parts.values())

    def together(self, other: Estimate) -> Estimate:
        """Return what this render and another one take that is there with it."""
        parts = {
            what: self.parts.get(what, 0) + other.parts.get(what, 0)
            for what in self.parts | other.parts
        }
        kernels = (each.parts.get(_OF_KERNELS, 0) for each in (self, other))
        return Estimate(parts | {_OF_KERNELS: max(kernels)})  # of a process

    def __str__(self) -> str:
        """Return the parts that matter, the largest first."""
        largest = sorted(self.parts.items(), key=lambda part: -part[1])
        return ", ".join(
            f"{what} {memory.shown(size)}"
            for what, size in largest
            if size > max(self.total / 100, memory.SMALL)
        )


def estimate(
    scene: Scene, plan: Plan, options: RenderOptions, band: int | None = None
) -> Estimate:
    """Return what a render will take; `band`: rows of tiles at a time, None: all."""
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
        # developed, as what is shown of it, and one channel after the other for a file
        "the picture": (2 if band is None else 4) * picture,
        **_of_tracing(scene, plan, options),
    }
    if options.has_goal:
        # copies of the sums, and what an error is guessed from
        parts["both halves of a goal"] = 2 * sums + 18 * picture
    if options.checkpoint is not None:
        # copies of the sums are written while others are added to
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
    """Return what so many processes take that trace portions, of so many threads each.

    Their films are never written to, and the sums of a portion are small. `kernels` tells
    whether they have to load them, None: whether this process has; `scene_bytes` is what
    each of them has of the scene, 0 where it is there already.
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
    """Return what renders take that are there at the same time; see `estimate`."""
    each = (estimate(scene, plan, options, band) for scene, plan in renders)
    return reduce(Estimate.together, each)


def check_room(found: Estimate, source: str, possible: str) -> None:
    """Refuse a render that takes more than there is.

    Raises
    ------
    NotAllowed
        With what takes how much, how much there is, and what is possible instead.
    """
    if found.total > memory.room():
        raise NotAllowed(
            f"{source}: rendering takes about {memory.shown(found.total)} of memory more "
            f"({found}); {memory.whose_room()}; possible: {possible}"
        )
    global _loaded  # from here on kernels are loaded, once in a process
    _loaded = True


def rows_at_once(shape: FilmShape, room: int) -> int:
    """Return how many rows of tiles a band has: enough for all threads, and no more.

    It has one more than it leaves to the next one at least, whether there is room or not.
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
        alone = int(scene.starts[kind][0])  # the others lie in groups
        name = chosen[kind].name if kind in chosen else "octree"
        total += _OF_STRUCTURE[name] * alone
        total += _OF_GROUPS * (surfaces.end - surfaces.first - alone)
    # once more without lamps, once more for panes and lamps alone, which are disjoint
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
    """Return the bytes of all arrays of a record of records."""
    if isinstance(record, np.ndarray):
        return record.nbytes
    return sum(map(_size, record)) if isinstance(record, tuple) else 0
