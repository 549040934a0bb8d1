"""All pages of one folder, drawn from the records in its `data`."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from mitsuba_ref.records.json_files import write_atomically
from mitsuba_ref.records.verdicts import exit_status
from reports.accelerator_page.page import accelerators_page
from reports.accelerator_study.record import read_accelerators
from reports.bench.store import Store
from reports.bench.study import find_study
from reports.errors import ReportError
from reports.limits.page import limits_page
from reports.limits.record import FILE as LIMITS
from reports.limits.record import Limits, read_limits
from reports.needs.page import needs_page
from reports.needs.record import SCHEMA as NEEDS_SCHEMA
from reports.needs.record import NeedsRecord
from reports.pages.speed_accuracy_page import speed_accuracy_page
from reports.proof_page.page import proof_page
from reports.proof_page.record import read_proof_record
from reports.proof_page.run import results_file
from reports.records.json_file import read_json
from reports.records.measured import MEASURED, newest
from reports.records.results import read_results
from reports.scenes_page.page import results_page
from reports.soak.page import soak_page
from reports.soak.record import FILE as SOAK
from reports.soak.record import read_soak
from reports.speed.compile_times import read_compile_times
from reports.speed.page import benchmark_page
from reports.speed.record import read_benchmark

DEFAULT_OUT = Path("reports/out")
CURVES = "speed-accuracy"
ACCELERATORS = "accelerators.json"
BENCHMARK = "benchmark.json"
COMPILE_TIMES = "compile_times.json"
NEEDS = "needs.json"
PART = "-part"  # in the names of record and page that hold not everything
WRONG_USE, INTERRUPTED = 2, 130  # exit statuses of every command


def draw(source: Path, out: Path) -> int:
    """Draw index.html in `out` from results; say where it is; return the exit status.

    That is the status of the most severe verdict, or 1 if the accelerators disagree, the
    proof has a fault or the atlas an alarm.

    Parameters
    ----------
    source
        A results.json; its pictures are named relative to it.
    out
        Folder for the page; benchmark.json, speed-accuracy.jsonl, accelerators.json and the
        proof in its `data` are shown too, each on a page of its own; limits.html and
        needs.html are named if they are there. What is not in `data` comes from the
        repository's records, if it is among them, and so does what was soaked.

    Raises
    ------
    ReportError
        If the results cannot be shown; an older page stays as it is.
    """
    results = read_results(source)
    timings = newest(out / "data" / BENCHMARK)
    benchmark = read_benchmark(timings) if timings.exists() else None
    counted = newest(out / "data" / ACCELERATORS)
    study = read_accelerators(counted) if counted.exists() else None
    proven = results_file(out / "data")
    proof = read_proof_record(proven) if proven.exists() else None
    limits = _limits(out)
    _needs(out)
    curves = Store(out / "data").read(CURVES)
    soak = read_soak(MEASURED / SOAK) if (MEASURED / SOAK).exists() else None
    page = out / "index.html"
    content = results_page(
        results,
        source.parent,
        benchmark,
        study,
        proof,
        limits,
        curves or None,
        soak,
        needs=(out / "needs.html").exists(),
        history=(out / "history.html").exists(),
    )
    write_atomically(page, content.encode())
    draw_benchmark(out)
    if curves:
        content = speed_accuracy_page(CURVES, find_study(CURVES), curves)
        write_atomically(out / "speed_accuracy.html", content.encode())
    if study is not None:
        write_atomically(out / "accelerators.html", accelerators_page(study).encode())
    if soak is not None:
        write_atomically(out / "soak.html", soak_page(soak).encode())
    if proof is not None:
        write_atomically(out / "proof.html", proof_page(proof, proven.parent).encode())
    Console().print(f"The page: {page}", markup=False, soft_wrap=True)
    faulty = study is not None and bool(study.faults)
    faulty = faulty or (proof is not None and bool(proof.faults))
    faulty = faulty or (limits is not None and bool(limits.alarms))
    return exit_status(scene.verdict for scene in results.scenes) or int(faulty)


def _limits(out: Path) -> Limits | None:
    """Return the atlas behind limits.html; draw that from the repository's if it lacks."""
    page, path = out / "limits.html", out / "data" / LIMITS
    if page.exists():
        # not drawn anew: the atlas of today may lack rows that were measured then
        return read_limits(path) if path.exists() else None
    if not (kept := newest(path)).exists():
        return None
    limits = read_limits(kept)
    try:
        write_atomically(page, limits_page(limits).encode())
    except ReportError:  # a row of then is not in the atlas of today
        return None
    return limits


def _needs(out: Path) -> None:
    """Draw needs.html from the repository's record if it lacks, without pictures."""
    page, kept = out / "needs.html", newest(out / "data" / NEEDS)
    if not page.exists() and kept.exists():
        record = read_json(kept, NeedsRecord, NEEDS_SCHEMA)
        write_atomically(page, needs_page(record).encode())


def draw_benchmark(out: Path) -> Path | None:
    """Draw benchmark.html in `out` from the records in its `data`; return its path.

    Returns
    -------
    Path or None
        None if no renderer was timed so far.

    Raises
    ------
    ReportError
        If a record cannot be read; an older page stays as it is.
    """
    timings, compiled = (newest(out / "data" / name) for name in (BENCHMARK, COMPILE_TIMES))
    if not timings.exists():
        return None
    times = read_compile_times(compiled) if compiled.exists() else None
    page = out / "benchmark.html"
    write_atomically(page, benchmark_page(read_benchmark(timings), times).encode())
    return page
