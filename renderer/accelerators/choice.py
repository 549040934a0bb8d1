"""Choose the structure of least expected time, by a cost model."""

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
# Expected time to build each structure and to trace all rays.
#
# The constants are measured: `python -m reports accelerators` on one core of an AMD EPYC
# 9005 (docs/performance.md, "Choice of a structure"). On another machine all of them scale
# together, which changes no choice: only the crossing points matter.

SAMPLE = 4096  # size of the sample for `box_dimension`
_COARSE, _FINE = 4, 8  # cells along the longest side


class RayCounts(NamedTuple):
    """The number of rays that a render is expected to trace."""

    coherent: float  # camera rays
    incoherent: float  # rays after a bounce
    threads: int = 2  # that trace the rays


# default: a picture of a megapixel at 16 samples per pixel
USUAL_RAYS = RayCounts(16e6, 64e6)


class Estimate(NamedTuple):
    """The expected cost of a structure, in seconds."""

    name: str
    build: float
    trace: float

    @property
    def total(self) -> float:
        """Seconds to build and to trace."""
        return self.build + self.trace


def estimate_all(count: int, dimension: float, rays: RayCounts) -> list[Estimate]:
    """Return the estimates of all structures that can be the best, least total first.

    Parameters
    ----------
    count
        Primitives.
    dimension
        From `box_dimension`.
    rays
        Expected numbers of rays, of all threads together.
    """
    found = []
    for name, model in _MODELS.items():
        build, coherent, incoherent = model(count, dimension)
        if name != "brute" and count > 2 * JOB:
            build /= _BUILD_SPEED_UP  # a build always uses all cores
        trace = (rays.coherent * coherent + rays.incoherent * incoherent) / rays.threads
        found.append(Estimate(name, build, trace * 1e-9))
    return sorted(found, key=lambda estimate: estimate.total)


_BUILD_SPEED_UP = 1.4  # with two cores; the first splits run on one


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
    """Return the part of the cost that grows with `count`, in ns of the wide tree.

    A ray meets a surface once, after log n steps. In volume-filling clutter it passes
    n^(1/3) primitives.
    """
    volume = 17.0 * count ** (1.0 / 3.0)
    surface = min(17.0 * math.log2(count + 1), volume)
    share = min(max(dimension - 2.0, 0.0), 1.0)
    return (1 - share) * surface + share * volume


def box_dimension(lower: NDArray[np.float32], upper: NDArray[np.float32]) -> float:
    """Return the box-counting dimension: up to 2 for surfaces, 3 for filled space.

    It compares the occupied cells of two grids. Too few primitives count as a surface.

    Parameters
    ----------
    lower, upper
        (3, n) corners of the boxes of a sample of about `SAMPLE` primitives.
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
# The structure for each kind of primitive: as requested, or the fastest expected one.

_TO_BUILD_BOXES = 2e-3  # least saving in seconds; boxes cost a fifth of it
_MOST_IN_BOXES = 1024  # for more primitives boxes build slower and a tree pays


class Choice(NamedTuple):
    """A structure's name and the reason for it."""

    name: str
    reason: str


def choose_structures(
    scene: Scene, requested: str, rays: RayCounts = USUAL_RAYS
) -> dict[str, Choice]:
    """Return the structure for each kind of primitive outside of groups.

    Parameters
    ----------
    scene
        The primitives.
    requested
        The name of a structure, or "auto".
    rays
        Expected numbers of rays.
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
    """Return the structure for the first `count` primitives of one kind.

    `room` is (2, 3), the corners of the box that rays fill; None: the primitives' box.
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
    """Return at most about `SAMPLE` primitives, evenly spaced in the record."""
    stride = -(-count // SAMPLE)
    fields = (
        field[..., :count:stride] if isinstance(field, np.ndarray) else field
        for field in surfaces
    )
    return type(surfaces)(*fields)


def _seconds(seconds: float) -> str:
    return f"{seconds:.2g} s" if seconds >= 0.1 else f"{1e3 * seconds:.2g} ms"
