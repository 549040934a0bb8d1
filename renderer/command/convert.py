"""`lightproof convert MODEL -o SCENE.xml`: glTF, OBJ, PLY and STL become a scene."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from renderer.errors import SceneError
from renderer.process.short_command import INTERRUPTED, WRONG_USE, run_command
from renderer.process.signals import output_is_lost

DONE, REFUSED = 0, 1


def main(arguments: Sequence[str] | None = None) -> int:
    """Convert a model, list what was not carried over, and return the exit status."""
    given = _parser().parse_args(arguments)
    output = given.output or given.model.with_suffix(".xml")
    return run_command(
        "lightproof convert: error",
        lambda: _convert(given.model, output, up=given.up, force=given.force),
    )


def _convert(model: Path, output: Path, *, up: str | None, force: bool) -> int:
    from renderer.conversion.model import convert_model
    from renderer.scene_file import read_file

    folder = output.with_name(f"{output.stem}_meshes")
    for there in (output, folder):
        if there.exists() and not force:
            raise SceneError(f"{there}: is there already; --force overwrites it")
    if not output.absolute().parent.is_dir():
        raise SceneError(f"{output}: there is no folder {output.parent} to write to")
    for note in convert_model(model, output, up):
        sys.stdout.write(f"differs from the model: {note}\n")
    sys.stdout.write(f"wrote {output} and {folder}\n")
    try:
        read_file(output)
    except SceneError as error:
        sys.stdout.write(f"lightproof does not read it yet: {error}\n")
        return REFUSED
    return int(output_is_lost()) or DONE


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="lightproof convert",
        allow_abbrev=False,
        description="Write a model (.glb, .gltf, .obj, .ply, .stl and what else trimesh "
        "reads) as a Mitsuba 3 scene. Meshes become PLY files and textures PNG files, in "
        "a folder next to the scene. A model without a camera gets one that frames it, and "
        "a model without lights an even sky and a sun. What is not carried over is listed. "
        "Needs pip install 'lightproof[convert]'.",
        epilog=f"Exit status: {DONE} the scene is written and lightproof reads it, "
        f"{REFUSED} it is written and lightproof refuses it, {WRONG_USE} the model or the "
        f"command line is wrong, {INTERRUPTED} interrupted. Example: "
        "lightproof convert model.glb -o scene.xml",
    )
    add = parser.add_argument
    add("model", type=Path, metavar="MODEL", help=".glb .gltf .obj .ply .stl ...")
    add(
        "-o",
        "--output",
        type=Path,
        metavar="SCENE.xml",
        help="the scene (default: MODEL.xml, in the model's folder)",
    )
    add(
        "--up",
        choices=("y", "z"),
        help="the axis upwards, for the camera of a model without one (default: z for "
        ".stl and .3mf, else y)",
    )
    add("--force", action="store_true", help="overwrite files that are there")
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
