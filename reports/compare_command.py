"""`lightproof compare`: a verdict on a picture of any renderer, and the mistake in it."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

import renderer
from mitsuba_ref.command.stages import Show, shown_stages
from mitsuba_ref.diagnosis.diagnose import LIKELY, Diagnosis, diagnose
from mitsuba_ref.diagnosis.difference import FALSE_ALARMS, SMALLEST, local_brightness
from mitsuba_ref.diagnosis.image_mistakes import Evidence, Floats, Prediction
from mitsuba_ref.diagnosis.picture_files import read_picture
from mitsuba_ref.diagnosis.scene_mistakes import (
    AlgorithmMistake,
    algorithm_mistakes,
    render_algorithm_mistake,
    render_reading_mistakes,
)
from mitsuba_ref.ladder.pictures_by_seed import reference_seed
from mitsuba_ref.missing_packages import is_installed
from mitsuba_ref.our_renderer.picture import Array, render_ours
from mitsuba_ref.records.json_files import write_atomically
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.errors import MitsubaError
from mitsuba_ref.reference.picture_process import MitsubaWorker
from renderer.command.options import definition
from renderer.errors import SceneError
from renderer.rendering.render_options import parse_count
from renderer.scene_file import read_file_with
from renderer.scene_file.description import SceneDescription

SAME, DIFFERENT, WRONG_USE, INTERRUPTED = 0, 1, 2, 130
SEEDS = 4  # reference pictures
UNKNOWN_LAG = 6  # [pixels] diameter of the widest usual filter, of Lanczos
SAMPLES_OF_A_MISTAKE = 32


@dataclass(frozen=True, eq=False)
class Compared:
    """A diagnosis, and how the pictures were read."""

    diagnosis: Diagnosis
    notes: tuple[str, ...]


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare pictures; print the verdict; return the exit status."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    parser = _parser()
    given = parser.parse_args(words)
    try:
        with shown_stages() as show:
            compared = compare_pictures(given, show)
    except KeyboardInterrupt:
        return INTERRUPTED
    except (SceneError, MitsubaError) as error:
        sys.stderr.write(f"lightproof compare: {error}\n")
        return WRONG_USE
    for line in sentences(compared):
        sys.stdout.write(line + "\n")
    if given.json:
        text = json.dumps(as_record(compared.diagnosis), indent=1)
        try:
            write_atomically(given.json, f"{text}\n".encode())
        except OSError as error:
            sys.stderr.write(f"lightproof compare: {given.json}: {error.strerror}\n")
            return WRONG_USE
    return DIFFERENT if compared.diagnosis.difference.differs else SAME


def compare_pictures(given: argparse.Namespace, show: Show) -> Compared:
    """Read, render and compare what the command line names.

    Raises
    ------
    SceneError, MitsubaError
        If a file, a size or the scene is refused.
    """
    ours, theirs = _split(given)
    if given.json and not given.json.resolve().parent.is_dir():
        raise SceneError(f"{given.json}: there is no such folder")
    pictures, notes = _read(ours)
    picture = np.mean(pictures, axis=0)
    if given.scene is None:
        references, more = _read(theirs)
        lag = UNKNOWN_LAG
        slower: list[Callable[[], Iterator[Prediction]]] = []
    else:
        scene = read_file_with(given.scene, dict(given.define))
        references = _rendered(given, scene, picture, show)
        lag, more = max(1, math.ceil(2.0 * scene.camera.film.rfilter.radius - 1e-6)), ()
        slower = _slower(given, scene, show)
    if picture.shape != references[0].shape:
        raise SceneError(
            f"{ours[0]} has {picture.shape[1]} x {picture.shape[0]} pixels, the reference "
            f"{references[0].shape[1]} x {references[0].shape[0]}; equal sizes are needed"
        )
    if min(picture.shape[:2]) < (smallest := max(SMALLEST, 4 * lag)):
        raise SceneError(
            f"{ours[0]} has {picture.shape[1]} x {picture.shape[0]} pixels; in pictures of "
            f"fewer than {smallest} x {smallest} noise cannot be told from a difference"
        )
    reference = np.mean(references, axis=0)
    scale = local_brightness(reference, lag)
    aovs, shapes = ({}, {}) if given.scene is None else _seen(given, scene, show)
    evidence = Evidence(picture, reference, scale, aovs, shapes)
    show("comparing")
    diagnosis = diagnose(evidence, references, lag, slower)
    return Compared(diagnosis, (*notes, *more))


def _split(given: argparse.Namespace) -> tuple[list[Path], list[Path]]:
    """Return the pictures in question and those of the reference."""
    if given.scene is not None:
        if given.reference:
            raise SceneError("--scene renders the reference: leave out --with")
        return given.pictures, []
    if given.reference:
        return given.pictures, given.reference
    if len(given.pictures) != 2:
        raise SceneError(
            "name one picture and --scene, or two pictures, or several and --with others"
        )
    return given.pictures[:1], given.pictures[1:]


def _read(paths: Sequence[Path]) -> tuple[list[Floats], tuple[str, ...]]:
    read = [read_picture(path) for path in paths]
    for path, (pixels, _) in zip(paths, read, strict=True):
        if pixels.shape != read[0][0].shape:
            raise SceneError(
                f"{path} has {pixels.shape[1]} x {pixels.shape[0]} pixels, {paths[0]} "
                f"{read[0][0].shape[1]} x {read[0][0].shape[0]}; equal sizes are needed"
            )
    return [pixels for pixels, _ in read], tuple(n for _, notes in read for n in notes)


def _rendered(
    given: argparse.Namespace, scene: SceneDescription, picture: Floats, show: Show
) -> list[Floats]:
    """Render the reference, by Mitsuba if it is installed."""
    ours = given.by == "ours" or (given.by is None and not is_installed("mitsuba"))
    requests = [
        RenderRequest(
            str(given.scene), dict(given.define), spp=given.spp, seed=reference_seed(k)
        )
        for k in range(SEEDS)
    ]
    found = []
    if ours:
        loaded = renderer.load_file(given.scene, **dict(given.define))
        for k, request in enumerate(requests):
            show(f"reference {k + 1} of {SEEDS}, by lightproof")
            found.append(
                np.asarray(renderer.render(loaded, given.spp, request.seed), np.float64)
            )
        return found
    with MitsubaWorker() as worker:
        cache = ReferenceCache(worker.render)
        for k, request in enumerate(requests):
            show(f"reference {k + 1} of {SEEDS}, by Mitsuba")
            found.append(cache.get(request, scene.files).pixels.astype(np.float64))
    return found


def _seen(
    given: argparse.Namespace, scene: SceneDescription, show: Show
) -> tuple[dict[str, Array], dict[int, str]]:
    """Return the AOVs at the centres of pixels, and the names of shapes by their index."""
    show("rendering depth, normals and shapes")
    request = RenderRequest(str(given.scene), dict(given.define), kind="aovs")
    names = {k: shape.id or f"number {k + 1}" for k, shape in enumerate(scene.every_shape)}
    return render_ours(request).arrays, names


def _slower(
    given: argparse.Namespace, scene: SceneDescription, show: Show
) -> list[Callable[[], Iterator[Prediction]]]:
    """Return the sources of predictions that have to be rendered."""
    seed, spp = 4321, SAMPLES_OF_A_MISTAKE

    def read_wrongly() -> Iterator[Prediction]:
        show("rendering the scene with mistakes of reading")
        yield from render_reading_mistakes(scene, spp, seed)

    def algorithm(
        mistake: AlgorithmMistake, number: int, count: int
    ) -> Iterator[Prediction]:
        show(f"rendering with a mistake: {mistake.name}, {number} of {count}")
        request = RenderRequest(str(given.scene), dict(given.define), spp=spp, seed=seed)
        found = render_algorithm_mistake(mistake, request)
        if found is not None:
            yield found

    mistakes = [] if given.quick else algorithm_mistakes(scene)
    return [
        read_wrongly,
        *(
            partial(algorithm, mistake, number, len(mistakes))
            for number, mistake in enumerate(mistakes, 1)
        ),
    ]


def sentences(compared: Compared) -> list[str]:
    """Return the verdict in words, most important first."""
    found = compared.diagnosis.difference
    lines = []
    if not found.differs:
        lines.append("The pictures do not differ by more than noise.")
    else:
        lines.append(
            f"The pictures differ by more than noise (p = {found.p_value:.2g}): by "
            f"{100 * found.size:.3g} % of the local brightness, and in the mean by "
            f"{100 * found.mean_bias:+.3g} %."
        )
        likely = [e for e in compared.diagnosis.explanations if e.share >= LIKELY][:3]
        for rank, one in enumerate(likely, 1):
            left = "nothing is left" if one.whole else "a difference is left"
            lines.append(
                f"{rank}. {one.prediction.name}: {one.prediction.sentence} It explains "
                f"{100 * one.share:.3g} % of the difference; {left}."
            )
            if rank == 1:
                lines.append(f"   {one.prediction.advice}")
        if not likely:
            tried = len(compared.diagnosis.tried)
            lines.append(f"None of {tried} known mistakes explains half of it.")
    if not found.differs:
        lines.append(
            f"A bias of {100 * found.detectable:.2g} % of the mean would have been seen "
            "with a probability of 99 %."
        )
    lines.append(f"Equal pictures are called different in {FALSE_ALARMS:g} of all cases.")
    return [*lines, *(f"Note: {note}." for note in compared.notes)]


def as_record(diagnosis: Diagnosis) -> dict[str, object]:
    """Return what programs read: plain values."""
    found = diagnosis.difference
    return {
        "differs": found.differs,
        "p_value": found.p_value,
        "size": found.size,
        "mean_bias": found.mean_bias,
        "detectable": found.detectable,
        "mistakes": [
            {
                "name": one.prediction.name,
                "sentence": one.prediction.sentence,
                "advice": one.prediction.advice,
                "share": one.share,
                "whole": one.whole,
            }
            for one in diagnosis.explanations[:5]
        ],
    }


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="lightproof compare",
        allow_abbrev=False,
        description="Say whether a picture differs from a reference by more than noise, "
        "and name the mistake in it.",
        epilog=f"Exit status: {SAME} no difference beyond noise, {DIFFERENT} a difference, "
        f"{WRONG_USE} a file or the command line is wrong, {INTERRUPTED} interrupted. "
        "Example: lightproof compare mine.exr --scene scene.xml",
    )
    add = parser.add_argument
    add(
        "pictures", nargs="+", type=Path, metavar="PICTURE", help=".exr .npy .hdr .pfm .png"
    )
    add(
        "--scene", type=Path, metavar="SCENE.xml", help="render the reference of this scene"
    )
    add(
        "--with",
        dest="reference",
        nargs="+",
        type=Path,
        default=[],
        metavar="PICTURE",
        help="pictures of the reference, with other seeds",
    )
    add(
        "--by",
        choices=("mitsuba", "ours"),
        help="the program that renders the reference (default: mitsuba if it is installed)",
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
    add("--quick", action="store_true", help="try no mistake that must be compiled")
    add("--json", type=Path, metavar="FILE", help="write the verdict for programs")
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
