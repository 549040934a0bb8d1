"""The command `lightproof-validate`, also `python -m mitsuba_ref`: its options."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from mitsuba_ref.command.trace_options import add_trace_options, asks_for_trace
from mitsuba_ref.records.request import FEWEST_SEEDS, MIN_THREADS, TIME_LIMIT
from mitsuba_ref.records.verdicts import statuses_in_words
from mitsuba_ref.reference.variant import check_version
from renderer.errors import SceneError
from renderer.process.signals import leave_deleted_folder

if TYPE_CHECKING:
    from mitsuba_ref.our_renderer.picture import RenderOurs
    from mitsuba_ref.records.options import Options

EPILOG = f"""exit status, one for each verdict:
{statuses_in_words()}
Of several scenes the most severe decides: the smallest status other than 0.
"""
WRONG_USE = 2


def main(arguments: Sequence[str] | None = None, ours: RenderOurs | None = None) -> int:
    """Render scenes in both renderers, compare, print a table; return the exit status.

    Parameters
    ----------
    arguments
        Without the program's name; None: those of the process.
    ours
        Our renderer; None: the real one. A parameter so that tests can break it.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        options = _parse(given)
        leave_deleted_folder(options)
        scenes = _scene_files(options.scenes)
        check_version()
    except SystemExit as stop:
        return int(stop.code or 0)
    except (FileNotFoundError, SceneError) as error:
        sys.stderr.write(f"lightproof-validate: {error}\n")
        return WRONG_USE
    # Imported only now, because they take seconds, and --help needs none of them.
    if asks_for_trace(options):
        from mitsuba_ref.command.trace_command import run_trace

        return run_trace(options, list(scenes.values()), _options(options))
    from mitsuba_ref.command.validate_scenes import validate_scenes

    return validate_scenes(scenes, _options(options), options.report, given, ours)


def _scene_files(given: Sequence[Path]) -> dict[str, Path]:
    """Return each scene by a unique name; without any given, all of scenes/."""
    from mitsuba_ref.records.options import scene_name

    files = [path / "scene.xml" if path.is_dir() else path for path in given]
    if not files:
        files = sorted(_scenes_folder().glob("*/scene.xml"))
        if not files:
            raise FileNotFoundError("no scene given, and no scenes/*/scene.xml here")
    named: dict[str, Path] = {}
    for path in files:
        if not path.is_file():
            raise FileNotFoundError(f"{path}: no such scene file")
        name, count = scene_name(path), 2
        while name in named:
            name, count = f"{scene_name(path)}-{count}", count + 1
        named[name] = path
    return named


def _scenes_folder() -> Path:
    here = Path("scenes")
    return here if here.is_dir() else Path(__file__).resolve().parents[2] / "scenes"


def _options(given: argparse.Namespace) -> Options:
    from mitsuba_ref.records.options import Options

    return Options(
        size=given.size,
        spp=given.spp,
        seed=given.seed,
        threads=given.threads,
        parameters=dict(given.define),
        ladder=given.ladder,
        checks=given.checks,
        causes=given.causes,
        time_limit=given.time_limit,
        seeds=given.seeds,
        plugins=given.plugins,
        allow_outside=tuple(given.allow_outside),
        convergence=given.convergence,
    )


def _parse(given: list[str]) -> argparse.Namespace:
    """Return the options; those that would be without effect are an error."""
    parser = _parser()
    options = parser.parse_args(given)
    if options.convergence and options.seeds < FEWEST_SEEDS:
        parser.error("--convergence is a rung of the ladder: give --seeds K as well")
    if options.checks == "replay" and options.seeds > 1:
        parser.error("--seeds needs pictures that --checks replay leaves out")
    return options


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="lightproof-validate",
        description="Render scenes in lightproof and in Mitsuba 3 (scalar_rgb) and say how "
        "far apart they are, compared with the noise between Mitsuba's own pictures.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("scenes", nargs="*", type=Path, metavar="SCENE.xml", help="default: all of scenes/")
    add("--report", type=Path, metavar="DIR", help="write results.json and pictures to DIR")
    add(
        "--size",
        choices=("demo", "test"),
        default="demo",
        help="which size of the scene's proof.toml (default: demo)",
    )
    add("--spp", type=_whole(1), help="samples per pixel, instead of the proof's")
    add(
        "--seed", type=_whole(0, 2**32 - 1), default=0, help="seed of our side (default: 0)"
    )
    add(
        "--threads",
        type=_whole(MIN_THREADS, why=", which Mitsuba needs"),
        help="workers of each renderer, at least 2",
    )
    add(
        "-D",
        dest="define",
        action="append",
        default=[],
        type=_definition,
        metavar="NAME=VALUE",
        help="set a parameter of the scene files",
    )
    add(
        "--checks",
        choices=("all", "replay", "statistics"),
        default="all",
        help="replay: both renderers draw the same random numbers and must agree pixel by "
        "pixel; statistics: each draws its own (default: both)",
    )
    add(
        "--seeds",
        type=_seeds,
        default=1,
        metavar="K",
        help="climb the ladder of tests with K pictures of each renderer, at least 8",
    )
    add(
        "--convergence",
        action="store_true",
        help="with --seeds: measure how fast the noise of each renderer falls with the "
        "number of samples (over 200 pictures in the test size)",
    )
    add(
        "--causes",
        type=_whole(1),
        default=0,
        metavar="N",
        help="trace N pixels that diverged in a replay and say where the paths part",
    )
    add(
        "--plugins",
        type=_file,
        metavar="FILE.py",
        help="import this file in both renderers; its register_mitsuba() registers the "
        "Mitsuba side of your plugins",
    )
    add(
        "--allow-outside",
        action="append",
        default=[],
        type=_folder,
        metavar="DIR",
        help="let scenes name files below this folder too, not only below their own",
    )
    add("--ladder", action="store_true", help="measure speed against accuracy too")
    add(
        "--time-limit",
        type=_whole(1),
        default=TIME_LIMIT,
        metavar="S",
        help="seconds for one picture or traced path by Mitsuba (default: %(default)g)",
    )
    add_trace_options(parser)
    return parser


def _whole(least: int, most: float = math.inf, why: str = "") -> Callable[[str], int]:
    """Return what reads a whole number of a range."""

    def number(text: str) -> int:
        value = int(text)
        if not least <= value <= most:
            to = f" to {most:.0f}" if most < math.inf else " or more"
            raise argparse.ArgumentTypeError(f"{value}: must be {least}{to}{why}")
        return value

    return number


def _seeds(text: str) -> int:
    return 1 if text == "1" else _whole(FEWEST_SEEDS, why=", or 1")(text)


def _file(text: str) -> Path:
    path = Path(text)
    if not (path.is_file() and path.suffix == ".py"):
        raise argparse.ArgumentTypeError(f"{text}: must be a Python file, NAME.py")
    return path


def _folder(text: str) -> Path:
    if not Path(text).is_dir():
        raise argparse.ArgumentTypeError(f"{text}: must be a folder")
    return Path(text)


def _definition(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not (name and equals):
        raise argparse.ArgumentTypeError(f"{text!r}: must be NAME=VALUE")
    return name, value
