"""Paths without caustics: light that mirrors or glass have thrown on a rough surface.

Seen from the camera: after a smooth lobe come mirrors or glass, and then a lamp or the sky.
Going straight on, through a hole or a thin pane, is neither. Paths go on as ever; what they
find there is not added. These methods stand in the tables of simplified scenes alone.

What a path has been through is kept in two signs that nothing else looks at: eta, of which
roulette takes the square, is negative after the first smooth lobe; and the density is -0,
which as ever weighs like 0, where the path is a caustic if it meets a lamp now.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from renderer.kernels.jit import kernel, method_kernel
from renderer.plugins.lights.finite.area import add_emission
from renderer.plugins.lights.infinite.environment import add_environment


class CausticMarks(NamedTuple):
    """The record that the hook belongs to."""

    after_smooth: float  # the sign of eta then


@kernel
def _is_caustic(pdf):
    return np.float32(1.0) / pdf == np.float32(-np.inf)


@method_kernel
def mark_caustics(marks, settings, rays, end, points):
    """Mark the first `end` rays, which have just left `points`."""
    for k in range(end):
        pdf, eta = rays.pdf[k], abs(rays.eta[k])
        mirrored = pdf == 0.0 or _is_caustic(points.pdf[rays.point[k]])
        if pdf > 0.0:
            rays.eta[k] = eta * np.float32(marks.after_smooth)
        elif rays.eta[k] < 0.0 and mirrored:
            rays.pdf[k] = np.float32(-0.0)
        elif pdf == 0.0:
            rays.pdf[k] = np.float32(0.0)


@kernel
def _blacken(throughput, i):
    for c in range(3):
        throughput[c, i] = 0.0


@method_kernel
def add_emission_but_caustics(kind, settings, lights, shapes, points, count, radiance):
    """Do as `add_emission`; the points are there for it alone."""
    for i in range(count):
        if _is_caustic(points.pdf[i]):
            _blacken(points.throughput, i)
    add_emission(kind, settings, lights, shapes, points, count, radiance)


@method_kernel
def add_environment_but_caustics(
    kind, settings, lights, rays, hits, first, count, radiance
):
    """Do as `add_environment`; rays that have hit nothing end here."""
    for i in range(first, first + count):
        if hits.prim[i] < 0 and _is_caustic(rays.pdf[i]):
            _blacken(rays.throughput, i)
    add_environment(kind, settings, lights, rays, hits, first, count, radiance)
