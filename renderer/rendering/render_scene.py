"""`render`: from a scene to a finished image, and what it refuses."""

from __future__ import annotations

import dataclasses
import operator
import reprlib
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from renderer.accelerators.build import compile_builders
from renderer.errors import ClusterError, SceneError
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
AHEAD = 2  # pictures of a sweep that are under way on a cluster beside the first


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
    cluster: Any = None,
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
    cluster : distributed.Client, optional
        Of a Dask cluster whose workers render, with the same bits; `threads` then only
        develop the picture (docs/cluster.md). When the cluster is lost the picture so far
        comes back, with `complete` false.

    Returns
    -------
    Image
        float32 (height, width, 3) of the crop window, linear sRGB, and AOVs. After a
        KeyboardInterrupt the picture so far, with `complete` false.

    Raises
    ------
    SceneError
        For a name that does not exist or a number that is out of range.
    ClusterError
        If a cluster cannot do anything of it.
    TypeError
        For a scene that is none, and for `spp`, `seed` or `threads` that are no whole
        numbers.
    """
    options = Options(
        spp,
        seed,
        threads,
        integrator,
        accel,
        sampler,
        ray_offset,
        measured_camera,
        target_error,
        time_limit,
        cluster,
    )
    return _finish(_prepare(scene, options, progress), progress)


def render_frames(
    scenes: Iterable[Scene],
    *,
    progress: Callable[[Progress], None] | None = None,
    cluster: Any = None,
    **options: Any,
) -> Iterator[Image]:
    """Render one scene after the other, such as those of a sweep.

    Parameters
    ----------
    scenes : iterable of Scene
        Taken when they are needed.
    progress, cluster, **options
        As of `render`. On a cluster the next pictures begin before one ends, so that no
        worker waits for the last tile.

    Yields
    ------
    Image
        In the order of the scenes; after one that was interrupted there are no more.

    Raises
    ------
    SceneError, ClusterError, TypeError
        As `render`.
    """
    asked = Options(**options, cluster=None if cluster is None else _team(cluster))
    waiting: deque[_Prepared] = deque()
    following = iter(scenes)
    try:
        while True:
            ahead = 0 if asked.cluster is None else AHEAD
            while len(waiting) <= ahead and (scene := next(following, None)) is not None:
                prepared = _prepare(scene, asked, progress)
                waiting.append(prepared)
                if asked.cluster is not None and prepared.goal is None:
                    prepared.rendering.begin(asked.cluster)
            if not waiting:
                return
            image = _finish(waiting.popleft(), progress)
            yield image
            if not image.complete:
                return
    finally:
        for prepared in waiting:
            prepared.rendering.end()


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
    cluster: Any = None


class _Prepared(NamedTuple):
    rendering: Rendering
    goal: Goal | None
    options: Options
    build_seconds: float
    compile_seconds: float


def _team(cluster: Any) -> Any:
    from renderer.rendering.cluster.connect import team_of

    return team_of(cluster)


def _prepare(
    scene: Scene, options: Options, progress: Callable[[Progress], None] | None
) -> _Prepared:
    """Check what is asked for, and do all that comes before the first sample."""
    if not isinstance(scene, Scene):
        raise TypeError(
            f"the scene is {_shown(scene)}; possible is what `load_file`, `load_string` or "
            "`load_dict` returns"
        )
    if options.cluster is not None:
        options = options._replace(cluster=_team(options.cluster))
    threads = default_threads() if options.threads is None else options.threads
    threads = _whole_number("threads", threads, 1, MOST_THREADS)
    seed = _whole_number("seed", options.seed, 0, 2**32 - 1)
    spp = options.spp
    spp = None if spp is None else _whole_number("spp", spp, 1, MOST_SAMPLES)
    sampler, goal = options.sampler, None
    target_error = _positive("target_error", options.target_error)
    time_limit = _positive("time_limit", options.time_limit)
    if target_error is not None or time_limit is not None:
        goal = Goal(target_error, time_limit)
        sampler, spp = for_a_goal(scene, sampler, spp)
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
            measured_camera=options.measured_camera,
        )
        build_seconds = time.perf_counter() - started - rendering.methods_seconds
        compile_seconds += rendering.methods_seconds + rendering.compile()
    if progress is not None and watch.compiled:
        progress(Progress("compile", 1, 1, compile_seconds))
    options = options._replace(spp=spp, sampler=sampler)
    return _Prepared(rendering, goal, options, build_seconds, compile_seconds)


def _finish(prepared: _Prepared, progress: Callable[[Progress], None] | None) -> Image:
    """Trace, and return the picture."""
    rendering, options = prepared.rendering, prepared.options
    started = time.perf_counter()
    complete = rendering.run(progress, prepared.goal, options.cluster)
    if rendering.trouble and rendering.samples_done == 0:
        raise ClusterError(rendering.trouble)
    seconds = time.perf_counter() - started + prepared.build_seconds
    image = _image(rendering, seconds, prepared.compile_seconds, complete)
    nested = nested_scene(rendering.scene, rendering.plan)
    if nested is None or not complete:
        return image
    try:
        options = options._replace(integrator=None)
        picture = _finish(_prepare(nested, options, progress), progress)
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
        if rendering.trouble:
            metadata["interrupted"] += f": {rendering.trouble}"
    return metadata
