"""How little rounding must do for our path to do what Mitsuba's does.

That a difference is "within rounding" can be measured: one ray of our path is moved by a
small part of its length and the path is traced again by the same kernels with the same
numbers. If it then decides as Mitsuba's, or its value changes by as much as the two
differ, rounding of that size is enough; a wrong formula does not go away like this.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from mitsuba_ref.our_renderer.ray_perturbation import Moved
from mitsuba_ref.our_renderer.traced_path import TracedPath, Vector
from mitsuba_ref.replay.paths.path_comparison import MEANINGS, Quantity, compare_paths

STEPS = (1e-7, 1e-6, 1e-5)
"""Parts of a ray's length that rounding explains; a float32 has 6e-8, and a point on a
floor of 30 was measured to be 1.3e-5 off, 2e-6 of the ray that led there."""

SIDES = 4
"""Directions, all around the ray, into which it is moved. A path of 400 bounces takes half
a second, so that all its moves take a minute."""

GROWTH = 4.0
"""How many times farther apart two rays must have come to speak of it."""

JUMP = 400.0
"""How many times farther apart one bounce may bring two rays; beyond it, it is no growth.
(Measured: 300 on small spheres; a wrong formula makes 1e-3 of 1e-7.)"""

SAME_PLACE = 1e-4
"""Relative error up to which two hits are one point."""

FLOAT32 = 6e-8
"""Rays that happen to agree in all bits count as so far apart."""

AS_MUCH = 0.95
"""Part of a difference that a move has to make. Beyond a jump, as of a bump map's slope at
the edge of a texel, lies Mitsuba's value but for what the same move changes where nothing
jumps. (Measured: 0.99999 and 0.981 of the difference.)"""

TraceMoved = Callable[[Sequence[Moved]], Iterable[TracedPath]]


@dataclass(frozen=True)
class Move:
    """The smallest move of a ray that was enough."""

    segment: int  # of the path: 0 is the camera ray
    step: float  # of the ray's length


def smallest_move(
    ours: TracedPath,
    reference: TracedPath,
    index: int,
    quantity: Quantity,
    trace_moved: TraceMoved,
) -> Move | None:
    """Return the smallest move of ours that explains a quantity; None if none of them does.

    Parameters
    ----------
    ours, reference
        The two paths.
    index, quantity
        Their first difference: its place in `compare_paths`, and what is there.
    trace_moved
        Traces our path once for each move.
    """
    last = _last_ray(ours, quantity)
    rays = _directions(ours)
    # A ray moved at the camera has left a long path before its end: 1, 2, 4, ... rays back.
    back = [last - 2**k for k in range(last.bit_length())]
    tries = [(step, k) for step in STEPS for k in dict.fromkeys([last, *back, 0])]
    grown = 2.0 * _grown_to(rays_apart(ours, reference, last))
    if grown > STEPS[-1]:
        tries.append((grown, last))
    moves = [(step, k, by) for step, k in tries for by in sides(rays[k], step)]
    paths = trace_moved([Moved(segment, by) for _, segment, by in moves])
    for (step, segment, _), path in zip(moves, paths, strict=True):
        if _explains(path, ours, reference, index, quantity):
            return Move(segment, step)
    return None


def _explains(
    moved: TracedPath,
    ours: TracedPath,
    reference: TracedPath,
    index: int,
    quantity: Quantity,
) -> bool:
    """Return whether a moved path does at this place what the reference does."""
    value = quantity.kind == "value"
    found = compare_paths(moved, ours if value else reference)[: index + 1]
    place = (quantity.bounce, quantity.name)
    if len(found) <= index or (found[-1].bounce, found[-1].name) != place:
        return False  # it has become another path before
    if any(q.error == math.inf and q.counted_error > 0.0 for q in found[:-1]):
        return False
    error = found[-1].error
    if error is None:
        return False
    return changes_as_much(quantity, error) if value else error == 0.0


def changes_as_much(quantity: Quantity, change: float) -> bool:
    """Return whether a move that changes a value by `change` (relative) explains it."""
    return AS_MUCH * quantity.counted_error <= change < math.inf


def rounding_sentence(
    ours: TracedPath, reference: TracedPath, quantity: Quantity, move: Move | None
) -> str:
    """Return what the smallest move says about a difference.

    Parameters
    ----------
    ours, reference, quantity
        As for `smallest_move`, and what it returned.
    move
        See there.
    """
    value = quantity.kind == "value"
    last = _last_ray(ours, quantity)
    apart = rays_apart(ours, reference, last)
    edge = _edge(ours, reference, quantity)
    if move is None:
        which = "any ray of ours up to there" if value else "our ray there"
        tried = max(STEPS[-1], 2.0 * _grown_to(apart))
        return (
            f"Not within rounding: even moving {which} by {tried:g} of its length is not "
            f"enough. {edge}Likely {MEANINGS[quantity.kind]}."
        )
    effect = {
        "value": "changes it by as much",
        "hit": "lets it hit the same as Mitsuba's",
    }.get(quantity.kind, "flips it")
    grown = _growth(apart)
    there = f" (the two rays are {apart[-1]:.1e} apart there)" if not grown else ""
    amplified = bool(grown) and (value or move.segment < last)
    if move.step > STEPS[-1]:
        amplified, there = True, ", twice as far as the two rays are apart there"
    return (
        f"{'Amplified' if amplified else 'Within'} rounding: moving our ray of bounce "
        f"{move.segment} by {move.step:.2g} of its length {effect}{there}. {edge}{grown}"
    ).rstrip()


def rays_apart(ours: TracedPath, reference: TracedPath, last: int) -> list[float]:
    """Return how far the rays up to `last` are apart, as part of their lengths."""
    apart = []
    from_a, from_b = ours.origin, reference.origin
    rays = zip(_directions(ours), _directions(reference), strict=False)
    for k, (a, b) in zip(range(last + 1), rays, strict=False):
        there = ours.bounces[k], reference.bounces[k]
        length = max(1e-30, min(bounce.t for bounce in there))
        apart.append(math.dist(a, b) + math.dist(from_a, from_b) / length)
        from_a, from_b = there[0].position or from_a, there[1].position or from_b
    return apart


def _last_ray(ours: TracedPath, quantity: Quantity) -> int:
    return max(0, min(quantity.bounce, len(ours.bounces) - 1))


def _directions(path: TracedPath) -> list[Vector]:
    """Return the unit directions of a path's rays."""
    on = [b.scattered.direction for b in path.bounces if b.scattered is not None]
    return [path.direction, *on]


def sides(direction: Vector, step: float) -> list[Vector]:
    """Return vectors of length `step` across a direction, all around it."""
    across = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
    across /= np.linalg.norm(across)
    up = np.cross(direction, across)
    angles = 2.0 * np.pi * np.arange(SIDES) / SIDES
    moves = step * (np.outer(np.cos(angles), across) + np.outer(np.sin(angles), up))
    return [(float(x), float(y), float(z)) for x, y, z in moves]


def _edge(ours: TracedPath, reference: TracedPath, quantity: Quantity) -> str:
    """Return words for two hits of one point on different surfaces; else nothing."""
    k = quantity.bounce
    if quantity.kind != "hit" or k >= min(len(ours.bounces), len(reference.bounces)):
        return ""
    a, b = ours.bounces[k], reference.bounces[k]
    if a.position is None or b.position is None or a.normal is None or b.normal is None:
        return ""
    size = max(1e-30, *map(abs, a.position), *map(abs, b.position), min(a.t, b.t))
    apart = math.dist(a.position, b.position)
    if apart > SAME_PLACE * size:
        return ""
    # which side a normal is on is a convention
    sine = min(math.dist(a.normal, b.normal), math.dist(a.normal, [-c for c in b.normal]))
    angle = math.degrees(2.0 * math.asin(min(1.0, sine / 2.0)))
    return (
        f"Both hit one point, to {apart:.1e}, on two surfaces with normals {angle:.2g} "
        "degrees apart: an edge. "
    )


def _grown_to(apart: Sequence[float]) -> float:
    """Return how far the last rays are apart; 0 if it did not come about by growing."""
    largest = np.maximum.accumulate([FLOAT32, *apart])
    gradual = bool(np.all(np.array(apart) <= JUMP * largest[:-1]))
    return apart[-1] if gradual else 0.0


def _growth(apart: Sequence[float]) -> str:
    """Return from where to where the rays' distance has grown; empty if it has not."""
    last = len(apart) - 1
    least = min(range(last + 1), key=lambda k: max(apart[k], FLOAT32))
    start, end = max(apart[least], FLOAT32), apart[last]
    if least == last or end < GROWTH * start:
        return ""
    factor = (end / start) ** (1.0 / (last - least))
    at_most = "at most " if apart[least] < FLOAT32 else ""
    return (
        f"The two rays are {at_most}{start:.1e} of their length apart at bounce {least} "
        f"and {end:.1e} at bounce {last}: {factor:.3g} times more at each bounce."
    )
