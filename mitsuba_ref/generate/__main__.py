"""`python -m mitsuba_ref.generate`: scenes at random, rendered by both and compared."""

from __future__ import annotations

import argparse
import signal
import sys
import tempfile
from collections.abc import Sequence
from datetime import date
from pathlib import Path

from rich.console import Console

from mitsuba_ref.generate.defects import scenes_until_seen
from mitsuba_ref.generate.drawing import DrawnScene, scene_text
from mitsuba_ref.generate.judge import (
    AGREE,
    STRICT,
    TIME_LIMIT,
    UNCLASSED,
    UNKNOWN,
    Judge,
    Judgement,
    write_scene,
)
from mitsuba_ref.generate.record import Record, summary
from mitsuba_ref.generate.reduce import MOST, reduce_scene
from mitsuba_ref.generate.scene import Scenes
from mitsuba_ref.mutations.defects.catalogue import named
from mitsuba_ref.our_renderer.picture import render_ours
from mitsuba_ref.records import machine
from mitsuba_ref.reference.picture_process import MitsubaWorker

LONGEST = 900
"""Seconds for one scene, its compilation and the traces of its pixels included: then the
process ends, as an endless loop of a kernel cannot be left in another way."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Render scenes, or try defects; return 1 if a difference has no class."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    options = _parser().parse_args(given)
    console = Console(stderr=True)
    with (
        tempfile.TemporaryDirectory() as folder,
        MitsubaWorker(time_limit=TIME_LIMIT) as worker,
    ):
        if options.defects:
            return _try_defects(options, worker, Path(folder), console)
        judge = Judge(render_ours, worker.render, Path(folder))
        strict = Judge(render_ours, worker.render, Path(folder), STRICT)
        record = Record(options.seed, options.resume)
        scenes = Scenes(options.seed)
        numbers = range(options.first, options.first + options.count)
        for number in numbers:
            known = record.known.get(number)
            if known and not (options.again and known.verdict in UNCLASSED):
                continue
            scene = scenes.draw(number)
            record.begin(number)
            signal.alarm(LONGEST)
            found = judge.judge(scene)
            signal.alarm(0)
            record.add(number, found)
            if found.verdict != AGREE:
                name = f"{options.seed}/{number}"
                words = f"{name}: {found.verdict}: {found.quantity}: {found.sentence}"
                console.print(words, markup=False, soft_wrap=True)
            if found.verdict in UNCLASSED and options.cases is not None:
                case = options.cases / f"{options.seed}-{number}"
                _write_case(scene, found, (judge, strict), case, options.reduce)
    record.add_circumstances(machine.circumstances("mitsuba_ref.generate", given))
    judged = [record.known[number] for number in numbers]
    out = Console()
    out.print(scenes.coverage.sentence, markup=False, soft_wrap=True)
    out.print(summary(judged), markup=False, soft_wrap=True)
    return int(any(found.verdict in UNCLASSED for found in judged))


def _try_defects(
    options: argparse.Namespace, worker: MitsubaWorker, folder: Path, console: Console
) -> int:
    """Print after how many scenes each defect is seen; return 1 if one is not."""
    missed = 0
    for mutation in named(options.defects):
        seen = scenes_until_seen(
            mutation, options.seed, options.count, render_ours, worker.render, folder
        )
        missed += not seen.sentence
        console.print(f"{mutation.name}: {mutation.does}", markup=False, soft_wrap=True)
        Console().print(seen.line, markup=False, soft_wrap=True)
    return int(missed > 0)


def _write_case(
    scene: DrawnScene,
    found: Judgement,
    judges: tuple[Judge, Judge],
    folder: Path,
    reduce: bool,
) -> None:
    """Write the scene of an unknown difference, made small, with what is said of it.

    Parameters
    ----------
    judges
        One that looks at causes, and one that does not, which takes a tenth of the time.
    """
    judge, strict = judges

    def still_differs(candidate: DrawnScene) -> bool:
        signal.alarm(LONGEST)
        now = strict.judge(candidate)
        if now.verdict == UNKNOWN and now.quantity == "picture":
            now = judge.judge(candidate)
        signal.alarm(0)
        return (now.verdict, now.quantity) == (found.verdict, found.quantity)

    small = reduce_scene(scene, still_differs, MOST) if reduce else scene
    write_scene(small, folder)
    write_scene(scene, folder / "whole")
    last = judge.judge(small)
    lines = [f"{last.verdict}: {last.quantity}", last.sentence, f"pixel {last.pixel}"]
    lines.append(scene_text(small.root))
    (folder / "case.txt").write_text("\n".join(lines), encoding="utf-8")


def seed_of(text: str) -> int:
    """Return a seed; "week" is another one each week."""
    if text == "week":
        year, week, _ = date.today().isocalendar()
        return 100 * year + week
    return int(text)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m mitsuba_ref.generate",
        allow_abbrev=False,
        description="Draw scenes at random, replay each in both renderers, and say of what "
        "class each difference is. The last line counts them. Exit status: 0 all have a "
        "class, 1 not so, 2 the command line was wrong.",
    )
    add = parser.add_argument
    add("--count", type=int, default=200, metavar="N", help="scenes (default: %(default)s)")
    add("--seed", type=seed_of, default=1, metavar="S", help="a number, or week")
    add("--first", type=int, default=0, metavar="K", help="number of the first scene")
    add("--resume", type=Path, metavar="FILE", help="the record: it is added to")
    add("--again", action="store_true", help="judge its scenes without a class once more")
    add("--cases", type=Path, metavar="DIR", help="where unknown differences are written")
    add(
        "--no-reduce",
        dest="reduce",
        action="store_false",
        help="write them as they are, not made small",
    )
    add(
        "--defects",
        nargs="+",
        metavar="NAME",
        help="mutations of our renderer: say after how many scenes each is seen",
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
