"""`python -m reports.equal_error`: error times time of samplers and renderers.

Several scenes, samplers and seeds in turn: ours and Mitsuba, `scalar_rgb` and, where it
runs, `llvm_ad_rgb`. The formula is `mitsuba_ref.statistics.equal_error`. Nothing is timed
before the means of all contenders' pictures agree with those of one of Mitsuba's.
"""

from __future__ import annotations

import argparse
import functools
import math
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

import renderer
from mitsuba_ref.records.machine import circumstances
from mitsuba_ref.records.proof_file import read_proof
from mitsuba_ref.reference.errors import MitsubaError
from mitsuba_ref.speed.timed_mitsuba import TimedMitsuba
from mitsuba_ref.statistics.equal_error import geometric_mean, relative_mse_of
from renderer.errors import SceneError
from renderer.names import SAMPLERS
from renderer.scene_file.objects.samplers import round_sample_count
from reports.commands.pages import DEFAULT_OUT, WRONG_USE
from reports.records.equal_error import OURS, EqualError, SceneWorth, Worth
from reports.records.errors import ReportError
from reports.records.json_file import write_json
from reports.speed import turns
from reports.speed.measure import scene_file

SCHEMA = 1
SCENES = ("cornell-box", "textured-room", "caustic", "instances")
OUR_SAMPLERS = ("independent", "multijitter", "sobol")
PEERS = ("scalar_rgb", "llvm_ad_rgb")
THEIR_SAMPLERS = ("independent", "multijitter", "stratified")
CHECK_SEEDS, CHECK_SPP = range(8), 16
REFERENCE_SEED = 1_000_000  # far from those of the pictures that are judged

# (seed, samples) -> seconds and picture
Shot = tuple[float, NDArray[np.float64]]
Contender = Callable[[int, int], Shot]


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, write data/equal_error.json, print the table; return the exit status."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    given = _parser().parse_args(words)
    console, scenes = Console(stderr=True), []
    try:
        for name in given.scenes or SCENES:
            scenes.append(
                measure(scene_file(name), given, lambda text: _say(console, text))
            )
    except (ReportError, SceneError, MitsubaError) as error:
        _say(console, f"reports.equal_error: {error}")
        return WRONG_USE
    record = EqualError(
        **circumstances("reports.equal_error", words),
        spp=given.spp,
        seeds=given.seeds,
        threads=given.threads,
        scenes=scenes,
    )
    write_json(given.out / "data" / "equal_error.json", record, SCHEMA)
    Console(width=None if sys.stdout.isatty() else 120).print(_table(record))
    return 0


def measure(
    path: Path, given: argparse.Namespace, say: Callable[[str], None]
) -> SceneWorth:
    """Render one scene with all contenders in turn.

    Raises
    ------
    ReportError
        If image means differ by more than noise: then nothing is timed. If a picture holds
        what is no number.
    """
    size = None if given.full else read_proof(path).test
    parameters = {} if size is None else {k: str(v) for k, v in size.parameters.items()}
    parameters["spp"] = str(given.spp)
    unavailable: dict[str, str] = {}
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        contenders: dict[tuple[str, str], Contender] = {}
        for sampler in given.samplers:
            contenders[OURS, sampler] = _ours(path, parameters, sampler, given.threads)
        for variant in PEERS:
            try:
                with ExitStack() as opened:
                    all_work: dict[tuple[str, str], Contender] = {}
                    for sampler in THEIR_SAMPLERS:
                        peer = opened.enter_context(
                            TimedMitsuba(variant, path, parameters, given.threads, sampler)
                        )
                        shots = _theirs(peer, folder / "picture.npy")
                        shots(0, given.spp)  # warm, and known to work
                        all_work[f"mitsuba {variant}", sampler] = shots
                    stack.push(opened.pop_all())
                contenders |= all_work
            except MitsubaError as error:
                unavailable[f"mitsuba {variant}"] = str(error)
        theirs = [name for name, _ in contenders if name != OURS]
        if not theirs:
            raise ReportError(f"{path}: Mitsuba renders it in no variant: {unavailable}")
        judge = theirs[-1]  # the last that works: any would do
        say(f"{path.parent.name}: image means of {len(contenders)} contenders")
        _compare(path, contenders, (judge, "independent"))
        pictures = math.ceil(given.reference / given.spp)
        taken = pictures * round_sample_count("multijitter", given.spp)
        origin = f"{taken} samples of {judge}, multijitter, in {pictures} pictures"
        say(f"{path.parent.name}: reference, {origin}")
        reference = _reference(contenders[judge, "multijitter"], pictures, given.spp)
        found = {key: Worth(*key, [], []) for key in contenders}
        for seed in range(given.seeds):
            say(f"{path.parent.name}: seed {seed + 1} of {given.seeds}")
            for key, contender in contenders.items():
                seconds, picture = contender(seed, given.spp)
                found[key].seconds.append(seconds)
                try:
                    found[key].errors.append(relative_mse_of(picture, reference))
                except ValueError as error:
                    raise ReportError(
                        f"{path}: {' '.join(key)}, seed {seed}: {error}"
                    ) from error
    height, width = reference.shape[:2]
    return SceneWorth(
        path.parent.name, width, height, origin, list(found.values()), unavailable
    )


def _ours(path: Path, parameters: dict[str, str], sampler: str, threads: int) -> Contender:
    scene = renderer.load_file(path, **parameters)

    def render(seed: int, spp: int) -> Shot:
        begin = time.perf_counter()
        image = renderer.render(scene, spp, seed, threads, sampler=sampler)
        picture = np.asarray(image)
        return time.perf_counter() - begin, picture[..., :3].astype(np.float64)

    render(0, int(parameters["spp"]))  # compiles
    return render


def _theirs(peer: TimedMitsuba, picture: Path) -> Contender:
    def render(seed: int, spp: int) -> Shot:
        seconds = peer.render(seed, spp, picture).seconds
        return seconds, np.load(picture).astype(np.float64)

    return render


def _compare(
    path: Path, contenders: dict[tuple[str, str], Contender], judge: tuple[str, str]
) -> None:
    """Refuse to time pictures that have other means than the judge's.

    Eight contenders that are right are refused by chance for one scene in 200, at most.
    """

    def with_mean(contender: Contender) -> turns.Contender:
        @functools.cache  # the judge is asked again for each of the others
        def render(seed: int, spp: int) -> turns.Render:
            seconds, picture = contender(seed, spp)
            red, green, blue = (float(value) for value in picture.mean(axis=(0, 1)))
            return turns.Render(seconds, (red, green, blue))

        return render

    judged_by = with_mean(contenders[judge])
    for key, contender in contenders.items():
        if key == judge:
            continue
        means = turns.compare_means(with_mean(contender), judged_by, CHECK_SEEDS, CHECK_SPP)
        if not means.passed:
            raise ReportError(
                f"{path}: image means of {' '.join(key)} {means.first} and of "
                f"{' '.join(judge)} {means.second} are {means.z} standard errors apart; "
                "nothing was timed"
            )


def _reference(contender: Contender, pictures: int, spp: int) -> NDArray[np.float64]:
    """Return the mean of pictures of `spp` samples each."""
    seeds = range(REFERENCE_SEED, REFERENCE_SEED + pictures)
    return np.asarray(np.mean([contender(seed, spp)[1] for seed in seeds], axis=0))


def _say(console: Console, text: str) -> None:
    console.print(text, markup=False, soft_wrap=True)


def _table(record: EqualError) -> Table:
    scenes = record.scenes
    mean = geometric_mean([scene.ratio for scene in scenes])
    error = math.hypot(*(scene.log_error for scene in scenes)) / len(scenes)
    table = Table(
        title=f"{record.spp} samples, {record.seeds} seeds, {record.threads} workers each",
        caption=f"ours / best of Mitsuba at {record.spp} samples, geometric mean: "
        f"{_with_error(mean, error)}",
        title_justify="left",
        caption_justify="left",
    )
    for heading in ("scene", "renderer", "sampler", "seconds", "relMSE", "1/(relMSE s)"):
        justify = "left" if heading in ("scene", "renderer", "sampler") else "right"
        table.add_column(heading, justify=justify)  # type: ignore[arg-type]
    for scene in scenes:
        for one in scene.contenders:
            spread = np.std(one.errors, ddof=1) / len(one.errors) ** 0.5
            table.add_row(
                scene.scene,
                one.renderer,
                one.sampler,
                f"{np.median(one.seconds):.3g}",
                f"{np.mean(one.errors):.3g} ± {spread:.1g}",
                f"{one.value:.4g}",
            )
        ratio = _with_error(scene.ratio, scene.log_error)
        table.add_row(scene.scene, "ours / best", f"{record.spp} samples", "", "", ratio)
        for name in scene.unavailable:
            table.add_row(scene.scene, name, "not available")
        table.add_section()
    return table


def _with_error(ratio: float, log_error: float) -> str:
    return f"{ratio:.3g} ± {ratio * log_error:.1g}"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m reports.equal_error",
        description="Error times time of ours and Mitsuba, in turn, sampler by sampler.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    add = parser.add_argument
    add("scenes", nargs="*", metavar="SCENE", help=f"of scenes/, or files {SCENES}")
    add("--samplers", nargs="+", choices=SAMPLERS, default=list(OUR_SAMPLERS), help="ours")
    add("--spp", type=_one_or_more, default=64, help="samples per pixel")
    add("--seeds", type=_two_or_more, default=4, help="pictures of each contender")
    add(
        "--reference",
        type=_one_or_more,
        default=2048,
        help="samples of the reference, or a few more",
    )
    add("--threads", type=_two_or_more, default=2, help="workers of each renderer")
    add("--full", action="store_true", help="the files' sizes, not those of the tests")
    add(
        "--out", type=Path, default=DEFAULT_OUT, metavar="DIR", help="where the record goes"
    )
    return parser


def _one_or_more(text: str) -> int:
    return _at_least(1, text)


def _two_or_more(text: str) -> int:
    return _at_least(2, text)


def _at_least(least: int, text: str) -> int:
    value = int(text)
    if value < least:
        raise argparse.ArgumentTypeError(f"{value}: must be {least} or more")
    return value
