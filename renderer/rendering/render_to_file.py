"""`render_to_file`: renders a picture larger than memory in bands, to an EXR file."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial, reduce
from pathlib import Path

from renderer.errors import SceneError
from renderer.process import memory as room_of_memory
from renderer.process.names import REPLAY
from renderer.rendering.aovs import plans_of, with_picture
from renderer.rendering.film.band import Band
from renderer.rendering.job import RenderJob, build_job, film_shape
from renderer.rendering.keywords import with_keywords
from renderer.rendering.memory_estimate import check_room, estimate_all, rows_at_once
from renderer.rendering.picture.exr_rows import ExrRows
from renderer.rendering.picture.image import Image
from renderer.rendering.planning.plan import Plan
from renderer.rendering.progress_display import Progress, shown
from renderer.rendering.render import image_of
from renderer.rendering.render_loop import run
from renderer.rendering.render_options import OPTIONS, RenderOptions
from renderer.scene.scene import Scene

POSSIBLE = "possible is `render`"


@dataclass(frozen=True)
class PictureFile:
    """A picture that is only in a file, not in memory."""

    path: Path
    width: int
    height: int
    spp: float  # this and the following fields as in `Image`
    samples: int
    seconds: float
    compile_seconds: float
    metadata: Mapping[str, str]


def to_file_with(scene: Scene, path: str | Path, options: RenderOptions) -> PictureFile:
    """Render a scene into an EXR file, a band of rows at a time.

    The file is identical to that of `render(...).save(path)`, byte for byte. Neither the
    film nor the picture is ever in memory as a whole. After an interrupt there is no file.

    Parameters
    ----------
    scene
        As for `render`.
    path
        A file name that ends in .exr.
    {options}

    Returns
    -------
    PictureFile
        The attributes of the picture, without its pixels.

    Raises
    ------
    KeyboardInterrupt
        If the render was interrupted.
    SceneError
        As `render`; if the file cannot be written; for the integrator `work`, whose colours
        are relative to the whole picture; for replays of Mitsuba; and for options that need
        the whole film: a goal, a checkpoint, a cluster.
    """
    for name in options.given():
        if "bands" not in OPTIONS[name].roles:
            raise SceneError(f"{name} needs the whole film in memory; {POSSIBLE}")
    todo = plans_of(scene, options)
    for _, plan in todo:
        if needs_whole_film(plan):
            what = f"sampler {REPLAY!r}" if plan.replay else f"integrator {plan.method!r}"
            raise SceneError(f"{what} needs the whole film in memory; {POSSIBLE}")
    with room_of_memory.limited_to(options.memory):
        rows = min(
            rows_at_once(film_shape(*each), room_of_memory.room() // len(todo))
            for each in todo
        )
        least = max(film_shape(*each).carried + 1 for each in todo)
        needs = estimate_all(todo, options, rows)
        while needs.total > room_of_memory.room() and rows > least:
            rows = max(rows // 2, least)  # kernels and the picture need memory too
            needs = estimate_all(todo, options, rows)
        possible = "a film of fewer columns; fewer threads; --memory SIZE"
        check_room(needs, scene.description.source, possible)
    film = scene.description.camera.film
    rows_of_file = ExrRows(Path(path), film.crop_width, film.crop_height)
    with shown(options.progress) as display, rows_of_file as file:
        jobs = [build_job(of, its_plan, options, display) for of, its_plan in todo]
        show = _Progress(jobs, display)
        for bands in zip(*(_bands(job, rows, show) for job in jobs), strict=True):
            image = reduce(with_picture, bands)
            file.add(image)
    return PictureFile(
        Path(path),
        film.crop_width,
        film.crop_height,
        image.spp,
        show.samples,
        sum(job.build_seconds for job in jobs) + show.seconds,
        sum(job.compile_seconds for job in jobs),
        image.metadata,
    )


render_to_file = with_keywords(RenderOptions, to_file_with, "render_to_file")


def needs_whole_film(plan: Plan) -> bool:
    """Return whether a plan cannot be rendered in bands."""
    return plan.kind.counts_work or plan.replay


def fits_in_memory(scene: Scene, options: RenderOptions) -> bool | None:
    """Return whether the film fits into memory; None if bands would not help.

    Raises
    ------
    SceneError
        As `render`.
    """
    renders = plans_of(scene, options)
    if needs_whole_film(renders[0][1]):
        return None
    needs = estimate_all(renders, options)
    return needs.total <= room_of_memory.room()


class _Progress:
    """Accumulates the progress of several renders that alternate, each in bands."""

    def __init__(
        self, jobs: list[RenderJob], progress: Callable[[Progress], None] | None
    ) -> None:
        self._progress = progress
        self._total = sum(map(_samples, jobs))
        self.samples = 0  # in completed bands
        self._start = time.perf_counter()

    @property
    def seconds(self) -> float:
        """Seconds since the preparation ended."""
        return time.perf_counter() - self._start

    def show(self, samples: int, now: Progress) -> None:
        """Report the total progress; the current band started after `samples` samples."""
        if self._progress is not None:
            done = self.samples + now.done - samples
            self._progress(Progress("render", done, self._total, self.seconds))


def _samples(job: RenderJob) -> int:
    width, height = (side + 2 * job.shape.beyond for side in job.shape[3:5])
    return width * height * job.plan.spp


def _bands(job: RenderJob, rows: int, show: _Progress) -> Iterator[Image]:
    """Render the bands in order, and yield the picture rows of each.

    Raises
    ------
    KeyboardInterrupt
        If one is interrupted.
    """
    film: Band | None = Band(job.shape, rows)
    while film is not None:
        begun = film.samples_done
        outcome = run(job, film, progress=partial(show.show, begun))
        if not outcome.complete:
            raise KeyboardInterrupt
        show.samples += film.samples_done - begun
        yield image_of(job, film, outcome, job.options.metadata)
        film = film.following()
