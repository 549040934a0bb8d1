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
from renderer.memory import limited_to
from renderer.names import ACCELERATORS
from renderer.rendering.aovs import nested_scene
from renderer.rendering.checkpoints.checkpoint import (
    Checkpoint,
    check_checkpoint_path,
    is_kept,
)
from renderer.rendering.checkpoints.identity import identity_of
from renderer.rendering.cluster.connect import team_of
from renderer.rendering.compilation import CompilationWatch
from renderer.rendering.goal import Goal, check_goal, for_a_goal
from renderer.rendering.memory_estimate import check_room, estimate
from renderer.rendering.planning.plan import MOST_SAMPLES, Plan, make_plan
from renderer.rendering.rendering import Rendering
from renderer.rendering.sitting import Progress
from renderer.scene.scene import Scene
from renderer.threads import default_threads

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
    threads = default_threads() if options.threads is None else options.threads
    threads = whole_number("threads", threads, 1, MOST_THREADS)
    seed = whole_number("seed", options.seed, 0, 2**32 - 1)
    spp = options.spp
    spp = None if spp is None else whole_number("spp", spp, 1, MOST_SAMPLES)
    sampler, goal = options.sampler, None
    target_error = _positive("target_error", options.target_error)
    time_limit = _positive("time_limit", options.time_limit)
    if target_error is not None or time_limit is not None:
        goal = Goal(target_error, time_limit)
        sampler, spp = for_a_goal(scene, sampler, spp)
    every = _positive("checkpoint_every", options.checkpoint_every)
    if options.resume and options.checkpoint is None:
        raise SceneError("resume is true, and no checkpoint is given to go on from")
    accel = options.accel or "auto"
    if accel not in ACCELERATORS:
        known = ", ".join(ACCELERATORS)
        raise SceneError(f"accelerator {accel!r} is unknown; there are: {known}")
    plan = make_plan(
        scene,
        integrator=options.integrator,
        sampler=sampler,
        spp=spp,
        accel=accel,
        ray_offset=options.ray_offset,
        threads=threads,
        light_choice=options.light_choice,
    )
    if goal is not None:
        check_goal(plan)
    nested = nested_scene(scene, plan)
    kept = colors_kept = None
    if options.checkpoint is not None and every is not None:
        path = Path(options.checkpoint)
        if nested is not None:
            colors_kept = path.with_name(f"{path.name}.colors")
            check_checkpoint_path(colors_kept, resume=options.resume)
        camera = options.measured_camera
        of = identity_of(scene, plan, accel=accel, seed=seed, measured_camera=camera)
        kept = Checkpoint(path, every, of, resume=options.resume)

    with limited_to(options.memory):
        needs = estimate(
            scene,
            plan,
            accel=accel,
            threads=threads,
            goal=goal is not None,
            checkpoint=kept is not None,
        )
        if nested is not None:  # both are there while the colours are rendered
            its_plan = make_plan(
                nested,
                sampler=sampler,
                spp=spp,
                accel=accel,
                ray_offset=options.ray_offset,
                threads=threads,
            )
            colors = estimate(
                nested, its_plan, accel=accel, threads=threads, checkpoint=kept is not None
            )
            needs = needs.beside(colors)
        check_room(needs, scene.description.source, INSTEAD)
    rendering, build_seconds, compile_seconds = build_rendering(
        scene,
        plan,
        progress,
        accel,
        seed,
        threads,
        measured_camera=options.measured_camera,
    )
    options = options._replace(
        spp=spp,
        integrator=None,
        sampler=sampler,
        checkpoint=colors_kept,
        resume=colors_kept is not None and is_kept(colors_kept),
    )
    return Prepared(rendering, goal, kept, nested, options, build_seconds, compile_seconds)


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


def whole_number(name: str, value: object, least: int, most: int) -> int:
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
