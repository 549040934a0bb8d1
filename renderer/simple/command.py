"""The command `python -m renderer.simple`, with a subset of the options of `lightproof`."""

from __future__ import annotations

import argparse
import importlib
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from renderer.command import cli
from renderer.command.interrupts import Interrupts
from renderer.command.options import make_parser
from renderer.command.outputs import check_outputs
from renderer.process.names import VERSION
from renderer.process.signals import leave_deleted_folder
from renderer.simple.path_tracer import estimates
from renderer.simple.scene import INTEGRATORS, Scene

if TYPE_CHECKING:  # needs Numba, which `--help` must not load
    from renderer.rendering.picture.image import Image
    from renderer.scene_file import SceneDescription

SPP = 4
OUTPUT = Path("simple.png")
OPTIONS = {
    "scene": "",
    "-o": f"the picture, .exr, .png or .npy by its ending; may be given several times "
    f"(default: {OUTPUT})",
    "--spp": f"samples per pixel (default: {SPP})",
    "--integrator": f"{', '.join(INTEGRATORS)} (default: the file's)",
    "-D": "",
    "--simplify": "",
    "--allow-outside": "",
    "--quiet": "",
    "--version": "",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Render a scene file with the simple path tracer; return the exit status."""
    return cli.main(arguments, _read_options, _run)


def _read_options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = make_parser(OPTIONS)
    parser.prog = "python -m renderer.simple"
    parser.description = (
        "Render a scene file with the simple path tracer: minutes, not seconds."
    )
    parser.epilog = "Ctrl-C writes the picture so far; a second one quits without."
    parser.set_defaults(spp=SPP, checkpoint=None, memory=None)
    return parser.parse_args(arguments)


def _run(options: argparse.Namespace, interrupts: Interrupts, written: list[Path]) -> int:
    with interrupts.put_off():  # C code, whose import must not be interrupted
        importlib.import_module("renderer.rendering.picture.image")
    leave_deleted_folder(options, needs_output=True)
    options.output = options.output or [OUTPUT]
    check_outputs(options)
    description = cli.describe(options, cli.scene_file(options.scene))
    cli.say_warnings(description)
    image = _render(description, options, interrupts)
    return cli.deliver(image, options, interrupts, written)


def _render(
    description: SceneDescription, options: argparse.Namespace, interrupts: Interrupts
) -> Image:
    """Return the picture; after Ctrl-C, the picture of the samples so far."""
    from renderer.rendering.picture.image import Image
    from renderer.rendering.progress_display import Progress, ProgressDisplay

    name = "" if options.integrator in (None, "auto") else options.integrator
    scene, camera = Scene(description, name), description.camera
    size = (camera.film.crop_height, camera.film.crop_width)
    sums, samples = np.zeros((*size, 3)), np.zeros((*size, 1), np.int64)
    done, total = 0, samples.size * options.spp
    start = time.perf_counter()
    with ProgressDisplay(sys.stderr, quiet=options.quiet) as display:
        interrupts.held = True  # Ctrl-C ends the loop below, not this function
        display(Progress("render", 0, total, 0.0))
        for row, column, radiance in estimates(scene, camera, options.spp):
            sums[row, column] += radiance
            samples[row, column] += 1
            done += 1
            display(Progress("render", done, total, time.perf_counter() - start))
            if interrupts.count:
                break
    metadata = {
        "lightproof": VERSION,
        "integrator": f"{scene.integrator}, by renderer.simple",
    }
    if done < total:
        metadata["interrupted"] = f"after {done} of {total} samples"
    return Image(
        (sums / np.maximum(samples, 1)).astype(np.float32),
        spp=options.spp if done == total else done / samples.size,
        requested_spp=options.spp,
        samples=done,
        seconds=time.perf_counter() - start,
        threads=1,
        integrator=scene.integrator,
        metadata=metadata,
        complete=done == total,
    )
