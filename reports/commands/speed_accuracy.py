"""`python -m reports.speed_accuracy`: every contender on every scene, curves and a page.

Nothing is timed before the means of all contenders' pictures agree with those of one.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from rich.console import Console

from mitsuba_ref.command.stages import Show, shown_stages
from mitsuba_ref.records.json_files import write_atomically
from mitsuba_ref.records.machine import circumstances
from mitsuba_ref.records.proof_file import read_proof
from mitsuba_ref.reference.errors import MitsubaError
from renderer.errors import SceneError
from renderer.process.names import SAMPLERS
from reports.argument_types import at_least
from reports.commands.pages import DEFAULT_OUT, INTERRUPTED, PART, WRONG_USE, draw
from reports.errors import ReportError
from reports.look.formatting import number, seconds
from reports.speed.measure import scene_file
from reports.speed_accuracy.contenders import Settings
from reports.speed_accuracy.large_meshes import LARGE, written
from reports.speed_accuracy.noiseless import has_noise, measure_noiseless
from reports.speed_accuracy.noisy import measure_noisy
from reports.speed_accuracy.page import interval_text, speed_accuracy_page
from reports.speed_accuracy.record import (
    FILE,
    NoiselessScene,
    NoisyScene,
    SpeedAccuracy,
    read_speed_accuracy,
    write_speed_accuracy,
)
from reports.speed_accuracy.summary import Efficiency, efficiencies

SCENES = Path(__file__).parents[2] / "scenes"
QUICK = ("cornell-box", "textured-room", "caustic", "appel-teapot")
QUICK_SETTINGS = Settings(spp=(4, 16), seeds=3, reference=512)
SCENE_SECONDS = 20.0  # of one scene on two quiet cores, about
LARGE_SECONDS = 180.0
FAILED = 1


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, or read what was measured, and draw the page; return the exit status.

    What is measured of some scenes alone, or in short, has files of its own: it never
    replaces a whole measurement.

    Parameters
    ----------
    arguments
        Without the program's name; None: those of the process.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    given = _parser().parse_args(words)
    console = Console(stderr=True)
    status = 0
    try:
        if given.source is not None:
            if given.scene or given.quick:
                raise ReportError(
                    "--from draws what was measured: not with --scene, --quick"
                )
            record = read_speed_accuracy(given.source)
        else:
            paths, large = _asked(given)
            minutes = seconds(SCENE_SECONDS * len(paths) + LARGE_SECONDS * len(large))
            console.print(
                f"{len(paths) + len(large)} scenes, about {minutes} on two quiet cores; "
                "longer the first time, when references are rendered and kernels compiled",
                soft_wrap=True,
            )
            with written(large) as large_paths:
                record, complete = _measure(paths, large_paths, given, words)
            status = 0 if complete else INTERRUPTED
        page = _write(record, given.out)
    except KeyboardInterrupt:
        console.print("reports.speed_accuracy: interrupted, nothing was written")
        return INTERRUPTED
    except (ReportError, SceneError) as error:
        return _say(console, f"reports.speed_accuracy: {error}", WRONG_USE)
    for name, why in record.failed.items():
        status = _say(console, f"{name}: {why}", status or FAILED)
    out = Console()
    for line in (*markdown(efficiencies(record)), f"The page: {page}"):
        out.print(line, markup=False, soft_wrap=True, highlight=False)
    return status


def markdown(rows: Sequence[Efficiency]) -> list[str]:
    """Return the summary as lines of a table in Markdown, as the README shows it."""
    if not rows:
        return []
    lines = [
        "| ours | scenes | geometric mean | 95 % | worst case | ahead in |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        worst = f"{number(row.worst)} ({row.worst_scene})"
        mean, interval = number(row.mean), interval_text(row.interval)
        lines.append(
            f"| {row.name} | {row.scenes} | {mean} | {interval} | {worst} | {row.ahead} |"
        )
    return lines


def _asked(given: argparse.Namespace) -> tuple[list[Path], list[str]]:
    """Return the scene files that are asked for, and the names of large scenes.

    Raises
    ------
    ReportError
        If there is none of a name.
    """
    if given.scene or given.quick:
        names = given.scene or QUICK
        files = [scene_file(name) for name in names if name not in LARGE]
        return files, [name for name in names if name in LARGE]
    return sorted(SCENES.glob("*/scene.xml")), list(LARGE)


def _measure(
    paths: Sequence[Path],
    large: Sequence[Path],
    given: argparse.Namespace,
    words: Sequence[str],
) -> tuple[SpeedAccuracy, bool]:
    """Return what was measured, and whether to the end.

    Raises
    ------
    ReportError
        If there is nothing to show.
    KeyboardInterrupt
        If there is nothing to show, for that reason.
    """
    settings = _settings(given)
    noisy: list[NoisyScene] = []
    noiseless: list[NoiselessScene] = []
    failed: dict[str, str] = {}
    complete, began = True, time.monotonic()
    with shown_stages() as show:
        try:
            every = [*paths, *large]
            for index, path in enumerate(every):
                say = _told(show, path, index, len(every), time.monotonic() - began)
                try:
                    if path in large:
                        noisy.append(measure_noisy(path, settings, say, one_peer=True))
                    elif has_noise(path, read_proof(path).deterministic):
                        noisy.append(measure_noisy(path, settings, say))
                    else:
                        noiseless.append(measure_noiseless(path, settings, say))
                except (ReportError, SceneError, MitsubaError) as error:
                    failed[path.parent.name] = str(error)
        except KeyboardInterrupt:
            if not (noisy or noiseless):
                raise
            complete = False  # what is measured is worth a page
    if not (noisy or noiseless):
        raise ReportError("; ".join(failed.values()))
    record = SpeedAccuracy(
        **circumstances("reports.speed_accuracy", words),
        whole=complete and not (given.scene or given.quick),
        spp=list(settings.spp),
        seeds=settings.seeds,
        threads=settings.threads,
        noisy=noisy,
        noiseless=noiseless,
        failed=failed,
    )
    return record, complete


def _told(
    show: Show, path: Path, index: int, count: int, elapsed: float
) -> Callable[[str], None]:
    """Return what shows the stages of a scene, with the time that is left after it."""
    each = elapsed / index if index else SCENE_SECONDS
    left = f"about {seconds(each * (count - index))} left"
    name = f"{path.parent.name}, {index + 1} of {count}, {left}"
    return lambda stage: show(f"{name}: {stage}")


def _settings(given: argparse.Namespace) -> Settings:
    asked = {
        field.name: value
        for field in dataclasses.fields(Settings)
        if (value := getattr(given, field.name)) is not None
    }
    base = QUICK_SETTINGS if given.quick else Settings()
    settings = dataclasses.replace(base, **asked)
    return dataclasses.replace(settings, spp=sorted(set(settings.spp)))


def _write(record: SpeedAccuracy, out: Path) -> Path:
    """Write record and page; what cannot be drawn must not replace what can."""
    part = "" if record.whole else PART
    name = Path(FILE)
    page = out / f"{name.stem}{part}.html"
    content = speed_accuracy_page(record)
    write_speed_accuracy(out / "data" / f"{name.stem}{part}{name.suffix}", record)
    write_atomically(page, content.encode())
    results = out / "data" / "results.json"
    if record.whole and results.exists():
        draw(results, out)  # links to this page now
    return page


def _say(console: Console, text: str, status: int) -> int:
    console.print(text, markup=False, soft_wrap=True)
    return status


def _parser() -> argparse.ArgumentParser:
    usual = Settings()
    parser = argparse.ArgumentParser(
        prog="python -m reports.speed_accuracy",
        allow_abbrev=False,
        description="Seconds against error of all that can draw a scene: our methods, "
        "samplers and structures, and Mitsuba's variants, in turn.",
        epilog=f"Exit status: 0 all scenes were measured, {FAILED} some could not be, "
        f"{WRONG_USE} none, or the command line or a file is wrong.",
    )
    add = parser.add_argument
    add(
        "--scene",
        nargs="+",
        metavar="NAME",
        help=f"of scenes/, files, {' or '.join(LARGE)}; in a *{PART} page",
    )
    add("--quick", action="store_true", help=f"few scenes, in short; in a *{PART} page")
    add("--from", dest="source", type=Path, metavar="RECORD.json", help="draw only")
    add("--samplers", nargs="+", choices=SAMPLERS, help="ours (default: all)")
    add(
        "--spp",
        nargs="+",
        type=at_least(1),
        help=f"samples per pixel (default: {' '.join(map(str, usual.spp))})",
    )
    add(
        "--seeds",
        type=at_least(2),
        help=f"pictures of each contender (default: {usual.seeds})",
    )
    add(
        "--reference",
        type=at_least(1),
        help=f"samples of the reference, or a few more (default: {usual.reference})",
    )
    add(
        "--threads",
        type=at_least(2),
        help=f"workers of each renderer (default: {usual.threads})",
    )
    add(
        "--full",
        action="store_true",
        default=None,
        help="the files' sizes, not those of proof.toml (large scenes: 1280 x 720)",
    )
    add("--out", type=Path, default=DEFAULT_OUT, metavar="DIR", help="where the page goes")
    return parser
