"""Whether the whole difference of one pixel of a replay is rounding.

Every sample counts by which the pixel differs, not the first alone: rounding in one of
them must not hide a defect in another.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from mitsuba_ref.our_renderer.traced_path import Numbers, TracedPath, Vector
from mitsuba_ref.records.results import Parting
from mitsuba_ref.replay.paths.path_comparison import (
    MEANINGS,
    Value,
    place,
    value_text,
)
from mitsuba_ref.replay.paths.path_from_reference_rays import Finding
from mitsuba_ref.replay.paths.traced_pair import Pixel, TracedPair

REPRODUCED = 1e-4
"""Of the pixel's scale: what the traced samples' mean may differ by from the picture; no
more than the tolerance, or rounding in the paths would excuse what the film adds."""


@dataclass(frozen=True)
class DifferentPixel:
    """A pixel of both pictures that are to be explained."""

    pixel: Pixel
    ours: Vector
    reference: Vector
    scale: float  # what its differences are relative to
    tolerance: float  # relative; samples that differ by less are not looked at


def explain_pixel(pair: TracedPair, of: DifferentPixel) -> Finding:
    """Return whether each sample by which a pixel differs is within rounding.

    Parameters
    ----------
    pair
        Both renderers with the scene.
    of
        What their pictures hold there.

    Raises
    ------
    MitsubaError
        When Mitsuba ends or does not answer.
    """
    paths = pair.trace_all(of.pixel)
    for traced, shown, name in zip(
        zip(*paths, strict=True), (of.ours, of.reference), ("our", "Mitsuba's"), strict=True
    ):
        off = _off(traced, shown) / of.scale
        if off > min(REPRODUCED, of.tolerance):
            return Finding(
                False,
                f"{name} traced paths do not add up to {name} picture, which is {off:.1e} "
                "off: what differs is not in the paths.",
            )
    findings: list[Finding] = []
    for sample, (ours, reference) in enumerate(paths):
        apart = np.abs(np.subtract(ours.radiance, reference.radiance)).max()
        # The stream of numbers runs on, so a path that ends earlier shifts the next one's.
        ahead = paths[sample + 1 : sample + 2]
        shifts = any(_begin_apart(a.numbers, b.numbers) for a, b in ahead)
        if apart <= of.tolerance * of.scale and not shifts:
            continue
        found = pair.led(of.pixel, sample, reference).examine()
        found = replace(found, sample=sample, sentence=f"Sample {sample}. {found.sentence}")
        if not found.within_rounding:
            return found
        findings.append(found)
        if shifts:
            if len(ours.bounces) != len(reference.bounces) or _drawn(ours) != _drawn(
                reference
            ):
                break  # the samples after it are others
            sentence = f"Sample {sample + 1}. It begins with other numbers."
            return Finding(False, sentence, sample=sample + 1)
    if not findings:
        return Finding(False, "No sample differs by as much as the pixel does.")
    return max(findings, key=lambda found: found.step)


def parting(pixel: Pixel, found: Finding) -> Parting | None:
    """Return the step in which a pixel's paths part; None if `found` does not name one."""
    quantity = found.quantity
    if quantity is None:
        return None
    ours, reference = _worst(quantity.ours, quantity.reference)
    exact = quantity.error is None or math.isinf(quantity.error)
    return Parting(
        *pixel,
        sample=found.sample,
        place=place(quantity.bounce),
        quantity=quantity.name,
        ours=value_text(ours),
        reference=value_text(reference),
        error=None if exact else quantity.error,
        limit=None if exact else found.limit,
        within_rounding=found.within_rounding,
        likely="rounding" if found.within_rounding else MEANINGS[quantity.kind],
    )


def _worst(a: Value, b: Value) -> tuple[Value, Value]:
    """Return the components of two vectors that are farthest apart; else both as given."""
    if not (isinstance(a, tuple) and isinstance(b, tuple)):
        return a, b
    return max(zip(a, b, strict=True), key=lambda pair: abs(pair[0] - pair[1]))


def _begin_apart(a: Numbers, b: Numbers) -> bool:
    """Tell whether two paths begin with other numbers; ours has none for the time."""
    return any(a[name] != b[name] for name in a.keys() & b.keys())


def _drawn(path: TracedPath) -> list[tuple[str, ...]]:
    """Return the names of the numbers that a path has drawn at each bounce."""
    return [tuple(sorted(bounce.numbers)) for bounce in path.bounces]


def _off(paths: tuple[TracedPath, ...], shown: Vector) -> float:
    mean = np.mean([path.radiance for path in paths], axis=0)
    return float(np.abs(mean - shown).max())
