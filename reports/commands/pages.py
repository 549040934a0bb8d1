"""All pages of one folder, drawn from the records in its `data`."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from mitsuba_ref.records.json_files import write_atomically
from mitsuba_ref.records.verdicts import exit_status
from reports.accelerator_study.record import read_accelerators
from reports.needs.page import needs_page
from reports.needs.record import SCHEMA as NEEDS_SCHEMA
from reports.needs.record import NeedsRecord
from reports.pages.speed_accuracy_page import speed_accuracy_page
from reports.proof_page.page import proof_page
from reports.proof_page.record import read_proof_record
from reports.proof_page.run import results_file
from reports.records.measured import newest
from reports.records.results import read_results
from reports.scenes_page.page import results_page
from reports.soak.page import soak_page
from reports.speed_accuracy.page import speed_accuracy_page
from reports.speed_accuracy.record import FILE as CURVES
from reports.speed_accuracy.record import read_speed_accuracy

DEFAULT_OUT = Path("reports/out")
CURVES = "speed-accuracy"
ACCELERATORS = "accelerators.json"
NEEDS = "needs.json"
PART = "-part"  # in the names of record and page that hold not everything
WRONG_USE, INTERRUPTED = 2, 130  # exit statuses of every command


def draw(source: Path, out: Path) -> int:
    """Draw index.html in `out` from results; say where it is; return the exit status.

    That is the status of the most severe verdict, or 1 if the accelerators disagree or the
    proof has a fault.

    Parameters
    ----------
    source
        A results.json; its pictures are named relative to it.
    out
        Folder for the page; benchmark.jsonl, speed_accuracy.json, accelerators.json and the
        proof in its `data` are shown too, each on a page of its own; limits.html and
        needs.html are named if they are there. What is not in `data` comes from the
        repository's records, if it is among them, and so does what was soaked.

    Raises
    ------
    ReportError
        If the results cannot be shown; an older page stays as it is.
    """
    results = read_results(source)
    speed, store = find_study("benchmark"), Store(out / "data")
    draw_study("benchmark", speed, store, out)
    counted = newest(out / "data" / ACCELERATORS)
    study = read_accelerators(counted) if counted.exists() else None
    proven = results_file(out / "data")
    proof = read_proof_record(proven) if proven.exists() else None
    _needs(out)
    measured = newest(out / "data" / CURVES)
    curves = read_speed_accuracy(measured) if measured.exists() else None
    page = out / "index.html"
    content = results_page(
        results,
        source.parent,
        speed.verdict(store.read("benchmark")),
        study,
        proof,
        curves,
        soak,
        limits=(out / "limits.html").exists(),
        needs=(out / "needs.html").exists(),
        history=(out / "history.html").exists(),
    )
    write_atomically(page, content.encode())
    if curves is not None:
        write_atomically(out / "speed_accuracy.html", speed_accuracy_page(curves).encode())
    if soak is not None:
        write_atomically(out / "soak.html", soak_page(soak).encode())
    if proof is not None:
        write_atomically(out / "proof.html", proof_page(proof, proven.parent).encode())
    write_shared_files(out, [])
    Console().print(f"The page: {page}", markup=False, soft_wrap=True)
    faulty = study is not None and bool(study.faults)
    faulty = faulty or (proof is not None and bool(proof.faults))
    return exit_status(scene.verdict for scene in results.scenes) or int(faulty)


def _needs(out: Path) -> None:
    """Draw needs.html from the repository's record if it lacks, without pictures."""
    page, kept = out / "needs.html", newest(out / "data" / NEEDS)
    if not page.exists() and kept.exists():
        record = read_json(kept, NeedsRecord, NEEDS_SCHEMA)
        write_atomically(page, needs_page(record).encode())
