"""What comes before the first sample of a render: what is asked for, checked and built."""

from __future__ import annotations

import operator
import os
import reprlib
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from renderer.accelerators.build import compile_builders
from renderer.errors import SceneError
from renderer.process.memory import limited_to
from renderer.process.names import ACCELERATORS
from renderer.process.worker_pool import default_threads
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
from renderer.rendering.planning.plan import MOST_SAMPLES, Plan
from renderer.rendering.render_loop import Progress
from renderer.rendering.rendering import Rendering
from renderer.scene.scene import Scene

MOST_THREADS = 1024
INSTEAD = (
    "a smaller film; `-o NAME.exr` alone (`render_to_file`), which is written in bands "
    "(not with --frames, --cluster, --checkpoint or a goal); fewer threads; --memory SIZE, "
    "if there is more"
)


class Options(NamedTuple):
    """What `render` takes beside the scene."""

    spp: int | None = None
    seed: int = 0
    threads: int | None = None
    integrator: str | None = None
    accel: str | None = None
    sampler: str | None = None
    ray_offset: str | None = None
    measured_camera: Sequence[float] | None = None
    target_error: float | None = None
    time_limit: float | None = None
    checkpoint: str | os.PathLike[str] | None = None
    checkpoint_every: float = 60.0
    resume: bool = False
    cluster: Any = None
    memory: int | float | str | None = None
    light_choice: str | None = None

    @property
    def of_plan(self) -> dict[str, Any]:
        """What `make_plan` takes of it."""
        return {
            "integrator": self.integrator,
            "sampler": self.sampler,
            "spp": self.spp,
            "accel": self.accel,
            "ray_offset": self.ray_offset,
            "threads": self.threads,
            "light_choice": self.light_choice,
        }


class CheckedOptions(Options):
    """Options whose numbers are in range, and in which no default is left open."""

    seed: int
    threads: int
    accel: str


class Prepared(NamedTuple):
    """A render that can be traced, and what comes after it."""

    rendering: Rendering
    goal: Goal | None
    kept: Checkpoint | None
    nested: Scene | None  # of the colours beside AOVs
    of_colors: Options
    build_seconds: float
    compile_seconds: float


def prepare(
    scene: Scene, options: Options, progress: Callable[[Progress], None] | None
) -> Prepared:
    """Check what is asked for, and do all that comes before the first sample."""
    if not isinstance(scene, Scene):
        raise TypeError(
            f"the scene is {_shown(scene)}; possible is what `load_file`, `load_string` or "
            "`load_dict` returns"
        )
    if options.cluster is not None:
        options = options._replace(cluster=team_of(options.cluster))
    options = checked(options)
    goal = None
    target_error = _positive("target_error", options.target_error)
    time_limit = _positive("time_limit", options.time_limit)
    if target_error is not None or time_limit is not None:
        goal = Goal(target_error, time_limit)
        sampler, spp = for_a_goal(scene, options.sampler, options.spp)
        options = options._replace(sampler=sampler, spp=spp)
    every = _positive("checkpoint_every", options.checkpoint_every)
    if options.resume and options.checkpoint is None:
        raise SceneError("resume is true, and no checkpoint is given to go on from")
    (_, plan), *nested_plan = renders = plans_of(scene, **options.of_plan)
    if goal is not None:
        check_goal(plan)
    nested = nested_plan[0][0] if nested_plan else None
    kept = colors_kept = None
    if options.checkpoint is not None and every is not None:
        path = Path(options.checkpoint)
        if nested is not None:
            colors_kept = path.with_name(f"{path.name}.colors")
            check_checkpoint_path(colors_kept, resume=options.resume)
        camera = options.measured_camera
        of = identity_of(
            scene, plan, accel=options.accel, seed=options.seed, measured_camera=camera
        )
        kept = Checkpoint(path, every, of, resume=options.resume)

    with limited_to(options.memory):
        # both are there while the colours are rendered
        needs = estimate_all(
            renders,
            accel=options.accel,
            threads=options.threads,
            goal=goal is not None,
            checkpoint=kept is not None,
        )
        check_room(needs, scene.description.source, INSTEAD)
    rendering, build_seconds, compile_seconds = build_rendering(
        scene,
        plan,
        progress,
        options.accel,
        options.seed,
        options.threads,
        measured_camera=options.measured_camera,
    )
    options = options._replace(
        integrator=None,
        checkpoint=colors_kept,
        resume=colors_kept is not None and is_kept(colors_kept),
    )
    return Prepared(rendering, goal, kept, nested, options, build_seconds, compile_seconds)


def checked(options: Options) -> CheckedOptions:
    """Return options with defaults filled in.

    Raises
    ------
    SceneError, TypeError
        For a number that is none or out of range, and an accelerator that does not exist.
    """
    accel = options.accel or "auto"
    if accel not in ACCELERATORS:
        known = ", ".join(ACCELERATORS)
        raise SceneError(f"accelerator {accel!r} is unknown; there are: {known}")
    threads, spp = options.threads, options.spp
    threads = default_threads() if threads is None else threads
    return CheckedOptions(
        *options._replace(
            threads=_whole_number("threads", threads, 1, MOST_THREADS),
            seed=_whole_number("seed", options.seed, 0, 2**32 - 1),
            spp=None if spp is None else _whole_number("spp", spp, 1, MOST_SAMPLES),
            accel=accel,
        )
    )


def build_rendering(
    scene: Scene,
    plan: Plan,
    progress: Callable[[Progress], None] | None,
    accel: str,
    seed: int,
    threads: int,
    *,
    measured_camera: Sequence[float] | None = None,
    band: int | None = None,
) -> tuple[Rendering, float, float]:
    """Return a rendering that can run, and the seconds of building and of compiling."""

    def announce() -> None:
        if progress is not None:
            progress(Progress("compile", 0, 1, 0.0))

    watch = CompilationWatch(announce)
    with watch.installed():
        compile_seconds = compile_builders(scene, accel, plan.rays)
        started = time.perf_counter()
        rendering = Rendering(
            scene,
            plan,
            accel=accel,
            seed=seed,
            threads=threads,
            measured_camera=measured_camera,
            band=band,
        )
        build_seconds = time.perf_counter() - started - rendering.methods_seconds
        compile_seconds += rendering.methods_seconds + rendering.compile()
    if progress is not None and watch.compiled:
        progress(Progress("compile", 1, 1, compile_seconds))
    return rendering, build_seconds, compile_seconds


def _whole_number(name: str, value: object, least: int, most: int) -> int:
    """Return an argument that is an integer, NumPy's included, and in range."""
    try:
        number = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        raise TypeError(
            f"{name} is {_shown(value)}; whole numbers from {least} to {most} are possible"
        ) from None
    if not least <= number <= most:
        raise SceneError(f"{name} is {number}; {least} to {most} are possible")
    return number


def _positive(name: str, value: object) -> float | None:
    """Return an argument that is a positive number, or None."""
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, (int, float, np.number)):
        raise TypeError(f"{name} is {_shown(value)}; positive numbers are possible")
    if not 0.0 < value < float("inf"):
        raise SceneError(f"{name} is {value}; positive numbers are possible")
    return float(value)


def _shown(value: object) -> str:
    """Return a value and its type on one line, cut if it is long."""
    shown = " ".join(reprlib.repr(value).split())
    return f"{shown} (of type {type(value).__name__})"
