"""Scenes compared one after the other: verdicts, tables, the report's files."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console

from mitsuba_ref.command.compile_ahead import compile_kernels, kernel_requests
from mitsuba_ref.command.scene_table import print_table
from mitsuba_ref.command.stages import shown_stages
from mitsuba_ref.command.validation import Validated, validate_scene
from mitsuba_ref.our_renderer.picture import RenderOurs, render_ours
from mitsuba_ref.records import machine
from mitsuba_ref.records.json_files import write_atomically, write_json
from mitsuba_ref.records.options import Options
from mitsuba_ref.records.results import Results, SceneResult
from mitsuba_ref.records.verdicts import exit_status
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.picture_process import MitsubaWorker

WRONG_USE, INTERRUPTED = 2, 130

Validate = Callable[[Path, Callable[[str], None]], Validated]


def validate_scenes(
    scenes: Mapping[str, Path],
    options: Options,
    report: Path | None,
    given: Sequence[str],
    ours: RenderOurs | None = None,
) -> int:
    """Compare scenes, print the tables and return the exit status.

    Parameters
    ----------
    scenes
        Files by name.
    options
        Of the command line.
    report
        Folder for results.json and the pictures; None: nothing is written.
    given
        The command line, for the record.
    ours
        Our renderer; None: the real one.
    """
    results: list[SceneResult] = []
    console = Console(stderr=True)
    try:
        with (
            shown_stages() as show,
            validator(scenes.values(), options, show, ours) as validate,
        ):
            for index, (name, path) in enumerate(scenes.items(), start=1):
                place = f"{name} ({index} of {len(scenes)}): "

                def progress(stage: str, place: str = place) -> None:
                    show(place + stage)

                results.append(keep(validate(path, progress), name, report))
        _finish(results, given, report)
    except KeyboardInterrupt:
        console.print("interrupted; the scenes so far:")
        _finish(results, given, report)
        return INTERRUPTED
    except OSError as error:  # what a scene meets is in its verdict
        console.print(f"lightproof-validate: {error}", markup=False, soft_wrap=True)
        return WRONG_USE
    return exit_status(scene.verdict for scene in results)


@contextmanager
def validator(
    scenes: Iterable[Path],
    options: Options,
    show: Callable[[str], None],
    ours: RenderOurs | None = None,
) -> Iterator[Validate]:
    """Start Mitsuba, compile what several scenes need; yield what compares a scene.

    Parameters
    ----------
    scenes
        Files that will be compared.
    options
        Of all scenes.
    show
        Told what is being done before the first scene.
    ours
        Our renderer; None: the real one.

    Yields
    ------
    Callable
        `validate(path, progress)`, as `validate_scene`.
    """
    files = list(scenes)
    with MitsubaWorker(options.time_limit) as worker:
        references = ReferenceCache(worker.render)
        if len(files) > 1 and ours is None:
            _warm_up(files, options, show)
        yield lambda path, progress: validate_scene(
            path, options, ours or render_ours, references, progress
        )


def _warm_up(scenes: Iterable[Path], options: Options, show: Callable[[str], None]) -> None:
    """Compile the kernels of all scenes before the first is measured."""
    requests = kernel_requests(scenes, options)
    if requests:
        count = len(requests)
        show(f"compiling our kernels, once: 0 of {count}")
        compile_kernels(
            requests,
            lambda done: show(f"compiling our kernels, once: {done} of {count}"),
        )


def _finish(results: list[SceneResult], given: Sequence[str], report: Path | None) -> None:
    # In a pipe rich would assume 80 columns and cut the numbers.
    output = Console() if sys.stdout.isatty() else Console(width=120)
    print_table(results, output)
    if report is not None and results:
        path = report / "results.json"
        circumstances = machine.circumstances("mitsuba_ref", given)
        write_json(Results(**circumstances, scenes=tuple(results)), path)
        output.print(f"wrote {path}", markup=False, soft_wrap=True)


def keep(validated: Validated, name: str, report: Path | None) -> SceneResult:
    """Write the pictures into the report's folder; return the result with their names."""
    if report is None:
        return replace(validated.result, name=name)
    images = {}
    for kind, pixels in validated.pictures.items():
        images[kind] = f"images/{name}/{kind}.npy"
        content = io.BytesIO()
        np.save(content, pixels.astype(np.float32))
        write_atomically(report / images[kind], content.getvalue())
    return replace(validated.result, name=name, images=images)
