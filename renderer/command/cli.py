"""The command `lightproof`, also `python -m renderer`: a scene file into a picture."""

from __future__ import annotations

import argparse
import dataclasses
import os
import shlex
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import renderer
from renderer.command.interrupts import Interrupts
from renderer.errors import SceneError
from renderer.names import (
    ACCELERATORS,
    INTEGRATORS,
    LIGHT_CHOICES,
    RAY_OFFSETS,
    REPLAY,
    SAMPLERS,
)

if TYPE_CHECKING:  # what imports Numba, half a second, is imported where it is used
    from renderer.picture.image import Image
    from renderer.rendering.rendering import Progress
    from renderer.scene.scene import Scene

EPILOG = """examples:
  lightproof scenes/cornell-box/scene.xml -o cornell.exr -o cornell.png --spp 256
  lightproof scene.xml -D width=1280 -D height=720     set <default>s of the file
  lightproof scene.xml --explain                       what would be done, and why

Ctrl-C writes the picture so far; a second one quits without.
Exit status: 0 the picture is written, 1 the scene or a file was refused,
2 the command line was wrong, 130 interrupted."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Render a scene file and write the picture; return the exit status.

    Parameters
    ----------
    arguments
        Without the program's name; None: those of the process.
    """
    try:
        options = _parser().parse_args(arguments)
    except SystemExit as stop:
        return int(stop.code or 0)
    written: list[Path] = []
    try:
        with Interrupts() as interrupts:
            return _run(options, interrupts, written)
    except SceneError as error:
        _complain(f"error: {error}")
    except MemoryError:
        _complain("error: there is not enough memory for this picture or scene")
    except BrokenPipeError:  # the reader of our output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except KeyboardInterrupt:
        _complain(f"interrupted; wrote {_listed(written) or 'nothing'}")
        return 130
    return 1


def _run(options: argparse.Namespace, interrupts: Interrupts, written: list[Path]) -> int:
    from renderer.picture.image_files import check_output_path
    from renderer.scene.scene import build_scene
    from renderer.scene.simplifications.simplify import simplified
    from renderer.scene_file import read_file
    from renderer.scene_file.plugin_file import import_plugin_file

    if options.plugins is not None:
        import_plugin_file(str(options.plugins))
    path = options.scene / "scene.xml" if options.scene.is_dir() else options.scene
    outputs = options.output
    if not outputs and not options.explain:
        outputs = [default_output(path)]
    for output in outputs:
        check_output_path(output)
    description = read_file(path, **dict(options.define))
    for word in options.simplify:
        description = simplified(description, word)
    scene = build_scene(description)
    for warning in scene.description.warnings:
        _complain(f"warning: {warning}")
    if options.explain:
        from renderer.rendering.planning.plan_text import plan_text

        sampler, spp = options.sampler, options.spp
        if options.target_error is not None or options.time is not None:
            from renderer.rendering.goal import for_a_goal

            sampler, spp = for_a_goal(scene, sampler, spp)
        text = plan_text(
            scene,
            integrator=options.integrator,
            sampler=sampler,
            spp=spp,
            accel=options.accel,
            threads=options.threads,
            light_choice=options.light_choice,
        )
        sys.stdout.write(text)
        sys.stdout.flush()
    if not outputs:
        return 0
    image = _render(scene, options, interrupts)
    if interrupts.count > 1:
        raise KeyboardInterrupt
    _write(image, outputs, written)
    _report(image, written, quiet=options.quiet)
    if interrupts.count:
        return 130
    return 0 if len(written) == len(outputs) else 1


def default_output(scene: Path) -> Path:
    """Return the name of the picture if none is given, in the working directory.

    It is that of the scene's folder for a `scene.xml`, else that of the file.
    """
    path = scene.resolve()
    name = path.parent.name if path.stem == "scene" else path.stem
    return Path(f"{name or path.stem}.exr")


def _render(scene: Scene, options: argparse.Namespace, interrupts: Interrupts) -> Image:
    from renderer.command.progress_display import ProgressDisplay

    with ProgressDisplay(sys.stderr, quiet=options.quiet) as display:

        def progress(now: Progress) -> None:
            # compiling, there is nothing to save, and Ctrl-C need not wait for the end
            interrupts.held = now.stage == "render"
            if interrupts.held and interrupts.count:
                raise KeyboardInterrupt
            display(now)

        image = renderer.render(
            scene,
            spp=options.spp,
            seed=options.seed,
            threads=options.threads,
            integrator=options.integrator,
            accel=options.accel,
            sampler=options.sampler,
            ray_offset=options.ray_offset,
            light_choice=options.light_choice,
            progress=progress,
            target_error=options.target_error,
            time_limit=options.time,
        )
    if image.error is not None:  # the command that gives this picture again
        options.spp, options.sampler = image.spp, image.metadata["sampler"]
    metadata = {**image.metadata, "command": _command(options)}
    return dataclasses.replace(image, metadata=metadata)


def _command(options: argparse.Namespace) -> str:
    """Return the command without what does not change the picture, such as `--threads`."""
    words = ["lightproof", str(options.scene)]
    for name in (
        "spp",
        "seed",
        "integrator",
        "accel",
        "sampler",
        "light_choice",
        "ray_offset",
        "plugins",
    ):
        value = getattr(options, name)
        if value != _parser().get_default(name):
            words += [f"--{name.replace('_', '-')}", str(value)]
    for name, value in options.define:
        words += ["-D", f"{name}={value}"]
    for word in options.simplify:
        words += ["--simplify", word]
    return shlex.join(words)


def _write(image: Image, outputs: list[Path], written: list[Path]) -> None:
    """Write what can be written: one full disk is no reason to lose the picture."""
    for output in outputs:
        try:
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                image.save(output)
            written.append(output)
        except SceneError as error:
            _complain(f"error: {error}")
        for warning in caught:
            _complain(f"warning: {output}: {warning.message}")


def _report(image: Image, written: list[Path], *, quiet: bool) -> None:
    files = _listed(written) or "nothing"
    if not image.complete:
        if image.error is not None:
            _complain(f"estimated error, some samples ago: {image.error:.2%}")
        _complain(f"interrupted {image.metadata['interrupted']}; wrote {files}")
    elif not quiet:
        samples = image.width * image.height * image.spp
        rate = samples / max(image.seconds, 1e-9) / 1e6
        sys.stdout.write(
            f"{image.width} x {image.height} pixels, {image.spp} spp, "
            f"{image.seconds:.2f} s, {rate:.1f} Msamples/s; wrote {files}\n"
        )
        if image.error is not None:
            doubt = "; unsure, the true one may well be another"
            doubt = doubt if image.error_unsure else ""
            sys.stdout.write(f"estimated error: {image.error:.2%}{doubt}\n")
        if "brightest" in image.metadata:
            sys.stdout.write(f"brightest colour: {image.metadata['brightest']}\n")
        sys.stdout.flush()


def _listed(paths: list[Path]) -> str:
    return ", ".join(map(str, paths))


def _complain(line: str) -> None:
    sys.stderr.write(f"{line}\n")
    sys.stderr.flush()


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """Say what is wrong in one line, without the usage before it."""
        self.exit(2, f"{self.prog}: error: {message}; --help lists the options\n")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="lightproof",
        usage="%(prog)s SCENE.xml [-o OUT.exr] [options]",
        description="Render a Mitsuba 3 scene file.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    add = parser.add_argument
    add("scene", type=Path, metavar="SCENE.xml", help="or the folder of a scene.xml")
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
        "--seed",
        type=_seed,
        default=0,
        metavar="N",
        help="the same seed gives the same picture, bit for bit (default: 0)",
    )
    add("--threads", type=_positive, metavar="N", help="default: one for each processor")
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
        type=_definition,
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
        "--explain",
        action="store_true",
        help="print what is modelled, what is left out and why; render only with -o",
    )
    add("--quiet", action="store_true", help="print warnings and errors only")
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


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no number") from None
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not more than 0, and finite")
    return value


def _seed(text: str) -> int:
    value = _whole_number(text)
    if not 0 <= value < 2**32:
        raise argparse.ArgumentTypeError(f"{value} is not in 0 to {2**32 - 1}")
    return value


def _definition(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not (name.strip() and equals):
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form name=value")
    return name.strip(), value
