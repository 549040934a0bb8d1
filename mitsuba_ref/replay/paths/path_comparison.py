"""Compares two recorded paths: every quantity, and the first that differs.

Quantities come in the order in which a renderer computes them, so the first difference is
the cause and the others after it are its consequences.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeVar

from mitsuba_ref.our_renderer.traced_path import (
    ENDED,
    WHITE,
    Bounce,
    SampledLight,
    Scattered,
    TracedPath,
    Vector,
    Weights,
)

TOLERANCE = 1e-3
"""Relative; what agreeing float32 paths of a few bounces stay far below."""

FAINT = 1e-2
"""Light fainter than this part of the pixel's is compared as if it were so bright."""

GRAZING = 1e-2
"""[1/sr] Smaller densities of directions are compared as if they were this: near a grazing
angle they are nothing but rounding."""

GROWN = 20.0
"""A value that differs by less than this times the tolerance may be rounding that grew."""

CAMERA = -1
"""The `Quantity.bounce` of the camera ray."""

WHOLE = -2
"""The `Quantity.bounce` of the whole path."""

Kind = Literal[
    "random numbers", "hit", "light choice", "shadow", "roulette", "end", "value"
]
Value = float | bool | str | Vector | None
T = TypeVar("T")

MEANINGS: dict[Kind, str] = {
    "random numbers": "the two draw other random numbers (order, seed or sampler)",
    "hit": "another primitive is hit (a ray next to an edge, or a wrong shape)",
    "light choice": "another light is sampled (the choice, or the order of the lights)",
    "shadow": "a shadow decision (a ray next to an edge, or a wrong ray)",
    "roulette": "Russian roulette decides otherwise (its probability, or its depth)",
    "end": "the path goes on in one of the two only (the depth limit, or a black weight)",
    "value": "a value (the formula of this quantity, or what goes into it)",
}
SMALL = "rounding that has grown (at a grazing angle, on curved mirrors)"


@dataclass(frozen=True)
class Quantity:
    """One number, vector or decision of both paths."""

    bounce: int  # `CAMERA`, the number of the bounce from 0, or `WHOLE`
    name: str
    ours: Value  # None: our path has no such thing
    reference: Value
    error: float | None = None  # relative, infinite for decisions; None: not compared
    kind: Kind = "value"
    at_most: float = math.inf  # error of dependent quantities: more is not counted

    def differs(self, tolerance: float) -> bool:
        """Return whether the two are apart by more than `tolerance`."""
        return self.counted_error > tolerance

    @property
    def counted_error(self) -> float:
        """The error that counts; 0 if the two are not compared."""
        return 0.0 if self.error is None else min(self.error, self.at_most)


def first_difference(
    quantities: Sequence[Quantity], tolerance: float = TOLERANCE
) -> int | None:
    """Return the index of the first quantity that differs, None if all agree."""
    return next((i for i, q in enumerate(quantities) if q.differs(tolerance)), None)


def largest_error(quantities: Sequence[Quantity]) -> float:
    """Return the largest error among quantities, 0 without a compared quantity."""
    return max((q.counted_error for q in quantities), default=0.0)


def difference_sentence(
    quantities: Sequence[Quantity],
    names: tuple[str, str],
    tolerance: float = TOLERANCE,
    cause: str = "",
) -> str:
    """Return one sentence: where two paths part, and what kind of difference it is.

    Parameters
    ----------
    quantities
        From `compare_paths`.
    names
        Of the two renderers, ours first.
    tolerance
        Relative error above which a quantity differs.
    cause
        What was measured about the difference; empty: it is said what is likely.
    """
    first = first_difference(quantities, tolerance)
    if first is None:
        return (
            f"The paths agree: largest relative error {largest_error(quantities):.1e}, "
            f"tolerance {tolerance:g}."
        )
    q, before = quantities[first], largest_error(quantities[:first])
    values = (" ".join(value_text(v).split()) for v in (q.ours, q.reference))
    said = " and ".join(f"{v} in {name}" for v, name in zip(values, names, strict=True))
    by = "" if q.error == math.inf else f"relative error {error_text(q.error)}, "
    why = cause or f"Likely {_meaning(q, tolerance)}."
    return (
        f"First difference at {place(q.bounce)}: {q.name} is {said} ({by}tolerance "
        f"{tolerance:g}; all before agree to {before:.1e}). {why}"
    )


def _meaning(quantity: Quantity, tolerance: float) -> str:
    if quantity.kind == "value" and quantity.counted_error < GROWN * tolerance:
        return f"{SMALL}, or else {MEANINGS['value']}"
    return MEANINGS[quantity.kind]


def place(bounce: int) -> str:
    """Return the words for a `Quantity.bounce`."""
    names = {CAMERA: "the camera", WHOLE: "the whole path"}
    return names.get(bounce, f"bounce {bounce}")


def value_text(value: Value) -> str:
    """Return a quantity's value in words; "-" without a value."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        return " ".join(f"{component:12.6g}" for component in value)
    return value if isinstance(value, str) else f"{value:.7g}"


def error_text(error: float | None) -> str:
    """Return an error in words; empty where nothing was compared."""
    if error is None or error == 0.0:
        return "" if error is None else "0"
    return "differs" if error == math.inf else f"{error:.1e}"


def compare_paths(
    ours: TracedPath, reference: TracedPath, faint: float = FAINT
) -> list[Quantity]:
    """Return all quantities of two paths in the order in which they arise.

    Errors are relative: the largest difference of the components over the largest
    component (of directions, 1; of a distance along a ray, that of its end point; of light,
    at least `faint` times that of the whole path).
    """
    brightest = max(*ours.radiance, *reference.radiance)
    faint = faint * brightest if math.isfinite(brightest) else 0.0
    found = list(_camera(ours, reference))
    left_out = False
    for number in range(max(len(ours.bounces), len(reference.bounces))):
        a, b = _get(ours.bounces, number), _get(reference.bounces, number)
        quantities = _bounce(number, a, b, faint)
        found.extend(map(_uncompared, quantities) if left_out else quantities)
        left_out = left_out or (a is not None and a.left_out)
    found.append(_vectors(WHOLE, "radiance", ours.radiance, reference.radiance, faint))
    return found


def _camera(ours: TracedPath, reference: TracedPath) -> Iterator[Quantity]:
    yield from _numbers(CAMERA, ours.numbers, reference.numbers)
    yield _vectors(CAMERA, "origin", ours.origin, reference.origin)
    yield _vectors(CAMERA, "direction", ours.direction, reference.direction)


def _bounce(
    number: int, a: Bounce | None, b: Bounce | None, faint: float
) -> Iterator[Quantity]:
    shapes = (None if x is None else _shape(x) for x in (a, b))
    yield _decision(number, "hits", *shapes, kind="hit")
    if a is None or b is None or ENDED in (a.event, b.event):
        return  # this, or the bounce before, has said why
    at_surface = list(_at_surface(number, a, b, faint))
    # On an edge that two faces share either is right, as long as all goes on alike; where
    # normals or colours part there, or one of the paths ends, the edge is the cause.
    follows = largest_error([q for q in at_surface if q.kind in ("value", "end")])
    yield replace(_faces(number, a.face, b.face), at_most=follows)
    size = max(abs(x) for x in a.position or (0.0,))
    yield _numbers_apart(number, "t", a.t, b.t, size)
    position, *after = at_surface
    yield position
    normal = _vectors(number, "normal", a.normal, _same_side(a.normal, b.normal))
    yield replace(normal, at_most=largest_error([q for q in after if q.kind == "value"]))
    yield from after


def _at_surface(number: int, a: Bounce, b: Bounce, faint: float) -> Iterator[Quantity]:
    """Compare a hit's position and all that follows from position, face and normal."""
    yield _vectors(number, "position", a.position, b.position)
    yield _vectors(number, "throughput", a.throughput, b.throughput)
    yield from _weights(number, a.weights, b.weights)
    yield _vectors(number, "emitted", a.emitted, b.emitted, faint)
    yield from _numbers(number, a.numbers, b.numbers)
    for turn in range(max(len(a.lights), len(b.lights))):
        yield from _light(number, _get(a.lights, turn), _get(b.lights, turn), faint)
    scattered = _scattered(number, a.scattered, b.scattered)
    yield from map(_uncompared, scattered) if a.left_out else scattered
    yield _vectors(number, "radiance so far", a.radiance, b.radiance, faint)


def _same_side(a: Vector | None, b: Vector | None) -> Vector | None:
    """Return a normal b with the sign of a: which side it is on says nothing."""
    if a is None or b is None or sum(x * y for x, y in zip(a, b, strict=True)) >= 0.0:
        return b
    return -b[0], -b[1], -b[2]


def _shape(bounce: Bounce) -> str:
    return bounce.event or (f"shape {bounce.shape}" if bounce.shape else "nothing")


def _light(
    number: int,
    a: SampledLight | None,
    b: SampledLight | None,
    faint: float,
) -> Iterator[Quantity]:
    names = (None if x is None else x.light for x in (a, b))
    chosen = _decision(number, "light", *names, kind="light choice")
    dark = not any(any(x.carried) for x in (a, b) if x is not None)
    if a is None or b is None:  # no shadow ray from the black side of a surface
        yield _uncompared(chosen) if dark else chosen
        return
    yield chosen
    carried = _vectors(number, "unblocked light", a.carried, b.carried, faint)
    pdf = _numbers_apart(number, "light pdf", a.pdf, b.pdf)
    weight = _vectors(number, "light weight", a.weight, b.weight)
    values = (
        _vectors(number, "shadow ray origin", a.origin, b.origin),
        _vectors(number, "light direction", a.direction, b.direction),
        _numbers_apart(number, "light distance", a.distance, b.distance),
        replace(pdf, at_most=carried.counted_error),
        replace(weight, at_most=carried.counted_error),
        carried,
    )
    # A light that shines away may be given up early: what it lacks then says nothing.
    yield from (_uncompared(value) if dark else value for value in values)
    if a.blocked is None or b.blocked is None:
        yield Quantity(number, "light blocked", a.blocked, b.blocked)
    else:
        yield _decision(number, "light blocked", a.blocked, b.blocked, kind="shadow")
        if not (a.blocked or b.blocked or a.passed == b.passed == WHITE):
            yield _vectors(number, "light passes", a.passed, b.passed)
    yield _vectors(number, "light adds", a.contribution, b.contribution, faint)


def _scattered(number: int, a: Scattered | None, b: Scattered | None) -> Iterator[Quantity]:
    yield _decision(number, "goes on", a is not None, b is not None, kind="end")
    if a is None or b is None:
        return
    yield _vectors(number, "BSDF direction", a.direction, b.direction)
    yield _vectors(number, "next origin", a.origin, b.origin)
    yield _numbers_apart(number, "BSDF pdf", a.pdf, b.pdf, GRAZING)
    yield _vectors(number, "throughput after", a.throughput, b.throughput)
    yield from _weights(number, a.weights, b.weights, " after")
    yield _decision(number, "survives", a.survived, b.survived, kind="roulette")


def _weights(number: int, a: Weights, b: Weights, when: str = "") -> Iterator[Quantity]:
    for name in a:
        if name in b:
            yield _vectors(number, name + when, a[name], b[name])


def _numbers(number: int, a: dict[str, float], b: dict[str, float]) -> Iterator[Quantity]:
    """Compare random numbers that both have drawn; one side may not know its own."""
    for name in (*a, *(name for name in b if name not in a)):
        known = name in a and name in b
        error = _distance((a[name],), (b[name],), 1.0) if known else None
        title = f"random: {name}"
        yield Quantity(
            number, title, a.get(name), b.get(name), error, kind="random numbers"
        )


def _faces(number: int, a: int | None, b: int | None) -> Quantity:
    """Compare faces of meshes; a rectangle is two faces in Mitsuba and none in ours."""
    if a is None or b is None:
        return Quantity(number, "face", a, b)
    return _decision(number, "face", a, b, kind="hit")


def _decision(number: int, name: str, a: Value, b: Value, *, kind: Kind) -> Quantity:
    return Quantity(number, name, a, b, 0.0 if a == b else math.inf, kind)


def _numbers_apart(
    number: int, name: str, a: float, b: float, least: float = 0.0
) -> Quantity:
    return Quantity(number, name, a, b, _distance((a,), (b,), least))


def _vectors(
    number: int, name: str, a: Vector | None, b: Vector | None, least: float = 0.0
) -> Quantity:
    error = None if a is None or b is None else _distance(a, b, least)
    return Quantity(number, name, a, b, error)


def _uncompared(quantity: Quantity) -> Quantity:
    return replace(quantity, error=None)


def _distance(a: Sequence[float], b: Sequence[float], least: float) -> float:
    """Return max |a - b| over the largest component, or over `least` if that is larger."""
    if not all(math.isfinite(x) for x in (*a, *b)):
        return 0.0 if repr(tuple(a)) == repr(tuple(b)) else math.inf
    least = least if math.isfinite(least) else 0.0
    size = max(least, *(abs(x) for x in (*a, *b)))
    apart = max(abs(x - y) for x, y in zip(a, b, strict=True))
    return apart / size if size > 0.0 else 0.0


def _get(items: Sequence[T], index: int) -> T | None:
    return items[index] if index < len(items) else None
