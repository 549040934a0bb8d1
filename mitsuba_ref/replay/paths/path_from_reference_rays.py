"""Our path led along Mitsuba's: whether every single step of it is within rounding.

At each bounce our kernels start from the very ray that Mitsuba had. What differs then has
come about in this one step: nothing has grown on the way, so the steps can be held to a few
units in the last place, and all of them are looked at, not only the first that differs.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mitsuba_ref.our_renderer.ray_perturbation import Moved
from mitsuba_ref.our_renderer.traced_path import Bounce, TracedPath, Vector
from mitsuba_ref.replay.paths.path_comparison import (
    MEANINGS,
    WHOLE,
    Quantity,
    compare_paths,
    error_text,
    place,
    value_text,
)

EXACT = 1e-5
"""Relative: what one step of both renderers, from the same ray, may differ by anyway: as
much as the RMSE of a whole picture may. (Measured: 4e-6 in coats and textures.)"""

PLACED = 2e-6
"""The same of points and directions."""

PLACES = (
    *("origin", "direction", "t", "position", "normal", "next origin", "BSDF direction"),
    *("shadow ray origin", "light direction", "light distance"),
)
"""Names of such quantities."""

CHOSEN = 2e-5
"""The same of a direction that has a density, so that a rough surface may have chosen it:
where that is seen along its normal, Mitsuba's sine as sqrt(1 - cos^2) has few digits left.
(Measured: 1.7e-5 in `principledthin`, 2.6e-6 under a bump map.)"""

DENSITY = 1e-3
"""The same of the density of a direction, which only weighs the lamp that it may find: it
is that of a half vector, which rounding turns. (Measured: 1.3e-4.)"""

STEPS = (1e-7, 4e-7)
"""Moves that rounding explains, parts of a ray's length and of its largest coordinate: 2
and 17 units in the last place of a float32."""

STEEPEST = 0.05
"""Least cosine of a ray that meets two surfaces in one point."""

SIDES = 4
"""Directions, all around the ray, into which it is moved."""

AS_MUCH = 0.95
"""Part of a difference that a move has to make. Beyond a jump, as of a bump map's slope at
the edge of a texel, lies Mitsuba's value but for what the same move changes where nothing
jumps. (Measured: 0.99999 and 0.981 of the difference.)"""

SUM = 1e-4
"""Relative: what the light of a path may differ by of which every step agrees."""

SUMS = ("radiance so far", "radiance")
"""Names of what is no step but the sum of many."""

ENDS = ("hit", "light choice", "roulette", "end", "random numbers")
"""After a decision of these kinds two paths have nothing in common any more. (How many
random numbers a shadow ray takes is one, in media.)"""

Key = tuple[int, str, int]
Ray = tuple[Vector, Vector]
TraceLed = Callable[[Sequence[Moved | None]], Iterable[TracedPath]]
HitAlone = Callable[[int, Vector, Vector], Bounce | None]


@dataclass(frozen=True)
class Finding:
    """What leading our path along Mitsuba's has shown."""

    within_rounding: bool
    sentence: str
    step: float = 0.0  # the largest move that was needed; 0: none
    quantity: Quantity | None = None  # that parts; None: each step agrees
    limit: float = 0.0  # of its relative error, where no move has to explain it
    sample: int = 0


class LedPath:
    """Our path along Mitsuba's, with what small moves make of each of its steps.

    Parameters
    ----------
    reference
        Mitsuba's path.
    trace_led
        Traces ours along it once for each move (`StepByStep.trace_led`).
    intersect_scalar
        Where a ray hits a shape that is alone in the world (`ShapesAlone.hit`).
    """

    def __init__(
        self, reference: TracedPath, trace_led: TraceLed, intersect_scalar: HitAlone
    ) -> None:
        self._reference, self._trace_led, self._hit_alone = (
            reference,
            trace_led,
            intersect_scalar,
        )
        (self._led,) = trace_led([None])
        self._moved: dict[int, list[tuple[float, TracedPath]]] = {}

    def examine(self) -> Finding:
        """Return whether rounding explains every step by which the two paths differ.

        A value may differ by `EXACT`, or by as much as one of `STEPS` changes it; a
        decision must become Mitsuba's by such a move. The comparison ends at the first
        decision after which the two paths are unrelated.
        """
        found = _compare(self._led, self._reference)
        explained: list[Quantity] = []
        largest, after, limit = 0.0, 0.0, 0.0
        shadows: set[tuple[int, int]] = set()
        for key, quantity in found.items():
            bounce, name, turn = key
            error = quantity.counted_error
            if name in SUMS or (name == "light adds" and (bounce, turn) in shadows):
                continue
            if name == "throughput" and error <= EXACT + 2.0 * after:
                continue  # that after the bounce before, over the chance of roulette
            after = error if name == "throughput after" else after
            if name == "BSDF pdf" and not self._finds_light(bounce + 1):
                continue
            chosen = found.get((bounce, "BSDF pdf", turn))
            if error <= (allowed := _inexact(quantity, chosen)):
                continue
            step = self._smallest_step(key, quantity)
            if step is None:
                return Finding(False, _unexplained(quantity), 0.0, quantity, allowed)
            largest, limit = max(largest, step), allowed
            explained.append(quantity)
            if quantity.kind == "shadow":
                shadows.add((bounce, turn))
            if quantity.kind in ENDS:
                break
        else:
            total = found[WHOLE, "radiance", 0]
            if not explained and total.counted_error > SUM:
                return Finding(False, _unexplained(total), 0.0, total, SUM)
        last = explained[-1] if explained else None
        return Finding(True, _words(explained, largest), largest, last, limit)

    def _finds_light(self, bounce: int) -> bool:
        """Tell whether a path meets a lamp: else the density of its direction is unused."""
        paths = self._led, self._reference
        return any(any(b.emitted) for p in paths for b in p.bounces[bounce : bounce + 1])

    def _smallest_step(self, key: Key, quantity: Quantity) -> float | None:
        """Return the size of the first move that explains a quantity; None if none does."""
        bounce, value = quantity.bounce, quantity.kind == "value"
        numbers = quantity.kind == "random numbers" and not self._reference.in_media
        if bounce < 0 or numbers:
            return None
        beside = self._led if value else self._reference
        for step, path in self._paths_moved(bounce):
            here = _compare(path, beside).get(key)
            if here is None or here.error is None:
                continue
            # one of the moves by which the value changes as much as the two differ
            if value and AS_MUCH * quantity.counted_error <= here.error < math.inf:
                return step
            if not value and here.error == 0.0:
                return step
        if quantity.kind == "hit" and self._lie_in_one_point(bounce):
            return STEPS[-1]
        return None

    def _paths_moved(self, bounce: int) -> list[tuple[float, TracedPath]]:
        if bounce not in self._moved:
            ray = _ray(self._reference, bounce)
            moves = list(small_moves(ray, self._reference.bounces[bounce], bounce))
            paths = self._trace_led([move for _, move in moves])
            pairs = zip(moves, paths, strict=True)
            self._moved[bounce] = [(step, path) for (step, _), path in pairs]
        return self._moved[bounce]

    def _lie_in_one_point(self, k: int) -> bool:
        """Return whether the surfaces that both have hit lie in one point, in our eyes.

        The coordinates of the two surfaces are rounded. Along a ray that is nearly parallel
        to both, a distance across them is as much longer as the cosine is small.
        """
        a, b = self._led.bounces[k], self._reference.bounces[k]
        if a.position is None or b.position is None or not (a.shape and b.shape):
            return False
        origin, direction = _ray(self._reference, k)
        there = self._hit_alone(b.shape, origin, direction)
        if there is None or there.position is None:
            return False
        normals = [n for n in (a.normal, there.normal) if n is not None]
        cosine = max((abs(np.dot(n, direction)) for n in normals), default=1.0)
        near = STEPS[-1] * max(map(abs, (*origin, *a.position))) / max(cosine, STEEPEST)
        same_face = None in (there.face, b.face) or there.face == b.face
        apart = (math.dist(p, a.position) for p in (there.position, b.position))
        return same_face and max(apart) <= near


def keyed(quantities: Iterable[Quantity]) -> dict[Key, Quantity]:
    """Return quantities by bounce, name, and how many of that name were before."""
    seen: Counter[tuple[int, str]] = Counter()
    found = {}
    for quantity in quantities:
        name = quantity.bounce, quantity.name
        found[*name, seen[name]] = quantity
        seen[name] += 1
    return found


def small_moves(ray: Ray, arrived: Bounce, segment: int) -> Iterator[tuple[float, Moved]]:
    """Yield moves of a ray as rounding makes them, the smallest first, each with its size.

    The direction is moved by a part of its length. The origin and the hit point are moved
    by a part of the largest coordinate of both, which determines their rounding. Random
    numbers are equal in both renderers; they are moved for the rounding of what is computed
    from them.
    """
    origin, direction = ray
    size = max(map(abs, (*origin, *(arrived.position or ()))))
    for step in STEPS:
        for by in sides(direction, step):
            yield step, Moved(segment, by=by)
        for axis in (*np.eye(3), *-np.eye(3)):
            x, y, z = (float(c) for c in step * size * axis)
            yield step, Moved(segment, start=(x, y, z))
            yield step, Moved(segment, hit=(x, y, z))
        for a, b in ((step, step), (step, -step), (-step, step), (-step, -step)):
            yield step, Moved(segment, numbers=(a, b))


def sides(direction: Vector, step: float) -> list[Vector]:
    """Return vectors of length `step` across a direction, all around it."""
    across = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
    across /= np.linalg.norm(across)
    up = np.cross(direction, across)
    angles = 2.0 * np.pi * np.arange(SIDES) / SIDES
    moves = step * (np.outer(np.cos(angles), across) + np.outer(np.sin(angles), up))
    return [(float(x), float(y), float(z)) for x, y, z in moves]


def _inexact(quantity: Quantity, density: Quantity | None) -> float:
    """Return the relative error of a quantity that no move has to explain.

    `density` is that of the direction in which its path goes on.

    A lobe of density p is about 1 / sqrt(pi p) wide, and so steep that a direction off by d
    changes its density by 4 sqrt(p) d. Where it is chosen, no move of the ray shows that.
    """
    if quantity.name == "BSDF pdf" and isinstance(quantity.reference, float):
        return max(DENSITY, 4.0 * math.sqrt(quantity.reference) * STEPS[-1])
    if quantity.name == "BSDF direction" and density is not None and density.reference:
        return CHOSEN
    return PLACED if quantity.name in PLACES else EXACT


def _compare(ours: TracedPath, reference: TracedPath) -> dict[Key, Quantity]:
    """Compare two paths, light relative to all that the path carries."""
    return keyed(compare_paths(ours, reference, faint=1.0))


def _ray(path: TracedPath, segment: int) -> Ray:
    """Return a path's ray: origin and direction."""
    if segment == 0:
        return path.origin, path.direction
    before = path.bounces[segment - 1]
    assert before.scattered is not None
    assert before.position is not None
    return before.scattered.origin or before.position, before.scattered.direction


def cause_of(found: Finding, first: Quantity) -> str:
    """Return what a finding says of the first quantity by which two paths differ.

    Empty where rounding has no part in it: other random numbers, and a camera ray.
    """
    others = first.kind == "random numbers" and not found.within_rounding
    if others or first.bounce < 0:
        return ""
    step = found.quantity
    same = step is not None and (step.bounce, step.name) == (first.bounce, first.name)
    return (
        _unexplained_here(found) if same and not found.within_rounding else found.sentence
    )


def _unexplained_here(found: Finding) -> str:
    """Return the sentence on a step whose values another sentence tells."""
    likely = MEANINGS[found.quantity.kind] if found.quantity else "not in a single step"
    return (
        f"Not within rounding: from the same ray as Mitsuba's no move by {STEPS[-1]:g} "
        f"makes up for it. Likely {likely}."
    )


def _unexplained(q: Quantity) -> str:
    ours, theirs = (" ".join(value_text(v).split()) for v in (q.ours, q.reference))
    by = "" if q.error == math.inf else f", relative error {error_text(q.error)}"
    return (
        f"Not within rounding: from the same ray as Mitsuba's, {q.name} at "
        f"{place(q.bounce)} is {ours} in lightproof and {theirs} in Mitsuba{by}, and no "
        f"move by {STEPS[-1]:g} makes up for it. Likely {MEANINGS[q.kind]}."
    )


def _words(explained: Sequence[Quantity], step: float) -> str:
    if not explained:
        return (
            "Amplified rounding: from the same rays as Mitsuba's, every step agrees to "
            f"{EXACT:g}; the difference has grown from bounce to bounce."
        )
    more = f" and {len(explained) - 1} more before" if len(explained) > 1 else ""
    last = f"{explained[-1].name} at {place(explained[-1].bounce)}"
    return (
        f"Within rounding: from the same rays as Mitsuba's, {last}{more} differ, "
        f"and moves by {step:g} make up for it."
    )
