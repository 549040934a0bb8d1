"""Checks before any metric: whether two sets of arrays can be compared at all.

NaN is neither larger nor smaller than a limit. An infinite floor allows anything. NumPy
broadcasts (1, 1, 3) over a whole picture, and empty arrays are equal. Each of these could
pass, so it is refused before a metric is computed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.records.results import Finite
from mitsuba_ref.records.verdicts import VERDICTS, Verdict

Array = NDArray[np.float32]
Named = tuple[str, Array]


@dataclass(frozen=True)
class Incomparable:
    """Why nothing can be measured."""

    verdict: Verdict
    what: str
    rung: str = ""  # of the ladder, if the climb ended there

    @property
    def sentence(self) -> str:
        """What, where, and what can be done."""
        where = f"rung {self.rung}: " if self.rung else ""
        return f"{where}{self.what}; {VERDICTS[self.verdict].advice}"


class NotComparable(Exception):
    """Raised in the middle of a measurement that an obstacle ends."""

    def __init__(self, obstacle: Incomparable) -> None:
        super().__init__(obstacle.sentence)
        self.obstacle = obstacle


def find_obstacle(
    ours: Sequence[Array],
    references: Sequence[Array],
    ours_aovs: Mapping[str, Array] | None = None,
    reference_aovs: Mapping[str, Array] | None = None,
) -> Incomparable | None:
    """Return the first reason not to compare, or None.

    Parameters
    ----------
    ours, references
        At least one of our pictures and two of Mitsuba's, each with another seed, and each
        to be (H, W, 3), H and W not 0.
    ours_aovs, reference_aovs
        Kind to array, of the same H and W. That a kind is missing is no obstacle: it fails
        by its name (`compare_aovs`).
    """
    if len(references) < 2:
        return Incomparable(
            "broken", f"{len(references)} reference pictures; a noise floor needs two"
        )
    first = ours[0]
    our_arrays = [("our picture", first), *_named("our AOV", ours_aovs)]
    reference_arrays = [
        *((f"Mitsuba's picture {i}", one) for i, one in enumerate(references, start=1)),
        *_named("Mitsuba's AOV", reference_aovs),
    ]
    further = [(f"our picture {i}", one) for i, one in enumerate(ours[1:], start=2)]
    return (
        _wrong_shape(our_arrays[0], reference_arrays[0])
        or _other_shape(first, references)
        or _other_size(first, [*our_arrays[1:], *reference_arrays])
        or _other_channels(ours_aovs or {}, reference_aovs or {})
        or _unlike_the_first(first, further)
        or _not_finite([*our_arrays, *reference_arrays, *further])
    )


def count_non_finite(
    ours: Iterable[NDArray[np.floating]], references: Iterable[NDArray[np.floating]]
) -> Finite:
    """Count NaN and infinite values on both sides."""
    ours, references = list(ours), list(references)
    return Finite(
        ours_nan=sum(int(np.isnan(a).sum()) for a in ours),
        ours_inf=sum(int(np.isinf(a).sum()) for a in ours),
        reference_nan=sum(int(np.isnan(a).sum()) for a in references),
        reference_inf=sum(int(np.isinf(a).sum()) for a in references),
    )


def _named(side: str, aovs: Mapping[str, Array] | None) -> Iterator[Named]:
    for kind, array in (aovs or {}).items():
        yield f"{side} {kind}", array


def _wrong_shape(*pictures: Named) -> Incomparable | None:
    """Return why these are no pictures, or None."""
    shapes = " and ".join(f"{name} has shape {array.shape}" for name, array in pictures)
    for _, array in pictures:
        if array.size == 0:
            return Incomparable("size-mismatch", f"{shapes}: there is no pixel to compare")
        if array.ndim != 3 or array.shape[2] != 3:
            expected = "expected (height, width, 3)"
            return Incomparable("size-mismatch", f"{shapes}: {expected}")
    return None


def _other_shape(ours: Array, references: Sequence[Array]) -> Incomparable | None:
    for reference in references:
        if reference.shape != ours.shape:
            shapes = f"{ours.shape}, Mitsuba's has {reference.shape}"
            return Incomparable("size-mismatch", f"our picture has shape {shapes}")
    return None


def _unlike_the_first(first: Array, further: Iterable[Named]) -> Incomparable | None:
    for name, picture in further:
        if picture.shape != first.shape:
            shapes = f"{picture.shape}, the first one {first.shape}"
            return Incomparable("size-mismatch", f"{name} has shape {shapes}")
    return None


def _other_size(ours: Array, others: Iterable[Named]) -> Incomparable | None:
    for name, array in others:
        if array.shape[:2] != ours.shape[:2]:
            shapes = f"{array.shape}, the pictures have {ours.shape}"
            return Incomparable("size-mismatch", f"{name} has shape {shapes}")
    return None


def _other_channels(
    ours: Mapping[str, Array], references: Mapping[str, Array]
) -> Incomparable | None:
    for kind in ours.keys() & references.keys():
        if ours[kind].shape != references[kind].shape:
            shapes = f"{ours[kind].shape}, Mitsuba's has {references[kind].shape}"
            return Incomparable("size-mismatch", f"our AOV {kind} has shape {shapes}")
    return None


def _not_finite(arrays: Sequence[Named]) -> Incomparable | None:
    found = [_bad_values(*named) for named in arrays if not np.isfinite(named[1]).all()]
    if not found:
        return None
    more = f"; {len(found) - 1} more arrays have such values" if len(found) > 1 else ""
    return Incomparable("not-finite", f"NOT FINITE: {found[0]}{more}")


def _bad_values(name: str, array: Array) -> str:
    """Say how many values are not finite and where the first one is."""
    nan, inf = int(np.isnan(array).sum()), int(np.isinf(array).sum())
    y, x = (int(i) for i in np.argwhere(~np.isfinite(array))[0][:2])
    return f"{name} has {nan} NaN and {inf} infinite values, the first at x={x}, y={y}"
