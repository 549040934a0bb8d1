"""`lightproof demo NAME`: render one of the scenes that are installed with the program."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from renderer.command.built_in_scenes import FOLDER, demos, list_of_demos
from renderer.command.cli import main as render_scene
from renderer.command.options import read_options
from renderer.errors import did_you_mean
from renderer.process.signals import output_is_lost

WRONG_USE = 2

HELP = """usage: lightproof demo [NAME [options]]

Render a scene that is installed with lightproof. Without NAME, list them.
All options of `lightproof SCENE.xml` are possible; without -o the picture is NAME.png.

scenes:
{scenes}

example:
  lightproof demo cornell-box -o cornell.exr --spp 256

Exit status: that of `lightproof`; 2 if there is no scene of that name.
"""
LIST = "{scenes}\n\n`lightproof demo NAME` renders one.\n"


def main(arguments: Sequence[str] | None = None) -> int:
    """List the scenes, or render one; return the exit status."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if not words or words[0] in ("-h", "--help"):
        sys.stdout.write((HELP if words else LIST).format(scenes=list_of_demos()))
        return int(output_is_lost())
    name, *options = words
    if name not in demos():
        sys.stderr.write(
            f"lightproof demo: error: there is no scene {name!r}"
            f"{did_you_mean(name, demos())}; there are: {', '.join(demos())}\n"
        )
        return WRONG_USE

    def read(_: Sequence[str] | None) -> argparse.Namespace:
        found = read_options([str(FOLDER / name / "scene.xml"), *options])
        found.demo = name
        if not (found.output or found.explain or found.frames is not None):
            found.output = [Path(f"{name}.png")]
        return found

    return render_scene(read=read)
