"""`render`: from a scene to a finished image, and what it refuses."""

from __future__ import annotations

import dataclasses
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial

import numpy as np

from renderer.errors import ClusterError, NotAllowed, SceneError
from renderer.integrators.moment import show_moments
from renderer.process.version import VERSION
from renderer.rendering.aovs import with_picture
from renderer.rendering.cluster.connect import team_of
from renderer.rendering.options import RenderOptions, with_keywords
from renderer.rendering.picture.image import Image
from renderer.rendering.picture.picture import shown_spp
from renderer.rendering.preparation import Prepared, prepare
from renderer.rendering.progress_display import Progress, shown
from renderer.rendering.render_loop import RenderLoop
from renderer.rendering.rendering import Rendering
from renderer.scene.scene import Scene

AHEAD = 2  # pictures of a sweep that are under way on a cluster beside the first


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
        If `scene` is not a Scene, or an option has another type than it needs.
    """
    with shown(options.progress) as show:
        return _finish(prepare(scene, options, show), show)


render = with_keywords(RenderOptions, render_with, "render")


def frames_with(scenes: Iterable[Scene], options: RenderOptions) -> Iterator[Image]:
    """Render one scene after the other, such as those of a sweep.

    On a cluster the next pictures begin before one ends, so that no worker waits for the
    last tile.

    Parameters
    ----------
    scenes : iterable of Scene
        Taken when they are needed.
    {options}

    Yields
    ------
    Image
        In the order of the scenes; after one that was interrupted there are no more.

    Raises
    ------
    SceneError, ClusterError, TypeError
        As `render`; after the pictures that were under way already.
    """
    if options.checkpoint is not None:
        raise SceneError("a checkpoint is of one picture, and cannot be kept of several")
    team = None if options.cluster is None else team_of(options.cluster)
    requested = dataclasses.replace(options, cluster=team)
    waiting: deque[Prepared] = deque()
    following = iter(scenes)
    ahead = 0 if team is None else AHEAD
    failure: Exception | None = None

    def fill() -> None:
        while len(waiting) <= ahead and (scene := next(following, None)) is not None:
            with shown(options.progress) as show:
                prepared = prepare(scene, requested, show)
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
            with shown(options.progress) as show:  # its bar has gone when others may print
                image = _finish(waiting.popleft(), show)
            yield image
            if not image.complete:
                return
    finally:
        for prepared in waiting:
            if team is not None:
                team.end(prepared.rendering)


render_frames = with_keywords(RenderOptions, frames_with, "render_frames")


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
    compile_seconds, metadata = prepared.compile_seconds, options.metadata
    image = image_of(rendering, seconds, compile_seconds, complete, metadata)
    if prepared.nested is None or not complete:
        return image
    try:
        picture = _finish(prepare(prepared.nested, options, progress), progress)
    except (KeyboardInterrupt, ClusterError, NotAllowed) as error:
        why = f": {error}" if str(error) else ""
        interrupted = {"interrupted": f"before the first sample of the colours{why}"}
        notes = {**image.metadata, **interrupted}
        return dataclasses.replace(image, spp=0, complete=False, metadata=notes)
    both = with_picture(image, picture)
    return dataclasses.replace(both, metadata={**picture.metadata, **image.metadata})


def image_of(
    rendering: Rendering,
    seconds: float,
    compile_seconds: float,
    complete: bool,
    metadata: Mapping[str, str] | None,
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
        metadata={**_metadata(rendering, complete), **shown.notes, **(metadata or {})},
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
