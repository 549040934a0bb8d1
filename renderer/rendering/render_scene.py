"""`render`: from a scene to a finished image, and what it refuses."""

from __future__ import annotations

import dataclasses
import os
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from renderer.errors import ClusterError, NotAllowed, SceneError
from renderer.integrators.moment import show_moments
from renderer.process.version import VERSION
from renderer.rendering.aovs import with_picture
from renderer.rendering.cluster.connect import team_of
from renderer.rendering.picture.image import Image
from renderer.rendering.picture.picture import shown_spp
from renderer.rendering.preparation import Options, Prepared, prepare
from renderer.rendering.progress_display import shown
from renderer.rendering.render_loop import Progress, RenderLoop
from renderer.rendering.rendering import Rendering
from renderer.scene.scene import Scene

AHEAD = 2  # pictures of a sweep that are under way on a cluster beside the first


def render(
    scene: Scene,
    spp: int | None = None,
    seed: int = 0,
    threads: int | None = None,
    integrator: str | None = None,
    accel: str | None = None,
    sampler: str | None = None,
    progress: Callable[[Progress], None] | bool | None = None,
    ray_offset: str | None = None,
    measured_camera: Sequence[float] | None = None,
    target_error: float | None = None,
    time_limit: float | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    checkpoint_every: float = 60.0,
    resume: bool = False,
    cluster: Any = None,
    memory: int | float | str | None = None,
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
        One of `renderer.process.names.ACCELERATORS`, such as `brute`, `wide` or `kd-sah`;
        all give the same picture. None or `auto` take for each kind of primitive the
        structure that a cost model expects to be the fastest.
    sampler : str, optional
        A sampler's name instead of the file's; `mitsuba` is the file's with the random
        numbers that Mitsuba's scalar variants draw, so that both take the same paths.
    progress : callable or bool, optional
        Called with a `Progress` in the calling thread, several times a second. True: a bar
        with the time left, in a terminal or a notebook, else a line now and then.
    ray_offset : str, optional
        `tight` (the default) or `mitsuba`: how far off their surface new rays start.
    measured_camera : sequence of 6 floats, optional
        With the sampler `mitsuba`: what Mitsuba on this machine has in its camera's matrix,
        of which ours takes the rounding (`replay.rounding.camera`).
    target_error : float, optional
        Render until the picture's estimated error, relative to its limit, is at most this:
        0.02 is 2 % (`rendering.accuracy` has the formula). `spp` is then the most samples
        there may be, by default 1048576. The image has `error`, and `spp` says how many
        samples it took; a render of so many gives the same picture, bit for bit.
    time_limit : float, optional
        Render for about so many seconds, compilation not included; the same applies. With
        a goal a file's sampler whose points depend on their number gives way to
        `independent`.
    checkpoint : path, optional
        A file that keeps the state of the render: every so many seconds, after an interrupt
        and at the end. The one before stays beside it (docs/checkpoints.md). Colours beside
        AOVs have one of their own, with `.colors` behind the name.
    checkpoint_every : float
        Seconds between two writings of it.
    resume : bool
        Go on from the checkpoint, with any number of threads, to the picture that a render
        without a break gives, bit for bit; with the sampler `independent` also to more
        samples. Without it a file that is there is refused. A file that is missing, or
        damaged while the one before is whole, is a CheckpointWarning.
    cluster : distributed.Client, optional
        Of a Dask cluster whose workers render, with the same bits; `threads` then only
        develop the picture (docs/cluster.md). When the cluster is lost the picture so far
        comes back, with `complete` false.

    memory : int or str, optional
        The most memory that this process may have meanwhile, in bytes or such as "4GiB";
        None: what the machine has free. A render that would take more is refused, with what
        it needs; one of a large film alone can go into a file (`render_to_file`).
    light_choice : str, optional
        Where a method asks one of several lights at each point: `importance` (the default)
        takes it by what it can give there, `uniform` each as often as any other. With
        `importance` an even sky is left to the BSDFs' samples where paths follow them.

    Returns
    -------
    Image
        float32 (height, width, 3) of the crop window, linear sRGB, and AOVs. After a
        KeyboardInterrupt the picture so far, with `complete` false and the mean number of
        its samples per pixel as `spp`; `requested_spp` says how many were requested.

    Raises
    ------
    SceneError
        For a name that does not exist, a number that is out of range, a checkpoint of
        something else, or more memory than there is.
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
        checkpoint,
        checkpoint_every,
        resume,
        cluster,
        memory,
        light_choice,
    )
    with shown(progress) as show:
        return _finish(prepare(scene, options, show), show)


def render_frames(
    scenes: Iterable[Scene],
    *,
    progress: Callable[[Progress], None] | bool | None = None,
    cluster: Any = None,
    **options: Any,
) -> Iterator[Image]:
    """Render one scene after the other, such as those of a sweep.

    Parameters
    ----------
    scenes : iterable of Scene
        Taken when they are needed.
    progress, cluster, **options
        As of `render`, without a checkpoint. On a cluster the next pictures begin before
        one ends, so that no worker waits for the last tile.

    Yields
    ------
    Image
        In the order of the scenes; after one that was interrupted there are no more.

    Raises
    ------
    SceneError, ClusterError, TypeError
        As `render`; after the pictures that were under way already.
    """
    if options.get("checkpoint") is not None:
        raise SceneError("a checkpoint is of one picture, and cannot be kept of several")
    team = None if cluster is None else team_of(cluster)
    asked = Options(**options, cluster=team)
    waiting: deque[Prepared] = deque()
    following = iter(scenes)
    ahead = 0 if team is None else AHEAD
    failure: Exception | None = None

    def fill() -> None:
        while len(waiting) <= ahead and (scene := next(following, None)) is not None:
            with shown(progress) as show:
                prepared = prepare(scene, asked, show)
            waiting.append(prepared)
            if team is not None and prepared.goal is None:
                rendering = prepared.rendering
                wanted = rendering.work.samples(rendering.plan.spp)
                rendering.begun = time.perf_counter()
                team.begin(rendering, wanted)

    try:
        while True:
            if failure is None:
                try:
                    fill()
                except Exception as error:  # those before it are whole, and half rendered
                    failure = error
            if not waiting and failure is not None:
                raise failure
            if not waiting:
                return
            with shown(progress) as show:  # its bar has gone when others may print
                image = _finish(waiting.popleft(), show)
            yield image
            if not image.complete:
                return
    finally:
        for prepared in waiting:
            if team is not None:
                team.end(prepared.rendering)


def _finish(prepared: Prepared, progress: Callable[[Progress], None] | None) -> Image:
    """Trace, and return the picture."""
    rendering, options = prepared.rendering, prepared.of_colors
    if prepared.goal is None and prepared.kept is None and options.cluster is None:
        rendering.keep_no_sums()
    complete = RenderLoop(
        rendering, progress, prepared.goal, prepared.kept, options.cluster
    ).run()
    if rendering.trouble and rendering.samples_done == 0:
        raise ClusterError(rendering.trouble)
    seconds = rendering.seconds + prepared.build_seconds
    image = image_of(rendering, seconds, prepared.compile_seconds, complete)
    if prepared.nested is None or not complete:
        return image
    try:
        picture = _finish(prepare(prepared.nested, options, progress), progress)
    except (KeyboardInterrupt, ClusterError, NotAllowed) as error:
        why = f": {error}" if str(error) else ""
        interrupted = {"interrupted": f"before the first sample of the colours{why}"}
        metadata = {**image.metadata, **interrupted}
        return dataclasses.replace(image, spp=0, complete=False, metadata=metadata)
    both = with_picture(image, picture)
    return dataclasses.replace(both, metadata={**picture.metadata, **image.metadata})


def image_of(
    rendering: Rendering, seconds: float, compile_seconds: float, complete: bool
) -> Image:
    """Return what a rendering has come to: of a band, its rows that are complete."""
    plan, accuracy = rendering.plan, rendering.accuracy
    asked = rendering.scene.description.integrator
    show = plan.kind.show if plan.moments is None else partial(show_moments, plan.kind)
    shown = show(rendering.develop(), asked)
    return Image(
        np.ascontiguousarray(shown.pixels),
        aovs=shown.aovs,
        aov_kinds=shown.aov_kinds,
        spp=rendering.spp,
        requested_spp=None if rendering.has_goal else plan.spp,
        samples=rendering.samples_done,
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
    spp = shown_spp(rendering.spp)
    return [f"{'goal':<10} {spp} samples per pixel were taken: {error}"]


def _metadata(rendering: Rendering, complete: bool) -> dict[str, str]:
    """Return what a file should say about its making; the same for the same picture."""
    metadata = {
        "lightproof": VERSION,
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
