"""Which structure is expected to be the fastest: a cost model, and the choice by it."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.bvh.bvh_build import JOB
from renderer.accelerators.rays.boxes import expected_cost
from renderer.plugins.shapes.extents import primitive_bounds
from renderer.plugins.shapes.registry import SHAPES
from renderer.scene.scene import Scene

# --------------------------------------------------------------------------- cost model
# Which structure is expected to take the least time, building it and tracing all rays.
#
# The constants are measured: `python -m reports accelerators` on one core of an AMD EPYC
# 9005 (docs/performance.md, "Choice of a structure"). On another machine they all shift
# together, which changes no choice; what matters is where two lines cross.

SAMPLE = 4096  # primitives that the distribution is judged by
_COARSE, _FINE = 4, 8  # cells along the longest side


class RayCounts(NamedTuple):
    """How many rays a render is expected to trace."""

    coherent: float  # from the camera, neighbours together
    incoherent: float  # after a reflection
    threads: int = 2  # that trace them


# if the caller gives no number: a picture of a megapixel at 16 paths a pixel
USUAL_RAYS = RayCounts(16e6, 64e6)


class Estimate(NamedTuple):
    """What a structure is expected to cost, in seconds."""

    name: str
    build: float
    trace: float

    @property
    def total(self) -> float:
        """Seconds of both."""
        return self.build + self.trace


def estimate_all(count: int, dimension: float, rays: RayCounts) -> list[Estimate]:
    """Return the estimates of the structures that are ever the best, the best one first.

    Parameters
    ----------
    count
        Primitives.
    dimension
        From `box_dimension`.
    rays
        That will be traced, by all threads together.
    """
    found = []
    for name, model in _MODELS.items():
        build, coherent, incoherent = model(count, dimension)
        if name != "brute" and count > 2 * JOB:
            build /= _BUILD_SPEED_UP  # all cores build, whatever number traces
        trace = (rays.coherent * coherent + rays.incoherent * incoherent) / rays.threads
        found.append(Estimate(name, build, trace * 1e-9))
    return sorted(found, key=lambda estimate: estimate.total)


_BUILD_SPEED_UP = 1.4  # of two cores; the first splits are made by one


def _brute(count: int, dimension: float) -> tuple[float, float, float]:
    per_ray = 3.0 + 0.46 * count
    return 0.15e-3, per_ray, per_ray


def _wide(count: int, dimension: float) -> tuple[float, float, float]:
    build = 0.3e-3 + 600e-9 * count
    return build, 4.0 + 0.16 * _steps(count, dimension), 20.0 + _steps(count, dimension)


def _median(count: int, dimension: float) -> tuple[float, float, float]:
    """Return the costs of a binary tree split at the median: built in half the time."""
    build = 0.15e-3 + 340e-9 * count
    steps = _steps(count, dimension)
    return build, 5.0 + 0.23 * steps, 30.0 + 3.0 * steps


_MODELS = {"brute": _brute, "wide": _wide, "bvh-median": _median}


def _steps(count: int, dimension: float) -> float:
    """Return what grows with the primitives in a ray's way, in ns of the wide tree.

    A surface is met once, after a descent of log n steps. Clutter that fills space is met
    again and again: a ray passes n^(1/3) of it.
    """
    volume = 17.0 * count ** (1.0 / 3.0)
    surface = min(17.0 * math.log2(count + 1), volume)
    share = min(max(dimension - 2.0, 0.0), 1.0)
    return (1 - share) * surface + share * volume


def box_dimension(lower: NDArray[np.float32], upper: NDArray[np.float32]) -> float:
    """Return whether primitives lie on surfaces (2 or less) or fill space (3).

    By counting the occupied cells of two grids; too few primitives to tell count as a
    surface.

    Parameters
    ----------
    lower, upper
        (3, n) corners of boxes, of a sample of `SAMPLE` or so.
    """
    low, high = (side.astype(np.float64) for side in (lower, upper))
    centres = 0.5 * (low + high)
    extent = float(np.ptp(centres, axis=1).max())
    if centres.shape[1] < SAMPLE // 8 or extent == 0.0:
        return 2.0
    place = (centres - centres.min(axis=1, keepdims=True)) / extent
    counts = []
    for cells in (_COARSE, _FINE):
        index = np.minimum((place * cells).astype(np.int64), cells - 1)
        counts.append(len(np.unique(index[0] + cells * (index[1] + cells * index[2]))))
    return math.log2(counts[1] / counts[0])


# ------------------------------------------------------------------------------- choice
# The structure of each kind of primitive: the requested one, or the expected fastest.

_TO_BUILD_BOXES = 2e-3  # seconds that they must save, five times what they take
_MOST_IN_BOXES = 1024  # above it they take longer to build, and a tree pays


class Choice(NamedTuple):
    """A structure's name and why it was taken."""

    name: str
    reason: str


def choose_structures(
    scene: Scene, requested: str, rays: RayCounts = USUAL_RAYS
) -> dict[str, Choice]:
    """Return what to build for each kind of primitive outside of groups.

    Parameters
    ----------
    scene
        The primitives.
    requested
        The name of a structure, or "auto".
    rays
        That will be traced.
    """
    found: dict[str, Choice] = scene.recently(
        "structures", (requested, rays), _choose_structures, scene, requested, rays
    )
    return found


def _choose_structures(scene: Scene, requested: str, rays: RayCounts) -> dict[str, Choice]:
    chosen = {}
    for kind, surfaces in scene.surfaces.items():
        count = int(scene.starts[kind][0])
        if count:
            chosen[kind] = choose_structure(
                kind, surfaces, count, requested, rays, scene.bounds
            )
    return chosen


def choose_structure(
    kind: str,
    surfaces: Any,
    count: int,
    requested: str,
    rays: RayCounts = USUAL_RAYS,
    room: NDArray[np.float64] | None = None,
) -> Choice:
    """Return what to build for the first `count` primitives of one kind.

    `room` are the corners, (2, 3), of the box that rays fill; None: that of the primitives.
    """
    if not SHAPES[kind].wide and requested in ("auto", "wide"):
        return Choice("bvh", "the tree for primitives that are tested one at a time")
    if requested != "auto":
        return Choice(requested, "as requested")
    sample = primitive_bounds(kind, _sample(surfaces, count))
    dimension = box_dimension(*sample)
    best, second = estimate_all(count, dimension, rays)[:2]
    spread = "on surfaces" if dimension < 2.5 else "through space"
    number = rays.coherent + rays.incoherent
    if best.name == "brute" and count <= _MOST_IN_BOXES:
        tests = expected_cost(*sample, room)
        if (count - tests) / count * best.trace > _TO_BUILD_BOXES:
            reason = (
                f"about {number:.1g} rays are expected, and boxes to cost each of them "
                f"as much as {tests:.2g} tests of a primitive, not {count}"
            )
            return Choice("boxes", reason)
    reason = (
        f"about {number:.1g} rays are expected, through primitives {spread}; estimated are "
        f"{_seconds(best.build)} to build and {_seconds(best.trace)} to trace, "
        f"for {second.name} {_seconds(second.build)} and {_seconds(second.trace)}"
    )
    return Choice(best.name, reason)


def _sample(surfaces: Any, count: int) -> Any:
    """Return at most about `SAMPLE` primitives of a record."""
    stride = -(-count // SAMPLE)
    fields = (
        field[..., :count:stride] if isinstance(field, np.ndarray) else field
        for field in surfaces
    )
    return type(surfaces)(*fields)


def _seconds(seconds: float) -> str:
    return f"{seconds:.2g} s" if seconds >= 0.1 else f"{1e3 * seconds:.2g} ms"
