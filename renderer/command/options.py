"""The options of the command `lightproof`, and what is wrong with them."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

import renderer
from renderer.command.built_in_scenes import list_of_demos
from renderer.command.sweep import parse_frames
from renderer.errors import did_you_mean
from renderer.process.cache_folder import cache_root
from renderer.process.names import TEV
from renderer.rendering.render_options import DEFAULTS, OPTIONS, RenderOptions

EPILOG = """examples:
  lightproof scenes/cornell-box/scene.xml -o cornell.exr -o cornell.png --spp 256
  lightproof scene.xml -D width=1280 -D height=720     set <default>s of the file
  lightproof scene.xml --explain                       what would be done, and why
  lightproof scene.xml --checkpoint night.ckpt         keep the state of a long render
  lightproof scene.xml --checkpoint night.ckpt --resume    and go on from it
  lightproof --compare a.exr b.exr                     are their pixels equal?
  lightproof demo cornell-box                          a scene that is installed

Ctrl-C writes the picture so far, and the checkpoint; a second one quits without.

Compiled kernels (some MB a scene) are kept in {caches}.
LIGHTPROOF_CACHE or XDG_CACHE_HOME name another place, --clear-cache removes them,
--compile makes all of them at once.

Exit status: 0 the picture is written, 1 the scene or a file was refused (or pictures
that were compared differ), 2 the command line was wrong, 130 interrupted."""


# the sentence of argparse, in which newer versions of Python quote no name
_CHOICE = re.compile(r"invalid choice: '(.*)' \(choose from (.*)\)")


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """Say what is wrong in one line, without the usage before it."""
        if chosen := _CHOICE.search(message):
            message += did_you_mean(chosen[1], re.findall(r"[\w-]+", chosen[2]))
        self.exit(2, f"{self.prog}: error: {message}; --help lists the options\n")


def read_options(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Return what the words of a command line mean; None: those of the process.

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
        parser.exit(
            2,
            f"{parser.prog}: error: the following arguments are required: SCENE.xml; "
            "--help lists the options\n\nscenes that `lightproof demo NAME` renders:\n"
            f"{list_of_demos()}\n",
        )
    if options.frames is not None:
        if options.checkpoint is not None or options.checkpoint_every is not None:
            parser.error("--checkpoint is of one picture; frames need --resume alone")
        if options.explain:
            parser.error("--explain is of one picture; leave out --frames")
    elif options.checkpoint is None:
        if options.resume or options.checkpoint_every is not None:
            given = "--resume" if options.resume else "--every"
            parser.error(f"{given} needs --checkpoint FILE")
    return options


def render_options(options: argparse.Namespace, **others: Any) -> RenderOptions:
    """Return the options of `render` among those of the command, and others.

    Raises
    ------
    SceneError
        For a number that is out of range.
    """
    values = {name: getattr(options, name, None) for name in OPTIONS} | others
    return RenderOptions(**{n: value for n, value in values.items() if value is not None})


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
    for name, option in OPTIONS.items():
        if option.flag:
            how: dict[str, Any] = {"action": "store_true"}
            if DEFAULTS[name] is not False:
                how = {"type": _told(option.parse), "metavar": option.metavar}
                how["choices"] = option.choices or None
            add(option.flag, dest=name, help=option.help.replace("%", "%%"), **how)
    add(
        "--frames",
        type=_told(parse_frames),
        metavar="FIRST:END",
        help="render a sweep: -D angle={frame*1.5} -o turn_####.exr; without END, as in "
        "Python; FIRST:END:STEP too",
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
        "--allow-outside",
        action="append",
        default=[],
        type=_told(_folder),
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
    add(
        "--view",
        action="store_true",
        help="show the picture in the browser while it is rendered: a page of this machine "
        "alone, with zoom, exposure, pixel values and AOVs, that keeps the last picture",
    )
    add(
        "--tev",
        nargs="?",
        const=TEV,
        type=_told(_host_and_port),
        metavar="HOST:PORT",
        help=f"send tiles to a tev that is running (default: {TEV})",
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


def _told(parse: Callable[[str], Any]) -> Callable[[str], Any]:
    """Return a reader of words whose errors argparse shows as they are."""

    def read(text: str) -> Any:
        try:
            return parse(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return read


def _host_and_port(text: str) -> tuple[str, int]:
    host, colon, port = text.rpartition(":")
    if not (colon and host and port.isdecimal() and 0 < int(port) < 65536):
        raise ValueError(f"{text!r} is not HOST:PORT; without one --tev stands at the end")
    return host, int(port)


def _folder(text: str) -> Path:
    if not Path(text).is_dir():
        raise ValueError(f"{text} is not a folder")
    return Path(text)


def definition(text: str) -> tuple[str, str]:
    """Read name=value of `-D`."""
    name, equals, value = text.partition("=")
    if not (name.strip() and equals):
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form name=value")
    return name.strip(), value
