"""Which way a plan is rendered: our own, or a replay of Mitsuba's numbers and roundings."""

from __future__ import annotations

from collections.abc import Sequence

from renderer.kernel_inputs import OwnWay, Variant
from renderer.plan import Plan


def way_of(plan: Plan, measured_camera: Sequence[float] | None) -> Variant:
    """Return what differs by the way; `measured_camera` is for a replay."""
    if not plan.replay:
        return OwnWay()
    from renderer.replay.way import Replayed  # as few need it

    return Replayed(measured_camera)
