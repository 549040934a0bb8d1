"""`depth`: the distance from the camera to the first hit, as a grey picture."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numpy.typing import NDArray

from renderer.integrators.kind import Case, Decision, IntegratorKind, Shown, as_picture
from renderer.integrators.stages.first_hit import CHANNELS, DEPTH, trace_first_hits
from renderer.scene_file.description import Integrator
from renderer.scene_file.properties import Properties


def _read(properties: Properties) -> Integrator:
    properties.boolean("hide_emitters", False)  # distances have no emitters
    return Integrator("depth")


def _decide(case: Case, say: Callable[[str, str], None]) -> Decision:
    say("method", "depth: the first hit alone; no light, no BSDF is sampled")
    return Decision("depth")


def _show(film: NDArray[Any], requested: Integrator) -> Shown:
    return Shown(as_picture(film[..., DEPTH : DEPTH + 1]))


INTEGRATOR = IntegratorKind(
    "the distance from the camera to the first hit",
    trace_first_hits,
    _decide,
    _read,
    channels=CHANNELS,
    show=_show,
    first_hit=True,
)
