"""Direct light alone [Appel1968]: path tracing of two segments."""

from __future__ import annotations

from collections.abc import Callable

from renderer.integrators.kind import MOST, Case, Decision, IntegratorKind
from renderer.integrators.path import decide_direct, render_paths
from renderer.scene_file.description import Integrator
from renderer.scene_file.properties import Properties


def _read(properties: Properties) -> Integrator:
    both = properties.has("shading_samples")
    separate = [n for n in ("emitter_samples", "bsdf_samples") if properties.has(n)]
    if both and separate:
        properties.fail(separate[0], 'a value beside "shading_samples"', "one of the two")
    shared = properties.integer("shading_samples", 1, at_least=1, at_most=MOST)
    return Integrator(
        "direct",
        max_depth=2,
        hide_emitters=properties.boolean("hide_emitters", False),
        # Mitsuba takes 0 and then shows no point light; nobody can want that
        emitter_samples=properties.integer(
            "emitter_samples", shared, at_least=1, at_most=MOST
        ),
        bsdf_samples=properties.integer("bsdf_samples", shared, at_least=0, at_most=MOST),
    )


def _decide(case: Case, say: Callable[[str, str], None]) -> Decision:
    say("method", "direct, as asked for")
    if max(case.asked.emitter_samples, case.asked.bsdf_samples) > 1 and not case.replay:
        say("samples", "one of each light and of the BSDF, whatever the file asks for")
    return decide_direct(case, min(case.depth, 2))


INTEGRATOR = IntegratorKind(
    "light that comes to a surface straight from a light source (Appel 1968)",
    render_paths,
    _decide,
    _read,
    sees_lights=True,
    scatters=True,
)
