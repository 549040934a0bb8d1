"""Scenes that the harness compares with Mitsuba: what the studies of scenes share.

The harness's record of a scene, a results.json with its pictures, is kept in
`data/STUDY/SCENE` of the folder of the pages; a row names it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from mitsuba_ref.command.scene_table import print_table
from mitsuba_ref.command.validate_scenes import keep, validator
from mitsuba_ref.records.failures import failures
from mitsuba_ref.records.json_files import write_atomically, write_json
from mitsuba_ref.records.machine import circumstances
from mitsuba_ref.records.options import Options, scene_name
from mitsuba_ref.records.results import Results, SceneResult
from mitsuba_ref.records.verdicts import VERDICTS
from reports.bench.rows import Row
from reports.bench.study import Bench
from reports.errors import ReportError
from reports.look import pictures
from reports.look.formatting import metric_name, slug
from reports.look.results import read_results
from reports.trials.scene_files import scene_file

Compare = Callable[[str, Callable[[str], None]], SceneResult]


def record_file(bench: Bench, case: str) -> Path:
    """Return where the harness's record of a scene is, from the folder of the pages.

    A run that is quick or has options has a place of its own: the rows of a full run, which
    count before it, keep their record and their pictures.
    """
    return Path("data") / bench.study / slug(case + _tag(bench)) / "results.json"


def _tag(bench: Bench) -> str:
    given = {k: "taken" if k == "from" else v for k, v in bench.options.items()}
    words = ["quick"] * bench.quick + [f"{k}={v}" for k, v in sorted(given.items())]
    return "".join(f"-{word}" for word in words)


@contextmanager
def compared(cases: Sequence[str], bench: Bench, options: Options) -> Iterator[Compare]:
    """Yield what compares a scene and keeps its record; print a table of all at the end."""
    files = [scene_file(case) for case in cases]
    results: list[SceneResult] = []

    def compare(case: str, show: Callable[[str], None]) -> SceneResult:
        path = scene_file(case)
        record = bench.folder / record_file(bench, case)
        result = keep(validate(path, show), scene_name(path), record.parent)
        made = circumstances("reports", [bench.study, "--case", case])
        write_json(Results(**made, scenes=(result,)), record)
        results.append(result)
        return read_results(record).scenes[0]

    try:
        with validator(files, options, bench.show) as validate:
            yield compare
    finally:
        if results:
            print_table(results, Console() if sys.stdout.isatty() else Console(width=120))


@contextmanager
def read_instead(cases: Sequence[str], bench: Bench, source: Path) -> Iterator[Compare]:
    """Yield what takes a scene from a results.json that the harness wrote elsewhere.

    Raises
    ------
    ReportError
        If it cannot be read, or lacks a scene.
    """
    results = read_results(source)
    scenes = {scene.name: scene for scene in results.scenes}
    if missing := [case for case in cases if case not in scenes]:
        names = " ".join(f"--case {name}" for name in scenes)
        raise ReportError(f"{source}: no scene {missing[0]!r}; there are {names}")

    def take(case: str, show: Callable[[str], None]) -> SceneResult:
        record = bench.folder / record_file(bench, case)
        for name in scenes[case].images.values():
            try:
                content = (source.parent / name).read_bytes()
            except OSError as error:
                raise ReportError(f"{source.parent / name}: {error.strerror}") from None
            write_atomically(record.parent / name, content)
        write_json(_only(results, scenes[case]), record)
        return scenes[case]

    yield take


def _only(results: Results, scene: SceneResult) -> Results:
    fields = ("created", "command", "machine", "versions", "commit")
    return Results(**{name: getattr(results, name) for name in fields}, scenes=(scene,))


def option(bench: Bench, name: str, possible: Sequence[str]) -> str:
    """Return an option of the study; the first that is possible is the default.

    Raises
    ------
    ReportError
        If it is something else.
    """
    value = bench.options.get(name, possible[0])
    if value not in possible:
        raise ReportError(f"--set {name}={value}: possible are {', '.join(possible)}")
    return value


def verdict_rows(case: str, scene: SceneResult, bench: Bench) -> Iterator[Row]:
    """Yield the record's place, title and verdict, and a fault if it is no pass."""
    record = record_file(bench, case).as_posix()
    yield Row(case=case, quantity="record", value=record)
    yield Row(case=case, quantity="title", value=scene.title)
    yield Row(case=case, quantity="verdict", value=scene.verdict)
    if scene.verdict != "pass":
        found = "; ".join(metric_name(one.quantity) for one in failures(scene))
        meaning = VERDICTS[scene.verdict].meaning
        sentence = f"beyond its limit: {found}" if found else (*scene.reasons, meaning)[0]
        yield Row(case=case, quantity="fault", value=sentence)


class SceneImages:
    """The pictures of a scene's record, shown at one exposure and one scale.

    Parameters
    ----------
    bench
        Of the study.
    case
        Of the rows.
    scene
        Its result, which names the pictures.
    """

    def __init__(self, bench: Bench, case: str, scene: SceneResult) -> None:
        self._bench, self._case, self._scene = bench, case, scene
        self._folder = (bench.folder / record_file(bench, case)).parent
        self.stops = 0

    def load(self, kind: str) -> pictures.Picture | None:
        """Return a picture of the record; None if it has none."""
        name = self._scene.images.get(kind)
        return None if name is None else pictures.load_picture(self._folder / name)

    def array(self, kind: str) -> NDArray[np.float64] | None:
        """Return another array of the record; None if it has none."""
        name = self._scene.images.get(kind)
        return None if name is None else pictures.load_array(self._folder / name)

    def expose(self, reference: pictures.Picture) -> Row:
        """Choose the exposure of all pictures; return it as a row."""
        self.stops = pictures.exposure_stops(reference)
        return self.row("exposure", float(self.stops), "stops")

    def show(self, name: str, picture: pictures.Picture, form: str = "png") -> Row:
        """Write a picture for the page."""
        return self.write(name, pictures.tone_mapped(picture, self.stops), form)

    def write(self, name: str, shown: NDArray[np.uint8], form: str = "png") -> Row:
        """Write a picture that is ready."""
        row = self._bench.picture(self._case + _tag(self._bench), name, shown, form)
        return replace(row, case=self._case)

    def differences(self, **named: pictures.Difference) -> Iterator[Row]:
        """Write signed differences at one scale, which is a row too."""
        scale = pictures.symmetric_scale(*named.values())
        for name, difference in named.items():
            colours = pictures.difference_colours(difference, scale)
            yield self.write(name.replace("_", " "), colours)
            yield self.row("scale", scale, contender=name.replace("_", " "))

    def row(self, quantity: str, value: float, unit: str = "", contender: str = "") -> Row:
        """Return a row of this scene."""
        return Row(
            case=self._case,
            quantity=quantity,
            value=value,
            unit=unit,
            contender=contender,
        )
