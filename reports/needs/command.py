"""`python -m reports.needs`: the least model of a scene, and what each step to it loses."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.console import Console

import renderer
from mitsuba_ref.records.json_files import write_atomically
from mitsuba_ref.records.machine import circumstances, describe_machine
from mitsuba_ref.records.proof_file import read_proof
from renderer.command.options import definition
from renderer.errors import SceneError
from reports.argument_types import at_least
from reports.errors import ReportError
from reports.needs.content import content_of
from reports.needs.page import needs_page
from reports.needs.record import SCHEMA, NeedsRecord, SceneNeeds
from reports.needs.study import TIMED, Study, measure
from reports.needs.table import print_table
from reports.records.json_file import read_json, write_json

SCENES = Path(__file__).parents[2] / "scenes"
DEFAULT_OUT = Path("reports/out")
REFUSED, WRONG_USE, INTERRUPTED = 1, 2, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print the tables, write data/needs.json and needs.html.

    Parameters
    ----------
    arguments
        Without the program's name; None: those of the process.

    Returns
    -------
    int
        0; 1 if a scene was refused; 2 if there is nothing to resume; 130 if interrupted.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    given = _parser().parse_args(words)
    console, log = Console(), Console(stderr=True)
    found: list[tuple[SceneNeeds, Study | None]] = []
    status = 0
    file = given.out / "data" / "needs.json"
    record = NeedsRecord(**circumstances("reports.needs", words), whole=False, scenes=[])
    paths = _paths(given.scenes)
    try:
        before = _before(file, record, given, paths) if given.resume else {}
    except ReportError as error:
        log.print(f"reports.needs: {error}", markup=False, soft_wrap=True)
        return WRONG_USE
    before = {str(path): before[str(path)] for path in paths if str(path) in before}
    try:
        for path in paths:
            log.print(str(path), markup=False, soft_wrap=True)
            try:
                done = before.pop(str(path), None)
                if done and done.content == _content(path, given):
                    found.append((done, None))
                else:
                    found.append(_measured(path, given, log))
            except SceneError as error:
                log.print(f"error: {error}", markup=False, soft_wrap=True)
                status = REFUSED
                continue
            print_table(found[-1][0], console)
            # what takes this long is not lost, nor what is further down from before
            record = replace(
                record,
                scenes=[*(one for one, _ in found), *before.values()],
                machine=describe_machine(),  # busy so far, or not
            )
            write_json(file, record, SCHEMA)
    except KeyboardInterrupt:
        status = INTERRUPTED  # what is measured is worth a page
    if not found:
        return status
    record = replace(record, whole=status == 0)
    write_json(file, record, SCHEMA)
    page = given.out / "needs.html"
    write_atomically(page, needs_page(record, [study for _, study in found]).encode())
    console.print(f"The page: {page}", markup=False, soft_wrap=True)
    return status


def _before(
    file: Path, now: NeedsRecord, given: argparse.Namespace, paths: Sequence[Path]
) -> dict[str, SceneNeeds]:
    """Return the scenes that a record has of today's sources and options, by path.

    Raises
    ------
    ReportError
        If it is of others: one record is of one commit. Or if it has scenes that are not
        asked for now, which would be lost.
    """
    if not file.exists():
        return {}
    record = read_json(file, NeedsRecord, SCHEMA)
    if record.commit != now.commit or now.commit.endswith(("-dirty", "unknown")):
        raise ReportError(f"{file}: of commit {record.commit}, here is {now.commit}")
    if record.versions != now.versions:
        raise ReportError(f"{file}: measured with other versions of libraries")
    words = shlex.split(record.command)[3:]  # after python -m reports.needs
    if _options(_parser().parse_args(words)) != _options(given):
        raise ReportError(f"{file}: measured with other options: {shlex.join(words)}")
    before = {scene.scene: scene for scene in record.scenes}
    if lost := before.keys() - set(map(str, paths)):
        raise ReportError(
            f"{file}: has scenes that are not asked for: {', '.join(sorted(lost))}"
        )
    return before


def _options(given: argparse.Namespace) -> tuple[object, ...]:
    """Return what decides the numbers of a scene."""
    return given.spp, given.seeds, given.tolerance, given.timed, given.define


def _parameters(path: Path, given: argparse.Namespace) -> dict[str, Any]:
    size = read_proof(path).test if not given.define else None
    return dict(given.define) if size is None else dict(size.parameters)


def _content(path: Path, given: argparse.Namespace) -> str:
    return content_of(renderer.load_file(path, **_parameters(path, given)))


def _measured(
    path: Path, given: argparse.Namespace, log: Console
) -> tuple[SceneNeeds, Study]:
    return measure(
        path,
        parameters=_parameters(path, given),
        spp=given.spp,
        seeds=given.seeds,
        tolerance=given.tolerance,
        timed=given.timed,
        say=lambda what: log.print(f"  {what}", markup=False, soft_wrap=True),
    )


def _paths(scenes: Sequence[Path]) -> list[Path]:
    if list(map(str, scenes)) == ["all"]:
        # as short as can be: the path is part of the command to copy
        scenes = sorted(SCENES.glob("*"))
        here = Path.cwd()
        scenes = [s.relative_to(here) if s.is_relative_to(here) else s for s in scenes]
        return [s / "scene.xml" for s in scenes if (s / "scene.xml").is_file()]
    return [scene / "scene.xml" if scene.is_dir() else scene for scene in scenes]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m reports.needs",
        allow_abbrev=False,
        description="Measure what a scene loses and saves when one thing is left out, and "
        "find the least model within a tolerance.",
    )
    add = parser.add_argument
    add(
        "scenes",
        nargs="+",
        type=Path,
        metavar="SCENE.xml",
        help="or its folder; all: those of scenes/",
    )
    add(
        "--tolerance",
        type=_share,
        default=0.01,
        metavar="1%",
        help="the largest loss of the least model: root mean relative squared difference, "
        "upper end of the interval (default: 1%%)",
    )
    add("--spp", type=at_least(1), default=32, help="samples per picture (default: 32)")
    add("--seeds", type=at_least(3), default=6, help="pictures of each (default: 6)")
    add(
        "--timed",
        type=_seconds,
        default=TIMED,
        metavar="SECONDS",
        help="of full pictures beside each model, to time both (default: %(default)s)",
    )
    add(
        "-D",
        dest="define",
        action="append",
        default=[],
        type=definition,
        metavar="name=value",
        help="replace a <default> of the file (default: the test size of its proof.toml)",
    )
    add(
        "--resume",
        action="store_true",
        help="take the scenes that data/needs.json has already of this commit, these "
        "options and the same files; their pictures are not shown",
    )
    add("--out", type=Path, default=DEFAULT_OUT, help="folder (default: reports/out)")
    return parser


def _share(text: str) -> float:
    number = _seconds(text.removesuffix("%"))
    return number / 100.0 if text.endswith("%") else number


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no number") from None
    if not 0.0 <= value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is less than 0, or no number")
    return value
