"""`lightproof compare`: a verdict on a picture of any renderer, and the mistake in it."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from mitsuba_ref.command.stages import shown_stages
from mitsuba_ref.diagnosis.comparison import renderer_compare
from mitsuba_ref.records.json_files import write_atomically
from mitsuba_ref.reference.errors import MitsubaError
from renderer.command.built_in_scenes import FOLDER, demos
from renderer.command.cli import scene_file
from renderer.command.options import definition
from renderer.errors import SceneError
from renderer.process.short_command import INTERRUPTED, WRONG_USE, run_command
from renderer.rendering.render_options import parse_count, parse_number
from reports.pages.compare_page import compare_page

SAME, DIFFERENT = 0, 1


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare pictures; print the verdict; return the exit status."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    given, others = _parsed(words)
    return run_command(
        "lightproof compare",
        lambda: _run(given, others, words),
        (SceneError, MitsubaError),
    )


def _run(given: argparse.Namespace, others: list[Path], words: Sequence[str]) -> int:
    for path in filter(None, (given.json, given.output)):
        if not path.resolve().parent.is_dir():
            raise SceneError(f"{path}: there is no such folder")
    with shown_stages() as show:
        found = renderer_compare(
            given.pictures,
            others or None,
            scene=given.scene,
            parameters=dict(given.define),
            spp=given.spp,
            reference=given.reference,
            quick=given.quick,
            filter_radius=given.filter_radius,
            show=show,
        )
    for line in found.sentences():
        sys.stdout.write(line + "\n")
    if given.json:
        _write(given.json, json.dumps(found.record(), indent=1) + "\n")
    if given.output:
        _write(given.output, compare_page(found, ["lightproof", "compare", *words]))
        sys.stdout.write(f"The page: {given.output}\n")
    return DIFFERENT if found.differs else SAME


def _write(path: Path, content: str) -> None:
    try:
        write_atomically(path, content.encode())
    except OSError as error:  # the file that it names is a temporary one
        raise SceneError(f"{path}: {error.strerror}") from None


def _parsed(words: list[str]) -> tuple[argparse.Namespace, list[Path]]:
    """Return what the command line says, and the pictures of the reference."""
    parser = _parser()
    before, after = words, []
    if "--" in words:
        cut = words.index("--")
        before, after = words[:cut], [Path(word) for word in words[cut + 1 :]]
        if options := [word for word in words[cut + 1 :] if word.startswith("-")]:
            parser.error(f"{options[0]}: options stand before the pictures and --")
        if not after:
            parser.error("-- stands before pictures of the reference, and none follows")
    given = parser.parse_args(before)
    if given.scene is None:
        for name in ("spp", "define", "quick"):
            if getattr(given, name):
                parser.error(f"--{name.replace('define', 'D')} needs --scene")
        others = [*given.others, *after]
        if not others and len(given.pictures) == 2:
            others = [given.pictures.pop()]
        if not others:
            parser.error(
                "name one picture and --scene, or two pictures, or several, -- and others"
            )
        return given, others
    if given.others or after:
        parser.error("--scene renders the reference: leave out --with and --")
    return given, []


def _scene(word: str) -> Path:
    """Return the file of a scene; a name of `lightproof demo` is one too."""
    path = Path(word)
    if not path.exists() and word in demos():
        path = FOLDER / word
    return scene_file(path)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="lightproof compare",
        allow_abbrev=False,
        usage="%(prog)s PICTURE --scene SCENE.xml [options]\n"
        "       %(prog)s PICTURE REFERENCE [options]\n"
        "       %(prog)s [options] PICTURE... -- REFERENCE...",
        description="Say whether a picture differs from a reference by more than noise, "
        "and name the mistake in it. Several pictures of a side have different seeds.",
        epilog=f"Exit status: {SAME} no difference beyond noise, {DIFFERENT} a difference, "
        f"{WRONG_USE} a file or the command line is wrong, {INTERRUPTED} interrupted. "
        "Example: lightproof compare mine.exr --scene scene.xml -o report.html",
    )
    add = parser.add_argument
    add(
        "pictures", nargs="+", type=Path, metavar="PICTURE", help=".exr .npy .hdr .pfm .png"
    )
    add(
        "--scene",
        type=_scene,
        metavar="SCENE.xml",
        help="render the reference of this scene, or of one of `lightproof demo`",
    )
    add(
        "--with",
        dest="others",
        nargs="+",
        type=Path,
        default=[],
        metavar="REFERENCE",
        help="pictures of the reference, as after --",
    )
    add(
        "--reference",
        choices=("mitsuba", "ours"),
        default="mitsuba",
        help="the program that renders the reference (default: mitsuba)",
    )
    add("--spp", type=parse_count, help="samples of each of the four reference pictures")
    add(
        "-D",
        dest="define",
        action="append",
        default=[],
        type=definition,
        metavar="name=value",
        help="replace a <default> of the scene",
    )
    add(
        "--quick",
        action="store_true",
        help="try no mistake of the algorithm (each takes some 10 s, once for a scene)",
    )
    add(
        "--filter-radius",
        type=parse_number,
        metavar="PIXELS",
        help="of the reconstruction filter, 0.5 for a box (default: that of the scene, "
        "else 3); the smaller, the smaller are the differences that are seen",
    )
    add("-o", "--output", type=Path, metavar="PAGE.html", help="write a page to look at")
    add("--json", type=Path, metavar="FILE", help="write the verdict for programs")
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
