"""How little rounding must do for our path to do what Mitsuba's does.

That a difference is "within rounding" can be measured: one ray of our path is moved by a
small part of its length and the path is traced again by the same kernels with the same
numbers. If it then decides as Mitsuba's, or its value changes by as much as the two
differ, rounding of that size is enough; a wrong formula does not go away like this.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

from mitsuba_ref.replay.path_comparison import MEANINGS, Kind, Quantity, compare_paths
from renderer.integrators.step_by_step import Moved
from renderer.traced_path import TracedPath, Vector

STEPS = (1e-7, 3e-7, 1e-6, 3e-6, 1e-5)
"""Parts of a ray's length that rounding explains; a float32 has 6e-8, and a point on a
floor of 30 was measured to be 1.3e-5 off, 2e-6 of the ray that led there."""

FARTHER = (1e-4, 1e-3)
"""Steps that it does not; tried to say how far from rounding a decision is."""

LONG = 12
"""Bounces from which on few moves of few rays are tried: a path of 400 bounces takes half a
second. Rays 2, 4, 8, ... bounces before are among them, since a ray moved at the camera has
left its path long before bounce 200."""

SIDES = 8
"""Directions, all around the ray, into which it is moved."""

GROWTH = 4.0
"""How many times farther apart two rays must have come to speak of it."""

JUMP = 400.0
"""How many times farther apart one bounce may bring two rays; beyond it, it is no growth.
(Measured: 300 on small spheres; a wrong formula makes 1e-3 of 1e-7.)"""

SAME_PLACE = 1e-4
"""Relative error up to which two hits are one point."""

FLOAT32 = 6e-8
"""Rays that happen to agree in all bits count as so far apart."""

EFFECTS: dict[Kind, str] = {
    "value": "changes it by as much",
    "hit": "lets it hit the same as Mitsuba's",
}

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
    last = max(0, min(quantity.bounce, len(ours.bounces) - 1))
    rays = _directions(ours)
    long = last > LONG
    steps, sides = (STEPS[2::2], 2) if long else (STEPS, SIDES)
    segments = _far_back(last) if long else range(last, -1, -1)
    tries = [(step, segment) for step in steps for segment in segments]
    grown = 2.0 * _grown_to(ours, reference, last)
    if grown > STEPS[-1]:
        tries += [(grown, last)]
    if quantity.kind != "value":  # of values it would only say how fast they change
        tries += [(step, last) for step in FARTHER]
    moves = [(step, k, by) for step, k in tries for by in _sides(rays[k], step, sides)]
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
    other = ours if quantity.kind == "value" else reference
    found = compare_paths(moved, other)[: index + 1]
    if len(found) <= index or (found[-1].bounce, found[-1].name) != (
        quantity.bounce,
        quantity.name,
    ):
        return False  # it has become another path before
    if any(q.error == math.inf and q.counted_error > 0.0 for q in found[:-1]):
        return False
    error = found[-1].error
    if error is None:
        return False
    if quantity.kind != "value":
        return error == 0.0
    return quantity.counted_error <= error < math.inf


def _directions(path: TracedPath) -> list[Vector]:
    """Return the unit directions of a path's rays."""
    on = [b.scattered.direction for b in path.bounces if b.scattered is not None]
    return [path.direction, *on]


def _far_back(last: int) -> list[int]:
    """Return segments 0, 1, 2, 4, 8, ... before the last, and the first."""
    return [*dict.fromkeys([last, *(last - 2**k for k in range(last.bit_length())), 0])]


def _sides(direction: Vector, step: float, sides: int) -> Iterator[Vector]:
    """Yield vectors of length `step` across a direction, all around it."""
    x, y, z = direction
    least = min(range(3), key=lambda axis: abs(direction[axis]))
    first = [(0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)][least]
    size = math.hypot(*first)
    a = tuple(component / size for component in first)
    b = (y * a[2] - z * a[1], z * a[0] - x * a[2], x * a[1] - y * a[0])
    for side in range(sides):
        angle = 2.0 * math.pi * side / sides
        across, up = step * math.cos(angle), step * math.sin(angle)
        yield (
            across * a[0] + up * b[0],
            across * a[1] + up * b[1],
            across * a[2] + up * b[2],
        )


def rays_apart(ours: TracedPath, reference: TracedPath, segment: int) -> float:
    """Return how far two paths' rays are apart, as part of their length."""
    a, b = _directions(ours)[segment], _directions(reference)[segment]
    from_a, from_b = ours.origin, reference.origin
    if segment > 0:
        from_a = ours.bounces[segment - 1].position or from_a
        from_b = reference.bounces[segment - 1].position or from_b
    length = max(1e-30, min(ours.bounces[segment].t, reference.bounces[segment].t))
    return math.dist(a, b) + math.dist(from_a, from_b) / length


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
    effect = EFFECTS.get(quantity.kind, "flips it")
    last = max(0, min(quantity.bounce, len(ours.bounces) - 1))
    if move is None:
        which = "any ray of ours up to there" if value else "our ray there"
        tried = STEPS[-1] if value else FARTHER[-1]
        tried = max(tried, 2.0 * _grown_to(ours, reference, last))
        return (
            f"Not within rounding: even moving {which} by {tried:g} of its length is not "
            f"enough. {_same_place(ours, reference, quantity)}"
            f"Likely {MEANINGS[quantity.kind]}."
        )
    moving = f"moving our ray of bounce {move.segment} by {move.step:.2g} of its length"
    apart = rays_apart(ours, reference, last)
    grown = _growth(ours, reference, last)
    if STEPS[-1] < move.step <= 2.0 * _grown_to(ours, reference, last):
        where = _same_place(ours, reference, quantity)
        return (
            f"Amplified rounding: {moving}, twice as far as the two rays are apart there, "
            f"{effect}. {where}{grown}".rstrip()
        )
    if move.step > STEPS[-1]:
        return (
            f"Hardly rounding: {moving} {effect}, nothing smaller does, and the two rays "
            f"are {apart:.1e} apart. Likely {MEANINGS[quantity.kind]}."
        )
    title = "Amplified" if grown and (value or move.segment < last) else "Within"
    there = f" (the two rays are {apart:.1e} apart there)" if not grown else ""
    where = _same_place(ours, reference, quantity)
    return f"{title} rounding: {moving} {effect}{there}. {where}{grown}".rstrip()


def _same_place(ours: TracedPath, reference: TracedPath, quantity: Quantity) -> str:
    """Return words for two hits of one point on different surfaces; else nothing."""
    if quantity.kind != "hit":
        return ""
    bounces = [p.bounces[quantity.bounce : quantity.bounce + 1] for p in (ours, reference)]
    if not all(bounces):
        return ""
    (a,), (b,) = bounces
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


def _grown_to(ours: TracedPath, reference: TracedPath, last: int) -> float:
    """Return how far the last rays are apart; 0 if it did not come about by growing."""
    apart = [max(rays_apart(ours, reference, k), FLOAT32) for k in range(last + 1)]
    largest = [max(apart[: k + 1]) for k in range(last + 1)]
    gradual = all(b <= JUMP * a for a, b in zip([FLOAT32, *largest], apart, strict=False))
    return apart[last] if gradual else 0.0


def _growth(ours: TracedPath, reference: TracedPath, last: int) -> str:
    """Return from where to where the rays' distance has grown; empty if it has not."""
    apart = [rays_apart(ours, reference, segment) for segment in range(last + 1)]
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
