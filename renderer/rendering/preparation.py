"""What comes before the first sample of a render: what is asked for, checked and built."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from renderer.accelerators.build import compile_builders
from renderer.process.memory import limited_to
from renderer.rendering.aovs import plans_of
from renderer.rendering.checkpoints.checkpoint import (
    Checkpoint,
    check_checkpoint_path,
    is_kept,
)
from renderer.rendering.checkpoints.identity import identity_of
from renderer.rendering.cluster.connect import team_of
from renderer.rendering.compilation import CompilationWatch
from renderer.rendering.goal import Goal, check_goal, for_a_goal
from renderer.rendering.memory_estimate import check_room, estimate_all
from renderer.rendering.options import RenderOptions, shown_value
from renderer.rendering.planning.plan import Plan
from renderer.rendering.progress_display import Progress
from renderer.rendering.rendering import Rendering
from renderer.scene.scene import Scene

INSTEAD = (
    "a smaller film; `-o NAME.exr` alone (`render_to_file`), which is written in bands "
    "(not with --frames, --cluster, --checkpoint or a goal); fewer threads; --memory SIZE, "
    "if there is more"
)


class Prepared(NamedTuple):
    """A render that can be traced, and what comes after it."""

    rendering: Rendering
    goal: Goal | None
    kept: Checkpoint | None
    nested: Scene | None  # of the colours beside AOVs
    of_colors: RenderOptions
    build_seconds: float
    compile_seconds: float


def prepare(
    scene: Scene, options: RenderOptions, progress: Callable[[Progress], None] | None
) -> Prepared:
    """Check what is requested, and do all that comes before the first sample."""
    if not isinstance(scene, Scene):
        raise TypeError(
            f"the scene is {shown_value(scene)}; possible is what `load_file`, "
            "`load_string` or `load_dict` returns"
        )
    if options.cluster is not None:
        options = dataclasses.replace(options, cluster=team_of(options.cluster))
    options = for_a_goal(scene, options)
    (_, plan), *nested_plan = renders = plans_of(scene, options)
    goal = None
    if options.has_goal:
        goal = Goal(options.target_error, options.time_limit)
        check_goal(plan)
    nested = nested_plan[0][0] if nested_plan else None
    kept = colors_kept = None
    if options.checkpoint is not None:
        path = Path(options.checkpoint)
        if nested is not None:
            colors_kept = path.with_name(f"{path.name}.colors")
            check_checkpoint_path(colors_kept, resume=options.resume)
        of = identity_of(scene, plan, options)
        kept = Checkpoint(path, options.checkpoint_every, of, resume=options.resume)

    with limited_to(options.memory):
        # both are there while the colours are rendered
        check_room(estimate_all(renders, options), scene.description.source, INSTEAD)
    rendering, build_seconds, compile_seconds = build_rendering(
        scene, plan, progress, options
    )
    of_colors = dataclasses.replace(
        options,
        integrator=None,
        checkpoint=colors_kept,
        resume=colors_kept is not None and is_kept(colors_kept),
    )
    return Prepared(
        rendering, goal, kept, nested, of_colors, build_seconds, compile_seconds
    )


def build_rendering(
    scene: Scene,
    plan: Plan,
    progress: Callable[[Progress], None] | None,
    options: RenderOptions,
    band: int | None = None,
) -> tuple[Rendering, float, float]:
    """Return a rendering that can run, and the seconds of building and of compiling."""

    def announce() -> None:
        if progress is not None:
            progress(Progress("compile", 0, 1, 0.0))

    watch = CompilationWatch(announce)
    with watch.installed():
        compile_seconds = compile_builders(scene, options.accelerator, plan.rays)
        started = time.perf_counter()
        rendering = Rendering(
            scene,
            plan,
            accel=options.accelerator,
            seed=options.seed,
            threads=options.thread_count,
            measured_camera=options.measured_camera,
            band=band,
        )
        build_seconds = time.perf_counter() - started - rendering.methods_seconds
        compile_seconds += rendering.methods_seconds + rendering.compile()
    if progress is not None and watch.compiled:
        progress(Progress("compile", 1, 1, compile_seconds))
    return rendering, build_seconds, compile_seconds
