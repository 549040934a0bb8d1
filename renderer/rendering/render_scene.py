"""`render`: from a scene to a finished image, and what it refuses."""

from __future__ import annotations

import dataclasses
import operator
import reprlib
import time
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from renderer.accelerators.build import compile_builders
from renderer.errors import SceneError
from renderer.integrators.moment import show_moments
from renderer.names import ACCELERATORS
from renderer.picture.image import Image
from renderer.rendering.aovs import nested_scene, with_picture
from renderer.rendering.compilation import CompilationWatch
from renderer.rendering.goal import Goal, check_goal, for_a_goal
from renderer.rendering.planning.plan import MOST_SAMPLES, make_plan
from renderer.rendering.rendering import Progress, Rendering
from renderer.scene.scene import Scene
from renderer.threads import default_threads

MOST_THREADS = 1024


def render(
    scene: Scene,
    spp: int | None = None,
    seed: int = 0,
    threads: int | None = None,
    integrator: str | None = None,
    accel: str | None = None,
    sampler: str | None = None,
    progress: Callable[[Progress], None] | None = None,
    ray_offset: str | None = None,
    measured_camera: Sequence[float] | None = None,
    target_error: float | None = None,
    time_limit: float | None = None,
    light_choice: str | None = None,
) -> Image:
    """Render a scene.

    Parameters
    ----------
    scene : Scene
        From `load_file`, `load_string` or `load_dict`.
    spp : int, optional
        Samples per pixel; None takes the file's.
    seed : int
        The same seed gives the same image, bit for bit, at any number of threads.
    threads : int, optional
        None takes all processors.
    integrator : str, optional
        `direct`, `whitted`, `path`, `depth`, `aov` or `work`; None or `auto` take the
        least method that gives what the file asks for.
    accel : str, optional
        One of `renderer.names.ACCELERATORS`, such as `brute`, `wide` or `kd-sah`; all
        give the same picture. None or `auto` take for each kind of primitive the structure
        that a cost model expects to be the fastest.
    sampler : str, optional
        A sampler's name instead of the file's; `mitsuba` is the file's with the random
        numbers that Mitsuba's scalar variants draw, so that both take the same paths.
    progress : callable, optional
        Called with a `Progress` in the calling thread, several times a second.
    ray_offset : str, optional
        `tight` (the default) or `mitsuba`: how far off their surface new rays start.
    measured_camera : sequence of 6 floats, optional
        With the sampler `mitsuba`: what Mitsuba on this machine has in its camera's matrix,
        of which ours takes the rounding (`replay.camera`).
    target_error : float, optional
        Render until the picture's estimated error, relative to its limit, is at most this:
        0.02 is 2 % (`rendering.accuracy` has the formula). `spp` is then the most samples
        there may be, by default 1048576. The image has `error`, and `spp` says how many
        samples it took; a render of so many gives the same picture, bit for bit.
    time_limit : float, optional
        Render for about so many seconds, compilation not included; the same applies. With
        a goal a file's sampler whose points depend on their number gives way to
        `independent`.
    light_choice : str, optional
        Where a method asks one of several lights at each point: `importance` (the default)
        takes it by what it can give there, `uniform` each as often as any other.

    Returns
    -------
    Image
        float32 (height, width, 3) of the crop window, linear sRGB, and AOVs. After a
        KeyboardInterrupt the picture so far, with `complete` false.

    Raises
    ------
    SceneError
        For a name that does not exist or a number that is out of range.
    TypeError
        For a scene that is none, and for `spp`, `seed` or `threads` that are no whole
        numbers.
    """
    if not isinstance(scene, Scene):
        raise TypeError(
            f"the scene is {_shown(scene)}; possible is what `load_file`, `load_string` or "
            "`load_dict` returns"
        )
    threads = default_threads() if threads is None else threads
    threads = _whole_number("threads", threads, 1, MOST_THREADS)
    seed = _whole_number("seed", seed, 0, 2**32 - 1)
    spp = None if spp is None else _whole_number("spp", spp, 1, MOST_SAMPLES)
    goal = None
    if target_error is not None or time_limit is not None:
        goal = Goal(
            _positive("target_error", target_error), _positive("time_limit", time_limit)
        )
        sampler, spp = for_a_goal(scene, sampler, spp)
    accel = accel or "auto"
    if accel not in ACCELERATORS:
        known = ", ".join(ACCELERATORS)
        raise SceneError(f"accelerator {accel!r} is unknown; there are: {known}")
    plan = make_plan(
        scene,
        integrator=integrator,
        sampler=sampler,
        spp=spp,
        accel=accel,
        ray_offset=ray_offset,
        threads=threads,
        light_choice=light_choice,
    )

    if goal is not None:
        check_goal(plan)

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
        )
        build_seconds = time.perf_counter() - started - rendering.methods_seconds
        compile_seconds += rendering.methods_seconds + rendering.compile()
    if progress is not None and watch.compiled:
        progress(Progress("compile", 1, 1, compile_seconds))
    started = time.perf_counter()
    complete = rendering.run(progress, goal)
    seconds = time.perf_counter() - started + build_seconds
    image = _image(rendering, seconds, compile_seconds, complete)
    nested = nested_scene(scene, plan)
    if nested is None or not complete:
        return image
    try:
        picture = render(
            nested,
            spp,
            seed,
            threads,
            accel=accel,
            sampler=sampler,
            progress=progress,
            ray_offset=ray_offset,
            measured_camera=measured_camera,
            light_choice=light_choice,
        )
    except KeyboardInterrupt:  # before its first sample
        interrupted = {"interrupted": "before the first sample of the colours"}
        metadata = {**image.metadata, **interrupted}
        return dataclasses.replace(image, complete=False, metadata=metadata)
    both = with_picture(image, picture)
    return dataclasses.replace(both, metadata={**picture.metadata, **image.metadata})


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


def _image(
    rendering: Rendering, seconds: float, compile_seconds: float, complete: bool
) -> Image:
    plan, accuracy = rendering.plan, rendering.accuracy
    asked = rendering.scene.description.integrator
    show = plan.kind.show if plan.moments is None else partial(show_moments, plan.kind)
    shown = show(rendering.film.develop(rendering.threads), asked)
    return Image(
        np.ascontiguousarray(shown.pixels),
        aovs=shown.aovs,
        aov_kinds=shown.aov_kinds,
        spp=rendering.spp,
        seconds=seconds,
        compile_seconds=compile_seconds,
        threads=rendering.threads,
        integrator=plan.method,
        explain="\n".join([*plan.lines, *_reached(rendering)]),
        metadata={**_metadata(rendering, complete), **shown.notes},
        complete=complete,
        error=None if accuracy is None else accuracy.error,
        error_of_pixels=None if accuracy is None else accuracy.of_pixels,
        error_unsure=accuracy is not None and accuracy.unsure,
    )


def _reached(rendering: Rendering) -> list[str]:
    """Return the line that says how a goal was met, if there was one."""
    if rendering.accuracy is None:
        return []
    error = f"estimated error {rendering.accuracy.error:.2%}"
    return [f"{'goal':<10} {rendering.spp} samples per pixel were taken: {error}"]


def _metadata(rendering: Rendering, complete: bool) -> dict[str, str]:
    """Return what a file should say about its making; the same for the same picture."""
    from renderer import __version__

    metadata = {
        "lightproof": __version__,
        "integrator": rendering.plan.method,
        "sampler": rendering.plan.sampler_name,
        "seed": str(rendering.seed),
    }
    if rendering.accuracy is not None:
        metadata["error"] = f"{rendering.accuracy.error:.4g}"
        if rendering.accuracy.unsure:
            metadata["error_unsure"] = "the true one may well be another"
    if not complete:
        done, samples = rendering.samples_done, rendering.samples_in_all
        of = "" if rendering.has_goal else f" of {samples}"
        metadata["interrupted"] = f"after {done}{of} samples"
    return metadata
