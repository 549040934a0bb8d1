"""Do both renderers see the same things? AOVs at the pixel centres, without noise.

Both sides trace one ray through the middle of each pixel, so all values must agree to the
precision of float32, except where a ray meets an edge.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.edges import MAX_MASKED_FRACTION, dilated, silhouettes
from mitsuba_ref.results import AovResult

Array = NDArray[np.float32]
Mask = NDArray[np.bool_]

QUANTILE = 0.999
"""Errors are judged by this quantile: one ray in a thousand may graze something."""

MISMATCHES = 0.001
"""Fraction of pixels whose index may differ without a reason."""

TIES = 0.05
"""Fraction of pixels whose ray may run exactly along a shared edge (the diagonal of a
square that faces the camera), where either primitive is right."""

# Kind: largest error, what it is relative to, and whether the kind has jumps of its own.
TOLERANCES: dict[str, tuple[float, str]] = {
    "depth": (1e-4, "relative to the depth"),
    "position": (1e-4, "distance, relative to the depth"),
    "geo_normal": (1e-3, "length of the difference"),
    "sh_normal": (1e-3, "length of the difference"),
    "uv": (1e-3, "largest component"),
    "albedo": (1e-3, "largest component"),
}
INDICES = ("shape_index", "prim_index")
HAS_JUMPS = {"uv": 0.1, "albedo": 0.02}  # a seam, an edge in a texture


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
    a, b = ours[kind].astype(np.float64), reference[kind].astype(np.float64)
    if kind in HAS_JUMPS:
        edge = edge | _own_jumps(b, HAS_JUMPS[kind])
    compared = (reference["depth"][..., 0] > 0.0) & ~edge
    depth = np.where(compared, reference["depth"][..., 0], 1.0)
    error = np.linalg.norm(a - b, axis=-1)
    if kind in ("depth", "position"):
        error = error / depth
    elif kind in HAS_JUMPS:
        error = np.max(np.abs(a - b), axis=-1)
    errors = error[compared]
    value = float(np.quantile(errors, QUANTILE, method="higher")) if errors.size else None
    passed = value is not None and value <= tolerance and _sees_enough(edge)
    meaning = f"{QUANTILE:.1%} quantile of the error, {unit}"
    return AovResult(
        kind, value, tolerance, passed, meaning, int(errors.size), int(edge.sum())
    )


def _compare_indices(
    kind: str, ours: Mapping[str, Array], reference: Mapping[str, Array], edge: Mask
) -> AovResult:
    a, b = ours[kind][..., 0], reference[kind][..., 0]
    compared = ~edge
    differs = (a != b) & compared
    # At a tie both hit the same point, and our primitive is a neighbour's in the reference.
    offset = np.linalg.norm(ours["position"] - reference["position"], axis=-1)
    tolerance = TOLERANCES["position"][0]
    same_point = offset <= tolerance * np.maximum(reference["depth"][..., 0], 1e-6)
    ties = differs & same_point & _among_neighbours(a, b)
    count = max(1, int(compared.sum()))
    unexplained = int((differs & ~ties).sum()) / count
    tied = int(ties.sum()) / count
    passed = unexplained <= MISMATCHES and tied <= TIES and _sees_enough(edge)
    meaning = (
        f"fraction of pixels with another index; {tied:.2%} besides lie exactly on an "
        f"edge that two primitives share (at most {TIES:.0%})"
    )
    return AovResult(
        kind, unexplained, MISMATCHES, passed, meaning, int(compared.sum()), int(edge.sum())
    )


def _sees_enough(edge: Mask) -> bool:
    return bool(edge.mean() <= MAX_MASKED_FRACTION)


def _among_neighbours(a: Array, b: Array) -> Mask:
    """Return where `a` is one of the values of `b` in the 3 x 3 pixels around."""
    padded = np.pad(b, 1, mode="edge")
    height, width = b.shape
    found = np.zeros(b.shape, dtype=bool)
    for dy in range(3):
        for dx in range(3):
            found |= padded[dy : dy + height, dx : dx + width] == a
    return found


def _own_jumps(values: NDArray[np.float64], size: float) -> Mask:
    """Return true within a pixel of a jump larger than `size` in any component."""
    jump = np.zeros(values.shape[:2], dtype=bool)
    across = np.any(np.abs(np.diff(values, axis=1)) > size, axis=-1)
    down = np.any(np.abs(np.diff(values, axis=0)) > size, axis=-1)
    jump[:, :-1] |= across
    jump[:, 1:] |= across
    jump[:-1] |= down
    jump[1:] |= down
    return dilated(jump)
