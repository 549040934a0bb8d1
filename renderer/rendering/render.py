"""Renders a scene: plan -> job -> tiles -> film -> image.

`begin` does everything before the first sample, `finish` the rest. The steps are:

    make_plan        decides what is done, and why          planning/make_plan.py
    build_job        builds BVHs, compiles the kernels      job.py
    make_film        allocates the sums of the film         film/film.py
    a source         adds samples to tiles: threads, or     tile_sources.py
                     the workers of a cluster               cluster/source.py
    run              the loop: goals, checkpoints, Ctrl-C   render_loop.py
    image_of         divides the sums by their weights      picture/image.py

A film that is larger than memory is rendered in bands (`render_to_file.py`); each band is
a film for the same loop.
"""

from __future__ import annotations

import dataclasses
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from renderer.errors import ClusterError, NotAllowed, SceneError
from renderer.process.memory import limited_to
from renderer.process.names import VERSION
from renderer.rendering.accuracy import Accuracy
from renderer.rendering.aovs import plans_of, with_picture
from renderer.rendering.checkpoints.checkpoint import (
    Checkpoint,
    check_checkpoint_path,
    is_kept,
)
from renderer.rendering.checkpoints.identity import identity_of
from renderer.rendering.cluster.connect import workers_of
from renderer.rendering.denoise import SPP as SPP_OF_GUIDES
from renderer.rendering.denoise import check_denoising, denoised, guides_of
from renderer.rendering.film.film import Film
from renderer.rendering.goal import Goal, goal_of, options_of_goal
from renderer.rendering.job import RenderJob, build_job
from renderer.rendering.keywords import with_keywords
from renderer.rendering.memory_estimate import check_room, estimate_all
from renderer.rendering.picture.image import Image
from renderer.rendering.picture.picture import shown_spp
from renderer.rendering.progress_display import Progress
from renderer.rendering.render_loop import Outcome, run
from renderer.rendering.render_options import RenderOptions, shown_value
from renderer.rendering.tile_sources import Threads, TileSource
from renderer.rendering.watching.notebook import watched
from renderer.scene.scene import Scene

_END: Any = object()  # marks the end of the scenes of a sweep
_OF_GUIDES = ("seed", "threads", "accel", "memory")  # options shared with denoiser guides
AHEAD = 2  # pictures of a sweep that are started on a cluster after the current one
INSTEAD = (
    "a smaller film; `-o NAME.exr` alone (`render_to_file`), which is written in bands "
    "(not with --frames, --cluster, --checkpoint or a goal); fewer threads; --memory SIZE, "
    "if there is more"
)
Show = Callable[[Progress], None] | None


def render_with(scene: Scene, options: RenderOptions) -> Image:
    """Render a scene.

    Parameters
    ----------
    scene : Scene
        From `load_file`, `load_string` or `load_dict`.
    {options}

    Returns
    -------
    Image
        float32 (height, width, 3) of the crop window, linear sRGB, and AOVs. After a
        KeyboardInterrupt it is the picture so far: `complete` is false, `spp` is the
        mean number of samples per pixel, and `requested_spp` the number that was
        requested.

    Raises
    ------
    SceneError
        If a name does not exist, a number is out of range, a checkpoint belongs to
        another render, or the render needs more memory than is available.
    ClusterError
        If a cluster cannot render any part of it.
    TypeError
        If `scene` is not a Scene, or an option has another type than it needs.
    """
    with watched(options) as show:
        return finish(begin(scene, options, show), show)


render = with_keywords(RenderOptions, render_with, "render")


class Begun(NamedTuple):
    """A render that is ready for its first sample."""

    job: RenderJob
    film: Film
    source: TileSource
    goal: Goal | None
    checkpoint: Checkpoint | None
    colors: tuple[Scene, RenderOptions] | None  # with AOVs: the second render


def begin(scene: Scene, options: RenderOptions, show: Show) -> Begun:
    """Check the options, and do everything that precedes the first sample."""
    if not isinstance(scene, Scene):
        possible = "possible is what `load_file`, `load_string` or `load_dict` returns"
        raise TypeError(f"the scene is {shown_value(scene)}; {possible}")
    workers = None if options.cluster is None else workers_of(options.cluster)
    options = options_of_goal(scene, options)
    (_, plan), *of_colors = renders = plans_of(scene, options)
    goal = goal_of(options, plan)
    if options.denoise:
        check_denoising(plan, has_colors=bool(of_colors))
    checkpoint, options_of_colors = _checkpoints(scene, options, renders)
    with limited_to(options.memory):  # AOVs stay in memory while the colours are rendered
        check_room(estimate_all(renders, options), scene.description.source, INSTEAD)
    job = build_job(scene, plan, options, show)
    film = job.make_film(keep_sums=any((goal, checkpoint, workers)))
    source = Threads(job, film) if workers is None else workers.source(job, film)
    colors = (of_colors[0][0], options_of_colors) if of_colors else None
    return Begun(job, film, source, goal, checkpoint, colors)


def finish(begun: Begun, show: Show) -> Image:
    """Render the samples and return the picture, denoised if it is complete."""
    image, job = _picture(begun, show), begun.job
    if not (job.options.denoise and image.complete):
        return image
    same = {name: getattr(job.options, name) for name in _OF_GUIDES}
    options = RenderOptions(spp=SPP_OF_GUIDES, sampler="multijitter", **same)
    return denoised(image, finish(begin(guides_of(job.scene), options, None), None))


def _picture(begun: Begun, show: Show) -> Image:
    job, film, source, goal, checkpoint, colors = begun
    outcome = run(job, film, source, goal=goal, checkpoint=checkpoint, progress=show)
    if outcome.trouble and film.samples_done == 0:
        raise ClusterError(outcome.trouble)
    image = image_of(job, film, outcome, job.options.metadata)
    if colors is None or not outcome.complete:
        return image
    try:
        picture = finish(begin(*colors, show), show)
    except (KeyboardInterrupt, ClusterError, NotAllowed) as error:
        why = f": {error}" if str(error) else ""
        interrupted = {"interrupted": f"before the first sample of the colours{why}"}
        metadata = {**image.metadata, **interrupted}
        return dataclasses.replace(image, spp=0, complete=False, metadata=metadata)
    return with_picture(image, picture)


def _checkpoints(
    scene: Scene, options: RenderOptions, renders: list[Any]
) -> tuple[Checkpoint | None, RenderOptions]:
    """Return the checkpoint, and the options for the colours with their own checkpoint."""
    without = dataclasses.replace(
        options, integrator=None, checkpoint=None, resume=False, denoise=False
    )
    if options.checkpoint is None:
        return None, without
    path = Path(options.checkpoint)
    if len(renders) > 1:
        of_colors = path.with_name(f"{path.name}.colors")
        check_checkpoint_path(of_colors, resume=options.resume)
        resume = is_kept(of_colors)
        without = dataclasses.replace(without, checkpoint=of_colors, resume=resume)
    of = identity_of(scene, renders[0][1], options)
    every = options.checkpoint_every
    return Checkpoint(path, every, of, resume=options.resume), without


def frames_with(scenes: Iterable[Scene], options: RenderOptions) -> Iterator[Image]:
    """Render a sequence of scenes, such as those of a sweep.

    On a cluster the next pictures start before the current one ends, so that no worker
    waits for its last tile.

    Parameters
    ----------
    scenes : iterable of Scene
        Iterated when a scene is needed.
    {options}

    Yields
    ------
    Image
        In the order of the scenes. The sequence ends after an interrupted picture.

    Raises
    ------
    SceneError, ClusterError, TypeError
        As `render`, after the pictures that were already started.
    """
    if options.checkpoint is not None:
        raise SceneError("a checkpoint is of one picture, and cannot be kept of several")
    workers = None if options.cluster is None else workers_of(options.cluster)
    options = dataclasses.replace(options, cluster=workers)
    waiting: deque[Begun] = deque()
    following = iter(scenes)
    failure: Exception | None = None

    def fill() -> None:
        ahead = 0 if workers is None else AHEAD
        while len(waiting) <= ahead and (scene := next(following, _END)) is not _END:
            with watched(options) as show:
                begun = begin(scene, options, show)
            waiting.append(begun)
            if workers is not None and begun.goal is None:
                begun.source.start(begun.film.work.samples(begun.job.plan.spp))

    try:
        while True:
            if failure is None:
                try:
                    fill()
                except Exception as error:  # raised after the pictures before it
                    failure = error
            if not waiting and failure is not None:
                raise failure
            if not waiting:
                return
            with watched(options) as show:  # the bar is removed before others print
                image = finish(waiting.popleft(), show)
            yield image
            if not image.complete:
                return
    finally:
        for begun in waiting:
            begun.source.end()


render_frames = with_keywords(RenderOptions, frames_with, "render_frames")


def image_of(
    job: RenderJob, film: Film, outcome: Outcome, metadata: Mapping[str, str] | None
) -> Image:
    """Return the picture of the samples in a film; for a band, its complete rows."""
    plan, accuracy = job.plan, outcome.accuracy
    shown = job.shown(film.develop(job.threads))
    return Image(
        np.ascontiguousarray(shown.pixels),
        aovs=shown.aovs,
        aov_kinds=shown.aov_kinds,
        spp=film.spp,
        requested_spp=None if outcome.has_goal else plan.spp,
        samples=film.samples_done,
        seconds=outcome.seconds + job.build_seconds,
        compile_seconds=job.compile_seconds,
        threads=job.threads,
        integrator=plan.method,
        explain="\n".join([*plan.lines, *_reached(film, accuracy)]),
        metadata={**_notes(job, film, outcome), **shown.notes, **(metadata or {})},
        complete=outcome.complete,
        error=None if accuracy is None else accuracy.error,
        error_of_pixels=None if accuracy is None else accuracy.of_pixels,
        error_unsure=accuracy is not None and accuracy.unsure,
    )


def _reached(film: Film, accuracy: Accuracy | None) -> list[str]:
    """Return the line on how a goal was reached, if there was one."""
    if accuracy is None:
        return []
    error = f"estimated error {accuracy.error:.2%}"
    spp = shown_spp(film.spp)
    return [f"{'goal':<10} {spp} samples per pixel were taken: {error}"]


def _notes(job: RenderJob, film: Film, outcome: Outcome) -> dict[str, str]:
    """Return metadata about the render; equal for equal pictures."""
    notes = {
        "lightproof": VERSION,
        "integrator": job.plan.method,
        "sampler": job.plan.sampler_name,
        "seed": str(job.options.seed),
    }
    if outcome.accuracy is not None:
        notes["error"] = f"{outcome.accuracy.error:.4g}"
        if outcome.accuracy.unsure:
            notes["error_unsure"] = "the true one may well be another"
    if not outcome.complete:
        of = "" if outcome.has_goal else f" of {film.pixels * job.plan.spp}"
        notes["interrupted"] = f"after {film.samples_done}{of} samples"
        if outcome.trouble:
            notes["interrupted"] += f": {outcome.trouble}"
    return notes
