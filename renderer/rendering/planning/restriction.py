"""What a simplified scene, or `direct` without light samples, leaves out of its paths.

One of the two ways to find light can be left out, and the paths that are caustics. A scene
in which that would change nothing is planned as if nobody had asked.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

from renderer.integrators.kind import Case, Decision


class Restriction(NamedTuple):
    """How light is followed then."""

    decision: Decision
    strategy: str  # "both", "lights", "bsdfs"
    caustics: bool


def restrict(decision: Decision, case: Case, *, sampled_whole: bool) -> Restriction:
    """Return what is left of an integrator's decision.

    Parameters
    ----------
    decision, case
        The integrator's, and what it had to decide from.
    sampled_whole
        Light samples go wherever a light shines.
    """
    sampled = case.lights and case.smooth and decision.max_depth > 1
    weighed = sampled and case.extended and decision.follow
    strategy = case.asked.strategy
    if decision.method == "direct" and decision.light_samples == 0:
        strategy = "bsdfs"  # points and directions give no light then, as in Mitsuba
    if not (weighed if strategy == "lights" else sampled):
        strategy = "both"
    # camera, rough surface, mirror or glass, lamp: three segments
    possible = weighed and case.delta and decision.max_depth > 2
    caustics = case.asked.caustics or not possible
    last = decision.max_depth == 2 and not case.delta
    if strategy == "lights" and last and sampled_whole:
        # the second segment would look for lamps, in vain
        decision = dataclasses.replace(decision, follow=False)
    return Restriction(decision, strategy, caustics)
