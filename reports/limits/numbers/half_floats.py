"""Pictures in files of half precision, which is the default of `hdrfilm`."""

from __future__ import annotations

import numpy as np

from reports.limits.row import Row


def _step(radiance: float) -> float:
    """Return the error of a radiance that was written as a half and read again."""
    kept = np.array([radiance]).astype(np.float32)
    with np.errstate(over="ignore"):
        halves = kept.astype(np.float16).astype(np.float64)
    return float(np.abs(halves - kept)[0] / kept[0])


_SOURCE = "IEEE 754 binary16; measured here"

ROWS = (
    Row(
        name="half-float-bright",
        method="Picture in half floats",
        stress="radiance",
        measure=_step,
        quantity="error",
        unit="of the value",
        strengths=(0.7, 7.0, 70.0, 7e2, 7e3, 6.55e4, 6.6e4, 1e5),
        tolerance=2.0**-11,
        holds_at=65504.0,
        fails_at=65520.0,
        why="The largest half is 65504; a lamp in view or a firefly becomes infinite.",
        instead="component_format float32, and NumPy files for whatever is compared.",
        source=_SOURCE,
    ),
    Row(
        name="half-float-dark",
        method="Picture in half floats",
        stress="1 / radiance",
        measure=lambda strength: _step(1.0 / strength),
        quantity="error",
        unit="of the value",
        strengths=(3.0, 3e1, 3e2, 3e3, 3e4, 3e5, 3e6, 3e7),
        tolerance=1e-2,
        holds_at=3e4,
        fails_at=3e6,
        why="Below 6.1e-5 halves are 6e-8 apart, so dark pictures have steps, then 0.",
        instead="component_format float32, or scale lamps such that pictures are near 1.",
        source=_SOURCE,
    ),
)
