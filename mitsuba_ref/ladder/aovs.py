"""Do both renderers see the same things? AOVs at the pixel centres, without noise.

Both sides trace one ray through the middle of each pixel, so all values must agree to the
precision of float32, except where a ray meets an edge.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.metrics.edges import MAX_MASKED_FRACTION, silhouettes
from mitsuba_ref.records.results import AovResult

Array = NDArray[np.float32]
Errors = NDArray[np.float64]
Mask = NDArray[np.bool_]

QUANTILE = 0.999
"""Errors are judged by this quantile: one ray in a thousand may graze something."""

MISMATCHES = 0.001
"""Fraction of pixels whose index may differ without a reason."""

TIES = 0.05
"""Fraction of pixels whose ray may run exactly along an edge that two primitives or two
colours share (the diagonal of a square that faces the camera); there either is right."""

TOLERANCES: dict[str, tuple[float, str]] = {  # of the error, and how it is measured
    "depth": (1e-4, "relative to the depth"),
    "position": (1e-4, "distance, relative to the depth"),
    "geo_normal": (1e-3, "length of the difference"),
    "sh_normal": (1e-3, "length of the difference"),
    "uv": (1e-3, "largest component, u = 1 next to u = 0"),
    "albedo": (1e-3, "largest component"),
}
OF_A_FACE = ("geo_normal", "sh_normal", "uv", "albedo")
"""Quantities that may differ between two triangles on their common edge."""

INDICES = ("shape_index", "prim_index")

FAR = 5e-3
"""A position's error is relative to at least this share of its largest coordinate. 1e-4 of
it are four units in the last place of a float32."""


NOTHING_SEEN = "no ray of Mitsuba's through a pixel's centre hits anything"


def sees_nothing(aovs: Mapping[str, Array]) -> bool:
    """Return whether all rays miss, so that there is no value to compare."""
    return not (aovs["depth"] > 0.0).any()


def compare_aovs(
    ours: Mapping[str, Array], reference: Mapping[str, Array]
) -> tuple[AovResult, ...]:
    """Compare all kinds; a kind that we lack is a failure, not an omission.

    Parameters
    ----------
    ours, reference
        Kind (`AOV_KINDS`) to (H, W, C), finite; a miss is 0 in all.
    """
    edge = silhouettes(reference)
    results = []
    for kind in (*TOLERANCES, *INDICES):
        if kind not in ours or ours[kind].shape != reference[kind].shape:
            found = ours[kind].shape if kind in ours else "nothing"
            meaning = f"expected an array of shape {reference[kind].shape}, found {found}"
            results.append(AovResult(kind, None, 0.0, False, meaning, 0, int(edge.sum())))
        elif kind in INDICES:
            results.append(_compare_indices(kind, ours, reference, edge))
        else:
            results.append(_compare_values(kind, ours, reference, edge))
    return tuple(results)


def _compare_values(
    kind: str, ours: Mapping[str, Array], reference: Mapping[str, Array], edge: Mask
) -> AovResult:
    tolerance, unit = TOLERANCES[kind]
    if sees_nothing(reference):
        astray = int(ours[kind].any(axis=-1).sum())
        meaning = f"{NOTHING_SEEN}; of ours {astray} hit something"
        pixels = edge.size
        return AovResult(kind, None, tolerance, astray == 0, meaning, pixels, 0)
    meaning = f"{QUANTILE:.1%} quantile of the error, {unit}"
    compared = (reference["depth"][..., 0] > 0.0) & ~edge
    errors = _errors(kind, ours, reference)
    tied = 0.0
    if kind in OF_A_FACE:
        either = _on_a_shared_edge("prim_index", ours, reference)
        if kind == "albedo":
            either |= _like_a_neighbour(ours, reference, tolerance)
        ties = compared & (errors > tolerance) & either
        tied = float(ties.sum()) / max(1, int(compared.sum()))
        compared &= ~ties
        meaning += _about_ties(tied)
    value = None
    if compared.any():
        value = float(np.quantile(errors[compared], QUANTILE, method="higher"))
    passed = (
        value is not None and value <= tolerance and tied <= TIES and _sees_enough(edge)
    )
    return AovResult(
        kind, value, tolerance, passed, meaning, int(compared.sum()), int(edge.sum())
    )


def _errors(kind: str, ours: Mapping[str, Array], reference: Mapping[str, Array]) -> Errors:
    """Return the error of each pixel, (H, W), measured as the kind demands."""
    difference = np.abs(ours[kind].astype(np.float64) - reference[kind])
    if kind in ("depth", "position"):
        depth = reference["depth"][..., 0].astype(np.float64)
        scale = np.where(depth > 0.0, depth, 1.0)
        if kind == "position":  # at 1e4 a float32 steps by 1e-3, however near the camera is
            coordinates = np.abs(reference[kind].astype(np.float64)).max(axis=-1)
            scale = np.maximum(scale, FAR * coordinates)
        return np.asarray(np.linalg.norm(difference, axis=-1) / scale)
    if kind == "uv":
        difference = np.where(difference > 0.5, np.abs(difference - 1.0), difference)
    if kind in ("uv", "albedo"):
        return np.asarray(np.max(difference, axis=-1))
    return np.asarray(np.linalg.norm(difference, axis=-1))


def _compare_indices(
    kind: str, ours: Mapping[str, Array], reference: Mapping[str, Array], edge: Mask
) -> AovResult:
    a, b = ours[kind][..., 0], reference[kind][..., 0]
    compared = ~edge
    differs = (a != b) & compared
    ties = compared & _on_a_shared_edge(kind, ours, reference)
    count = max(1, int(compared.sum()))
    unexplained = int((differs & ~ties).sum()) / count
    tied = int(ties.sum()) / count
    passed = unexplained <= MISMATCHES and tied <= TIES and _sees_enough(edge)
    meaning = "fraction of pixels with another index" + _about_ties(tied)
    return AovResult(
        kind, unexplained, MISMATCHES, passed, meaning, int(compared.sum()), int(edge.sum())
    )


def _on_a_shared_edge(
    kind: str, ours: Mapping[str, Array], reference: Mapping[str, Array]
) -> Mask:
    """Return where both hit one point of two primitives or shapes, along a thin line.

    An edge is at most a pixel wide: a pixel whose eight neighbours are like it is not on
    one. Of two shapes, ours must also be hit in a neighbouring pixel of Mitsuba's; this is
    not required of coincident shapes. The triangles at the pole of a mesh are smaller than
    the pixels.
    """
    # without them no tie is excused
    if not {"position", "shape_index", kind} <= ours.keys():
        return np.zeros(reference[kind].shape[:2], dtype=bool)
    a, b = ours[kind][..., 0], reference[kind][..., 0]
    same_point = _errors("position", ours, reference) <= TOLERANCES["position"][0]
    if kind == "prim_index":
        fits = ours["shape_index"][..., 0] == reference["shape_index"][..., 0]
    else:
        fits = np.logical_or.reduce([neighbour == a for neighbour in _neighbours(b)])
    either = (a != b) & same_point & fits
    return np.asarray(either & ~np.logical_and.reduce([*_neighbours(either)]))


def _about_ties(tied: float) -> str:
    return f"; besides, {tied:.2%} lie exactly on a shared edge (at most {TIES:.0%})"


def _sees_enough(edge: Mask) -> bool:
    return bool(edge.mean() <= MAX_MASKED_FRACTION)


def _like_a_neighbour(
    ours: Mapping[str, Array], reference: Mapping[str, Array], tolerance: float
) -> Mask:
    """Return where our albedo is that of one of the 3 x 3 pixels around."""
    a = ours["albedo"]
    found = np.zeros(a.shape[:2], dtype=bool)
    for neighbour in _neighbours(reference["albedo"]):
        found |= np.max(np.abs(neighbour - a), axis=-1) <= tolerance
    return found


def _neighbours(values: Array) -> Iterator[Array]:
    """Yield the picture moved by -1, 0, 1 pixels both ways; the border is repeated."""
    height, width = values.shape[:2]
    padding = [(1, 1), (1, 1)] + [(0, 0)] * (values.ndim - 2)
    padded = np.pad(values, padding, mode="edge")
    for dy in range(3):
        for dx in range(3):
            yield padded[dy : dy + height, dx : dx + width]
