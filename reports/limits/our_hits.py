"""The renderer's own intersection kernels, asked for any rays: what rows measure."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.accelerators.build import build_accelerator
from reports.accelerator_trials.rays import flat, in_batches
from reports.accelerator_trials.tracing import make_query, trace

Hits = tuple[NDArray[np.float32], NDArray[np.int32]]


def nearest_hits(
    kind: str, surfaces: Any, origin: Any, direction: Any, name: str = "brute"
) -> Hits:
    """Return where rays (n, 3), (n, 3) first meet primitives, and which; -1 is a miss.

    Parameters
    ----------
    kind, surfaces
        One kind of primitive, as a scene holds it.
    name
        The accelerator.
    """
    order = np.arange(surfaces.end - surfaces.first)
    reach = float(np.abs(origin).sum(axis=1).max())
    accel = build_accelerator(kind, surfaces, order, name, reach)
    query = make_query("random", in_batches(origin, direction, np.inf))
    trace(accel, query, query.batches)
    return flat(query.hits.t, query.rays), flat(query.hits.prim, query.rays)
