"""Whether a shape of the scene lies where a ray hits another one.

Two surfaces in one plane: which of them a ray meets first follows from how their planes
were rounded, and no small move of the ray changes it. So ours is shown the one that
Mitsuba has hit alone: if it hits it in the same point, either may be the first.
"""

from __future__ import annotations

from dataclasses import replace

from mitsuba_ref.our_renderer.step_by_step import StepByStep
from mitsuba_ref.our_renderer.traced_path import WHITE, Bounce, TracedPath, Vector
from renderer.rendering.job import RenderJob
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.render_options import RenderOptions
from renderer.scene.placed_groups import shape_numbers
from renderer.scene.scene import build_scene
from renderer.scene_file.description import SceneDescription

NEVER_READ = Bounce(throughput=WHITE)
"""A path to be led along has a bounce for each one wanted."""


class ShapesAlone:
    """Traces single rays in scenes of one shape each, which are built at their first use.

    Parameters
    ----------
    description
        The scene. Instances are not looked at.
    """

    def __init__(self, description: SceneDescription) -> None:
        self._description = description
        self._numbers = [int(n) for n in shape_numbers(description)]
        self._steps: dict[int, StepByStep] = {}

    def hit(self, number: int, origin: Vector, direction: Vector) -> Bounce | None:
        """Return where a ray hits shape `number` in the file, from 1; None: nowhere."""
        count = len(self._description.shapes)
        if number not in self._numbers[:count]:
            return None
        if number not in self._steps:
            shape = self._description.shapes[self._numbers.index(number)]
            alone = replace(
                self._description,
                shapes=(shape,),
                groups=(),
                instances=(),
                emitter_places=(),
            )
            scene = build_scene(alone)
            plan = make_plan(scene, sampler="mitsuba", ray_offset="mitsuba")
            job = RenderJob(scene, plan, RenderOptions(threads=1))
            self._steps[number] = StepByStep(job)
        ray = TracedPath("", {}, origin, direction, (NEVER_READ,))
        (path,) = self._steps[number].trace_led((0, 0), 0, ray)
        found = path.bounces[0] if path.bounces else None
        return found if found is not None and found.position is not None else None
