"""The command `lightproof-report`, also `python -m reports`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from mitsuba_ref.command import cli as harness
from mitsuba_ref.records.json_files import write_atomically
from mitsuba_ref.records.verdicts import exit_status, statuses_in_words
from reports.accelerators_reader import read_accelerators
from reports.accelerators_study import write_study
from reports.benchmark_record import read_benchmark
from reports.errors import ReportError
from reports.page import accelerators_page, benchmark_page, proof_page, results_page
from reports.proof_reader import read_proof_record
from reports.proof_run import QUICK as QUICK_PROOF
from reports.proof_run import make_proof, results_file
from reports.results import read_results
from reports.study_settings import QUICK

DEFAULT_OUT = Path("reports/out")
DEFAULT_SIZE = "demo"
ACCELERATORS = "accelerators.json"
WRONG_USE, INTERRUPTED = STOPPED = 2, 130

EPILOG = f"""exit status, that of the most severe verdict:
{statuses_in_words()}
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare scenes and draw the page, or draw old results; return the exit status.

    Parameters
    ----------
    arguments
        Without the program's name; None: those of the process.
    """
    parser = _parser()
    given = parser.parse_args(sys.argv[1:] if arguments is None else arguments)
    if given.source is not None and (
        given.scenes
        or given.size
        or given.ladder is not None
        or given.accelerators
        or given.proof
    ):
        parser.error(
            "--from draws old results: no SCENE, --size, --ladder, --accelerators, --proof "
            "beside it"
        )
    status = 0
    source: Path = given.source or given.out / "data" / "results.json"
    if given.source is None:
        written_before = _written_at(source)
        status = _run_harness(given, source.parent)
        if status in STOPPED and _written_at(source) == written_before:
            return status  # nothing new to show
        if status not in STOPPED:
            try:
                _further_pages(given, source.parent)
            except KeyboardInterrupt:
                status = INTERRUPTED  # the scenes are there to look at
            except ReportError as error:
                status = _refused(error)
    try:
        shown = draw(source, given.out)
    except ReportError as error:
        return _refused(error)
    return status or shown


def _refused(error: ReportError) -> int:
    sentence = f"lightproof-report: {error}"
    Console(stderr=True).print(sentence, markup=False, soft_wrap=True)
    return WRONG_USE


def draw(source: Path, out: Path) -> int:
    """Draw index.html in `out` from results; say where it is; return the exit status.

    That is the status of the most severe verdict, or 1 if the accelerators disagree or the
    proof has a fault.

    Parameters
    ----------
    source
        A results.json; its pictures are named relative to it.
    out
        Folder for the page; benchmark.json, accelerators.json and the proof in its `data`
        are shown too, each on a page of its own.

    Raises
    ------
    ReportError
        If the results cannot be shown; an older page stays as it is.
    """
    results = read_results(source)
    timings = out / "data" / "benchmark.json"
    benchmark = read_benchmark(timings) if timings.exists() else None
    counted = out / "data" / ACCELERATORS
    study = read_accelerators(counted) if counted.exists() else None
    proven = results_file(out / "data")
    proof = read_proof_record(proven) if proven.exists() else None
    page = out / "index.html"
    content = results_page(results, source.parent, benchmark, study, proof)
    write_atomically(page, content.encode())
    if benchmark is not None:
        write_atomically(out / "benchmark.html", benchmark_page(benchmark).encode())
    if study is not None:
        write_atomically(out / "accelerators.html", accelerators_page(study).encode())
    if proof is not None:
        write_atomically(out / "proof.html", proof_page(proof, proven.parent).encode())
    Console().print(f"The page: {page}", markup=False, soft_wrap=True)
    faulty = study is not None and bool(study.faults)
    faulty = faulty or (proof is not None and bool(proof.faults))
    return exit_status(scene.verdict for scene in results.scenes) or int(faulty)


def _further_pages(given: argparse.Namespace, data: Path) -> None:
    """Measure what is asked for, or due because all scenes were rendered."""
    if _wants(given.accelerators, data / ACCELERATORS, given):
        _study_accelerators(data)
    if _wants(given.proof, results_file(data), given):
        make_proof(data, QUICK_PROOF)


def _wants(asked: bool | None, made: Path, given: argparse.Namespace) -> bool:
    """Say whether to measure: asked for, or all scenes and nothing made so far."""
    return asked if asked is not None else not (given.scenes or made.exists())


def _study_accelerators(data: Path) -> None:
    """Measure all accelerators at the quick sizes, write accelerators.json to `data`."""
    console = Console(stderr=True)
    with console.status("") as status:

        def show(stage: str) -> None:
            status.update(f"accelerators: {stage}")

        write_study(data / ACCELERATORS, QUICK, "python -m reports.accelerators", show)


def _run_harness(given: argparse.Namespace, data: Path) -> int:
    """Let the harness render, compare and write results.json and pictures to `data`."""
    wanted = [str(scene) for scene in given.scenes]
    wanted += ["--report", str(data), "--size", given.size or DEFAULT_SIZE]
    # the page "proof" replays; here, its kernels would double what is compiled
    wanted += ["--checks", "statistics"]
    if given.ladder is not False:
        wanted.append("--ladder")
    return harness.main(wanted)


def _written_at(path: Path) -> int | None:
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return None


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="lightproof-report",
        description="Render scenes in lightproof and in Mitsuba 3, compare them, and write "
        "one self-contained HTML page.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add(
        "scenes",
        nargs="*",
        type=Path,
        metavar="SCENE",
        help="scene.xml or its folder; default: all of scenes/",
    )
    add(
        "--out",
        type=Path,
        default=DEFAULT_OUT,
        metavar="DIR",
        help="where index.html goes (default: %(default)s)",
    )
    add(
        "--from",
        dest="source",
        type=Path,
        metavar="RESULTS.json",
        help="draw these results instead of rendering",
    )
    add(
        "--size",
        choices=("demo", "test"),
        help=f"which size of each scene's proof.toml (default: {DEFAULT_SIZE})",
    )
    add(
        "--ladder",
        action=argparse.BooleanOptionalAction,
        default=None,
        help="measure speed against accuracy too (default: yes)",
    )
    add(
        "--accelerators",
        action=argparse.BooleanOptionalAction,
        default=None,
        help="measure the accelerators too (default: with all scenes, the first time)",
    )
    add(
        "--proof",
        action=argparse.BooleanOptionalAction,
        default=None,
        help="replay and test the scenes too (default: with all scenes, the first time)",
    )
    return parser
