"""Normals that the geometry does not have: the terminator of a smooth-shaded mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.expected_failures.light import terminator_band, terminator_pictures
from reports.limits.row import Row
from reports.limits.screen import on_screen


def terminator_error(degrees: float) -> float:
    """Return the RMSE where the light grazes, of a sphere's mesh with such facets."""
    return terminator_band(round(360 / degrees))


def sphere_and_mesh() -> NDArray[np.uint8]:
    """Show a sphere in parallel light, and its mesh of 16 segments."""
    return on_screen(terminator_pictures())


ROWS = (
    Row(
        name="terminator",
        method="Interpolated normals on a mesh",
        stress="degrees of a circle that one facet spans",
        measure=terminator_error,
        quantity="error",
        unit="RMSE where the sphere has 0 < cosine < 0.2",
        strengths=(2.8125, 5.625, 11.25, 22.5, 45.0),
        tolerance=0.02,
        holds_at=5.625,
        fails_at=22.5,
        why="A facet that looks away from the light is in its own shadow as a whole, "
        "whatever its vertex normals say.",
        instead="Finer meshes, or a sphere as a sphere; moving the start of shadow rays "
        "[Hanika2021] would hide it.",
        source="[Hanika2021]; measured here",
        picture=sphere_and_mesh,
        caption="A sphere in parallel light from the right, and its mesh of 16 segments.",
    ),
)
