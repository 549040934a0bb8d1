"""The command `lightproof-validate`, also `python -m mitsuba_ref`."""

from __future__ import annotations

import argparse
import io
import math
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console

from mitsuba_ref.command.scene_table import print_table
from mitsuba_ref.command.stages import shown_stages
from mitsuba_ref.command.trace_command import add_trace_options, asks_for_trace, run_trace
from mitsuba_ref.command.validation import Validated, validate_scene
from mitsuba_ref.ladder.climb import FEWEST_SEEDS
from mitsuba_ref.our_renderer.compile_ahead import compile_kernels, kernel_requests
from mitsuba_ref.our_renderer.picture import RenderOurs, render_ours
from mitsuba_ref.records import machine
from mitsuba_ref.records.json_files import write_atomically, write_json
from mitsuba_ref.records.options import Options, scene_name
from mitsuba_ref.records.request import MIN_THREADS, TIME_LIMIT
from mitsuba_ref.records.results import Results, SceneResult
from mitsuba_ref.records.verdicts import exit_status, statuses_in_words
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.picture_process import MitsubaWorker

EPILOG = f"""exit status, one for each verdict:
{statuses_in_words()}
Of several scenes the most severe decides: the smallest status other than 0.
"""
WRONG_USE, INTERRUPTED = 2, 130


def main(arguments: Sequence[str] | None = None, ours: RenderOurs = render_ours) -> int:
    """Render scenes in both renderers, compare, print a table; return the exit status.

    Parameters
    ----------
    arguments
        Without the program's name; None: those of the process.
    ours
        Our renderer; a parameter so that tests can break it.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        options = _parse(given)
        scenes = _scene_files(options.scenes)
    except SystemExit as stop:
        return int(stop.code or 0)
    except FileNotFoundError as error:
        Console(stderr=True).print(f"lightproof-validate: {error}", markup=False)
        return WRONG_USE
    if asks_for_trace(options):
        return run_trace(options, list(scenes.values()), _options(options))
    results: list[SceneResult] = []
    console = Console(stderr=True)
    try:
        with MitsubaWorker(options.time_limit) as worker, shown_stages() as show:
            references = ReferenceCache(worker.render)
            if len(scenes) > 1 and ours is render_ours:
                _warm_up(scenes.values(), _options(options), show)
            for index, (name, path) in enumerate(scenes.items(), start=1):
                place = f"{name} ({index} of {len(scenes)}): "

                def progress(stage: str, place: str = place) -> None:
                    show(place + stage)

                validated = validate_scene(
                    path, _options(options), ours, references, progress
                )
                results.append(_keep(validated, name, options.report))
        _finish(results, given, options.report)
    except KeyboardInterrupt:
        console.print("interrupted; the scenes so far:")
        _finish(results, given, options.report)
        return INTERRUPTED
    except OSError as error:  # what a scene meets is in its verdict
        console.print(f"lightproof-validate: {error}", markup=False, soft_wrap=True)
        return WRONG_USE
    return exit_status(scene.verdict for scene in results)


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


def _finish(results: list[SceneResult], given: list[str], report: Path | None) -> None:
    # In a pipe rich would assume 80 columns and cut the numbers.
    output = Console() if sys.stdout.isatty() else Console(width=120)
    print_table(results, output)
    if report is not None and results:
        path = report / "results.json"
        circumstances = machine.circumstances("mitsuba_ref", given)
        write_json(Results(**circumstances, scenes=tuple(results)), path)
        output.print(f"wrote {path}", markup=False, soft_wrap=True)


def _keep(validated: Validated, name: str, report: Path | None) -> SceneResult:
    """Write the pictures beside the report; return the result with their names."""
    if report is None:
        return replace(validated.result, name=name)
    images = {}
    for kind, pixels in validated.pictures.items():
        images[kind] = f"images/{name}/{kind}.npy"
        content = io.BytesIO()
        np.save(content, pixels.astype(np.float32))
        write_atomically(report / images[kind], content.getvalue())
    return replace(validated.result, name=name, images=images)


def _scene_files(given: Sequence[Path]) -> dict[str, Path]:
    """Return each scene by a name of its own; without any given, all of scenes/."""
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
        "far apart they are, beside the noise that Mitsuba has against itself.",
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
