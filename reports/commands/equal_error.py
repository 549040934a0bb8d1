"""`python -m reports.equal_error`: what samplers and renderers are worth at equal error.

Several scenes, samplers and seeds in turn: ours and Mitsuba, `scalar_rgb` and, where it
runs, `llvm_ad_rgb`. The formula is `mitsuba_ref.statistics.equal_error`. Nothing is timed
before the means of both renderers' pictures agree.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
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
from mitsuba_ref.statistics.equal_error import geometric_mean, relative_mse_of, worth
from renderer.errors import SceneError
from renderer.names import SAMPLERS
from reports.commands.pages import DEFAULT_OUT, WRONG_USE
from reports.records.circumstances import Circumstances
from reports.records.errors import ReportError
from reports.records.json_file import write_json
from reports.speed import turns
from reports.speed.measure import scene_file

SCHEMA = 1
SCENES = ("cornell-box", "textured-room", "caustic", "instances")
OURS = "lightproof"
OUR_SAMPLERS = ("independent", "multijitter", "sobol")
PEERS = ("scalar_rgb", "llvm_ad_rgb")
THEIR_SAMPLERS = ("independent", "multijitter", "stratified")
CHECK_SEEDS, CHECK_SPP = range(8), 16
REFERENCE_SEED = 1_000_000  # far from those of the pictures that are judged

# (seed, samples) -> seconds and picture
Shot = tuple[float, NDArray[np.float64]]
Contender = Callable[[int, int], Shot]


@dataclass(frozen=True)
class Worth:
    """The pictures of one renderer with one sampler."""

    renderer: str
    sampler: str
    errors: list[float]  # relMSE, one a seed
    seconds: list[float]

    @property
    def value(self) -> float:
        """1 / (relMSE x seconds)."""
        return worth(self.errors, self.seconds)


@dataclass(frozen=True)
class SceneWorth:
    """One scene."""

    scene: str
    width: int
    height: int
    reference: str  # whose, and how many samples
    contenders: list[Worth]
    unavailable: dict[str, str] = field(default_factory=dict)

    @property
    def ratio(self) -> float:
        """Our best sampler's worth, divided by that of the best of all others."""
        ours = [one.value for one in self.contenders if one.renderer == OURS]
        theirs = [one.value for one in self.contenders if one.renderer != OURS]
        return max(ours) / max(theirs)


@dataclass(frozen=True, kw_only=True)
class EqualError(Circumstances):
    """A whole equal_error.json."""

    spp: int
    seeds: int
    threads: int
    scenes: list[SceneWorth]


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
        If the image means differ by more than noise: then nothing is timed.
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
                for sampler in THEIR_SAMPLERS:
                    peer = TimedMitsuba(variant, path, parameters, given.threads, sampler)
                    shots = _theirs(stack.enter_context(peer), folder / "picture.npy")
                    shots(0, given.spp)  # warm, and known to work
                    contenders[f"mitsuba {variant}", sampler] = shots
            except MitsubaError as error:
                unavailable[f"mitsuba {variant}"] = str(error)
        theirs = [name for name, _ in contenders if name != OURS]
        if not theirs:
            raise ReportError(f"{path}: Mitsuba renders it in no variant: {unavailable}")
        fastest = theirs[-1]
        _compare(
            path, contenders[OURS, given.samplers[0]], contenders[fastest, "independent"]
        )
        say(f"{path.parent.name}: reference, {given.reference} samples of {fastest}")
        reference = _reference(
            contenders[fastest, "multijitter"], given.reference, given.spp
        )
        found = {key: Worth(*key, [], []) for key in contenders}
        for seed in range(given.seeds):
            say(f"{path.parent.name}: seed {seed + 1} of {given.seeds}")
            for key, contender in contenders.items():
                seconds, picture = contender(seed, given.spp)
                found[key].seconds.append(seconds)
                found[key].errors.append(relative_mse_of(picture, reference))
    height, width = reference.shape[:2]
    text = f"{given.reference} samples of {fastest}, multijitter"
    return SceneWorth(
        path.parent.name, width, height, text, list(found.values()), unavailable
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


def _compare(path: Path, ours: Contender, theirs: Contender) -> None:
    """Refuse to time pictures that have other means."""

    def with_mean(contender: Contender) -> turns.Contender:
        def render(seed: int, spp: int) -> turns.Render:
            seconds, picture = contender(seed, spp)
            red, green, blue = (float(value) for value in picture.mean(axis=(0, 1)))
            return turns.Render(seconds, (red, green, blue))

        return render

    means = turns.compare_means(with_mean(ours), with_mean(theirs), CHECK_SEEDS, CHECK_SPP)
    if not means.passed:
        raise ReportError(
            f"{path}: image means {means.first} and {means.second} are {means.z} standard "
            "errors apart; nothing was timed"
        )


def _reference(contender: Contender, spp: int, part: int) -> NDArray[np.float64]:
    """Return the mean of pictures of `part` samples each, `spp` or more in all."""
    seeds = range(REFERENCE_SEED, REFERENCE_SEED + -(-spp // part))
    return np.asarray(np.mean([contender(seed, part)[1] for seed in seeds], axis=0))


def _say(console: Console, text: str) -> None:
    console.print(text, markup=False, soft_wrap=True)


def _table(record: EqualError) -> Table:
    mean = geometric_mean([scene.ratio for scene in record.scenes])
    table = Table(
        title=f"{record.spp} samples, {record.seeds} seeds, {record.threads} workers each",
        caption=f"ours / best of Mitsuba, geometric mean: {mean:.2f}",
        title_justify="left",
        caption_justify="left",
    )
    for heading in ("scene", "renderer", "sampler", "seconds", "relMSE", "1/(relMSE s)"):
        justify = "left" if heading in ("scene", "renderer", "sampler") else "right"
        table.add_column(heading, justify=justify)  # type: ignore[arg-type]
    for scene in record.scenes:
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
        table.add_row(scene.scene, "ours / best", "", "", "", f"{scene.ratio:.3g}")
        for name in scene.unavailable:
            table.add_row(scene.scene, name, "not available")
        table.add_section()
    return table


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m reports.equal_error",
        description="Error times time of ours and Mitsuba, in turn, sampler by sampler.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    add = parser.add_argument
    add("scenes", nargs="*", metavar="SCENE", help=f"of scenes/, or files {SCENES}")
    add("--samplers", nargs="+", choices=SAMPLERS, default=list(OUR_SAMPLERS), help="ours")
    add("--spp", type=int, default=64, help="samples per pixel")
    add("--seeds", type=_two_or_more, default=4, help="pictures of each contender")
    add("--reference", type=int, default=2048, help="samples of the reference")
    add("--threads", type=_two_or_more, default=2, help="workers of each renderer")
    add("--full", action="store_true", help="the files' sizes, not those of the tests")
    add(
        "--out", type=Path, default=DEFAULT_OUT, metavar="DIR", help="where the record goes"
    )
    return parser


def _two_or_more(text: str) -> int:
    value = int(text)
    if value < 2:
        raise argparse.ArgumentTypeError(f"{value}: must be 2 or more")
    return value
