"""The files that the command writes, and the lines that it says about them."""

from __future__ import annotations

import argparse
import dataclasses
import shlex
import sys
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from renderer.errors import SceneError
from renderer.process.whole_file import target_of
from renderer.rendering.progress_display import shown_rate
from renderer.rendering.render_options import DEFAULTS, OPTIONS, names_of

if TYPE_CHECKING:  # needs Numba
    from renderer.rendering.picture.image import Image
    from renderer.rendering.render_to_file import PictureFile


def check_outputs(options: argparse.Namespace) -> None:
    """Refuse files that cannot be written, before anything is rendered for them."""
    from renderer.rendering.picture.image_files import check_output_path

    targets = {target_of(output).absolute() for output in options.output}
    if len(targets) < len(options.output):
        raise SceneError("-o: the same file is named twice")
    for output in options.output:
        check_output_path(output)
        kept = options.checkpoint
        if kept is not None and target_of(output).absolute() == target_of(kept).absolute():
            raise SceneError(f"{output}: is named as the picture and as the checkpoint")


def check_not_read(outputs: list[Path], files: Iterable[str | Path]) -> None:
    """Refuse a picture in the place of a file that it is rendered from."""
    read = [Path(file) for file in files if Path(file).exists()]
    for output in outputs:
        for file in read:
            if output.exists() and output.samefile(file):
                raise SceneError(f"{output}: the scene reads {file}; choose another name")


def check_distinct(outputs: list[Path]) -> None:
    """Refuse two pictures in one file, which links may lead to."""
    first: dict[Path, Path] = {}
    for output in outputs:
        other = first.setdefault(target_of(output).absolute(), output)
        if other is not output:
            raise SceneError(f"{other} and {output} are one file; choose another name")


def default_output(scene: Path) -> Path:
    """Return the name of the picture if none is given, in the working directory.

    It is that of the scene's folder for a `scene.xml`, else that of the file.
    """
    path = scene.resolve()
    name = path.parent.name if path.stem == "scene" else path.stem
    return Path(f"{name or path.stem}.exr")


def rate_line(picture: Image | PictureFile, files: str) -> str:
    """Return the line about a picture that is written."""
    rate = shown_rate(picture.samples / max(picture.seconds, 1e-9))
    return (
        f"{picture.width} x {picture.height} pixels, {picture.spp} spp, "
        f"{picture.seconds:.2f} s, {rate}; wrote {files}\n"
    )


def signed(image: Image, options: argparse.Namespace) -> Image:
    """Return the picture with the command that gives it again."""
    if image.error is not None:
        sampler = image.metadata["sampler"]
        spp = max(1, int(image.spp))  # after an interrupt the whole passes that there are
        options = argparse.Namespace(**vars(options) | {"spp": spp, "sampler": sampler})
    metadata = {**image.metadata, "command": command_of(options)}
    return dataclasses.replace(image, metadata=metadata)


def command_of(options: argparse.Namespace) -> str:
    """Return the command without what does not change the picture, such as `--threads`."""
    demo = getattr(options, "demo", None)  # where it is installed is of no interest
    words = ["lightproof", *(("demo", demo) if demo else (str(options.scene),))]
    for name in names_of("picture"):
        value = getattr(options, name)
        if value not in (None, DEFAULTS[name]):
            words += [OPTIONS[name].flag, *([] if value is True else [str(value)])]
    if options.plugins is not None:
        words += ["--plugins", str(options.plugins)]
    for name, value in options.define:
        words += ["-D", f"{name}={value}"]
    for word in options.simplify:
        words += ["--simplify", word]
    for outside in options.allow_outside:
        words += ["--allow-outside", str(outside)]
    return shlex.join(words)


def write_all(image: Image, outputs: list[Path], written: list[Path]) -> None:
    """Write what can be written: one full disk is no reason to lose the picture."""
    for output in outputs:
        try:
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                image.save(output)
            written.append(output)
        except SceneError as error:
            complain(f"error: {error}")
        for warning in caught:
            complain(f"warning: {output}: {warning.message}")


def report(image: Image, written: list[Path], options: argparse.Namespace) -> None:
    """Say what was written, how fast it was rendered, and how it may go on."""
    files = listed(written) or "nothing"
    if not image.complete:
        if image.error is not None:
            complain(f"estimated error, some samples ago: {image.error:.2%}")
        complain(f"interrupted {image.metadata['interrupted']}; wrote {files}")
        if options.checkpoint is not None:
            complain(f"--checkpoint {options.checkpoint} --resume goes on from here")
    elif not options.quiet:
        sys.stdout.write(rate_line(image, files))
        if image.error is not None:
            doubt = "; unsure, the true one may well be another"
            doubt = doubt if image.error_unsure else ""
            doubt += ", before it was denoised" if "denoised" in image.metadata else ""
            sys.stdout.write(f"estimated error: {image.error:.2%}{doubt}\n")
        if "denoised" in image.metadata:
            sys.stdout.write(f"denoised {image.metadata['denoised']}\n")
        if "brightest" in image.metadata:
            sys.stdout.write(f"brightest colour: {image.metadata['brightest']}\n")
        sys.stdout.flush()


def listed(paths: list[Path]) -> str:
    """Return the names of files, separated by commas."""
    return ", ".join(map(str, paths))


def complain(line: str) -> None:
    """Write a line to standard error."""
    sys.stderr.write(f"{line}\n")
    sys.stderr.flush()
