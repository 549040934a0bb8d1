"""The options of the command `lightproof`, and what is wrong with them."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

import renderer
from renderer.errors import SceneError
from renderer.process.cache_folder import cache_root
from renderer.process.memory import parse_size
from renderer.process.names import (
    ACCELERATORS,
    INTEGRATORS,
    LIGHT_CHOICES,
    RAY_OFFSETS,
    REPLAY,
    SAMPLERS,
)

EPILOG = """examples:
  lightproof scenes/cornell-box/scene.xml -o cornell.exr -o cornell.png --spp 256
  lightproof scene.xml -D width=1280 -D height=720     set <default>s of the file
  lightproof scene.xml --explain                       what would be done, and why
  lightproof scene.xml --checkpoint night.ckpt         keep the state of a long render
  lightproof scene.xml --checkpoint night.ckpt --resume    and go on from it
  lightproof --compare a.exr b.exr                     are their pixels equal?

Ctrl-C writes the picture so far, and the checkpoint; a second one quits without.

Compiled kernels (some MB a scene) are kept in {caches}.
LIGHTPROOF_CACHE or XDG_CACHE_HOME name another place, --clear-cache removes them,
--compile makes all of them at once.

Exit status: 0 the picture is written, 1 the scene or a file was refused (or pictures
that were compared differ), 2 the command line was wrong, 130 interrupted."""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """Say what is wrong in one line, without the usage before it."""
        self.exit(2, f"{self.prog}: error: {message}; --help lists the options\n")


def read_options(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Return what the words of a command line ask for; None: those of the process.

    Raises
    ------
    SystemExit
        With one line on stderr and status 2, or after `--help` and `--version`.
    """
    parser = make_parser()
    options = parser.parse_args(arguments)
    if options.compare is not None:
        alone = {"compare": options.compare, "quiet": options.quiet}
        if vars(options) != vars(parser.parse_args([])) | alone:
            parser.error("--compare takes two pictures, and no scene or other option")
    elif options.clear_cache or options.compile:
        word = "clear_cache" if options.clear_cache else "compile"
        alone = {word: True, "quiet": options.quiet}
        if vars(options) != vars(parser.parse_args([])) | alone:
            word = word.replace("_", "-")
            parser.error(f"--{word} takes no scene and no other option")
    elif options.scene is None:
        parser.error("the following arguments are required: SCENE.xml")
    if options.frames is not None:
        if options.checkpoint is not None or options.every is not None:
            parser.error("--checkpoint is of one picture; frames need --resume alone")
        if options.explain:
            parser.error("--explain is of one picture; leave out --frames")
    elif options.checkpoint is None and (options.resume or options.every is not None):
        given = "--resume" if options.resume else "--every"
        parser.error(f"{given} needs --checkpoint FILE")
    return options


def make_parser(only: Mapping[str, str] | None = None) -> argparse.ArgumentParser:
    """Return the parser, with the default of every option.

    Parameters
    ----------
    only
        Of a command that has some of these options: their first names, each with a help of
        its own or "" for the usual one. None: `lightproof`, which has all.
    """
    parser = _Parser(
        prog="lightproof",
        usage="%(prog)s SCENE.xml [-o OUT.exr] [options]",
        description="Render a Mitsuba 3 scene file.",
        epilog=EPILOG.replace("{caches}", str(cache_root())),
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )

    def add(*names: str, **how: Any) -> None:
        if only is None or names[0] in only:
            own = only and only[names[0]]
            parser.add_argument(*names, **(how | {"help": own} if own else how))

    add(
        "scene",
        # `lightproof --compare` has none
        nargs="?" if only is None else None,
        type=Path,
        metavar="SCENE.xml",
        help="or the folder of a scene.xml",
    )
    add(
        "-o",
        "--output",
        action="append",
        default=[],
        type=Path,
        metavar="OUT.exr",
        help="the picture, .exr, .png or .npy by its ending; may be given several times "
        "(default: named after the scene, .exr, in the working directory)",
    )
    add(
        "--spp", type=_positive, metavar="N", help="samples per pixel instead of the file's"
    )
    add(
        "--target-error",
        type=_error,
        metavar="2%",
        help="render until the picture's estimated relative error is no more; --spp is "
        "then the most samples that it may take",
    )
    add(
        "--time",
        type=_seconds,
        metavar="SECONDS",
        help="render for about so long, and say the error that was reached",
    )
    add(
        "--checkpoint",
        type=Path,
        metavar="FILE",
        help="keep the state of the render there, now and then, and at its end",
    )
    add(
        "--every",
        type=_seconds,
        metavar="SECONDS",
        help="between two writings of the checkpoint (default: 60)",
    )
    add(
        "--resume",
        action="store_true",
        help="go on from the checkpoint, to the same picture as without a break; also to "
        "more --spp than it was made with, if the sampler is independent; with --frames: "
        "render those that are not there yet",
    )
    add(
        "--frames",
        type=_frames,
        metavar="FIRST:END",
        help="render a sweep: -D angle={frame*1.5} -o turn_####.exr; without END, as in "
        "Python; FIRST:END:STEP too",
    )
    add(
        "--seed",
        type=_seed,
        default=0,
        metavar="N",
        help="the same seed gives the same picture, bit for bit (default: 0)",
    )
    add("--threads", type=_positive, metavar="N", help="default: one for each processor")
    add(
        "--cluster",
        type=_where,
        metavar="WHERE",
        help="render on a Dask cluster, the same picture: local:4 starts 4 processes here, "
        "tcp://host:8786 is one that runs (docs/cluster.md)",
    )
    add(
        "--integrator",
        choices=INTEGRATORS,
        metavar="NAME",
        help=f"{', '.join(INTEGRATORS)}; auto, the default, is the least method that gives "
        "what the file asks for",
    )
    add(
        "--accel",
        choices=ACCELERATORS,
        metavar="NAME",
        help=f"{', '.join(ACCELERATORS)}; the picture is the same; auto, the default, is "
        "what a cost model expects to be the fastest",
    )
    add(
        "--sampler",
        choices=(*SAMPLERS, REPLAY),
        metavar="NAME",
        help=f"{', '.join(SAMPLERS)} (default: the file's), or {REPLAY}: the file's, with "
        "the random numbers that Mitsuba scalar draws",
    )
    add(
        "--light-choice",
        choices=LIGHT_CHOICES,
        metavar="NAME",
        help="where one of several lights is asked: importance (default), by what it can "
        "give at the point, or uniform, each as often as any other, as in Mitsuba",
    )
    add(
        "--ray-offset",
        choices=RAY_OFFSETS,
        metavar="NAME",
        help="how far off their surface rays start: tight (default) or mitsuba",
    )
    add(
        "--plugins",
        type=Path,
        metavar="FILE.py",
        help="a Python file that registers BSDFs of yours (docs/adding-a-bsdf.md)",
    )
    add(
        "-D",
        dest="define",
        action="append",
        default=[],
        type=definition,
        metavar="name=value",
        help="replace a <default> of the file",
    )
    add(
        "--simplify",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="render less than the file says, such as depth=3 or textures=mean; may be "
        "given several times (docs/simplifications.md)",
    )
    add(
        "--memory",
        type=_memory,
        metavar="SIZE",
        help="refuse what would take this process beyond a size such as 4GiB (default: "
        "what the machine has free); does not cover the workers of --cluster, nor the "
        "frames that begin ahead there",
    )
    add(
        "--allow-outside",
        action="append",
        default=[],
        type=_folder,
        metavar="DIR",
        help="let the scene name files below this folder too; without it, only below its "
        "own; may be given several times (docs/security.md)",
    )
    add(
        "--explain",
        action="store_true",
        help="print what is modelled, what is left out and why; render only with -o",
    )
    add(
        "--compare",
        nargs=2,
        type=Path,
        metavar=("A.exr", "B.exr"),
        help="render nothing: say whether two pictures (.exr, .npy or .png) have the same "
        "pixels and AOVs, bit for bit, or how they differ (status 1); a checksum of EXR "
        "files differs with the command in their headers",
    )
    add("--quiet", action="store_true", help="print warnings and errors only")
    add(
        "--compile",
        action="store_true",
        help="render nothing: compile the kernels of all plugins and methods once; without "
        "it each scene compiles what it needs",
    )
    add("--clear-cache", action="store_true", help="remove what is kept between runs")
    add("--version", action="version", version=f"%(prog)s {renderer.__version__}")
    return parser


def _whole_number(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no whole number") from None


def _positive(text: str) -> int:
    value = _whole_number(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{value} is less than 1")
    return value


def _error(text: str) -> float:
    number = _number(text.removesuffix("%"))
    if text.endswith("%"):
        return number / 100
    if number >= 1:
        raise argparse.ArgumentTypeError(f"{text} is 100 % or more; is {text}% meant?")
    return number


def _seconds(text: str) -> float:
    return _number(text.removesuffix("s"))


def _memory(text: str) -> int:
    try:
        return parse_size(text)
    except SceneError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _folder(text: str) -> Path:
    if not Path(text).is_dir():
        raise argparse.ArgumentTypeError(f"{text} is not a folder")
    return Path(text)


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no number") from None
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not more than 0, and finite")
    return value


def _where(text: str) -> str:
    from renderer.rendering.cluster.connect import check_where

    try:
        return check_where(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _frames(text: str) -> range:
    from renderer.command.sweep import parse_frames

    try:
        return parse_frames(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _seed(text: str) -> int:
    value = _whole_number(text)
    if not 0 <= value < 2**32:
        raise argparse.ArgumentTypeError(f"{value} is not in 0 to {2**32 - 1}")
    return value


def definition(text: str) -> tuple[str, str]:
    """Read name=value of `-D`."""
    name, equals, value = text.partition("=")
    if not (name.strip() and equals):
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form name=value")
    return name.strip(), value
