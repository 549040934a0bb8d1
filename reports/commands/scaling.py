"""`python -m reports.scaling`: clusters against threads, and simulated ones.

Measured on this machine: what it costs to deal out a portion, and the same picture by
threads and by local workers of one thread each, in turn. With these costs, clusters of up
to 1000 workers are simulated. Run it on a quiet machine; about two minutes.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

import renderer
from mitsuba_ref.records.machine import circumstances
from mitsuba_ref.records.other_programs import busy_sentence
from renderer.errors import ClusterError
from reports.cluster_study.measure import measure_costs, measure_runs
from reports.cluster_study.record import Costs, Run, Scaling, Simulated
from reports.cluster_study.simulation import cases, simulate
from reports.commands.pages import DEFAULT_OUT, WRONG_USE
from reports.errors import ReportError
from reports.records.json_file import write_json
from reports.speed.measure import scene_file

SCHEMA = 1
SCENE = "cornell-box"
WORKERS = (10, 100, 1000)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, simulate, write data/scaling.json, print tables; return the exit status."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    parser = argparse.ArgumentParser(prog="python -m reports.scaling", description=__doc__)
    add = parser.add_argument
    add("--out", type=Path, default=DEFAULT_OUT, help="folder (default: %(default)s)")
    add("--size", type=int, default=512, help="pixels of a side (default: %(default)s)")
    add("--spp", type=int, default=256, help="samples (default: %(default)s)")
    add("--repeats", type=int, default=3, help="turns, of which the best counts")
    add("--counts", type=int, nargs="+", default=[1, 2, 4], help="threads and workers")
    given = parser.parse_args(words)
    err = Console(stderr=True, highlight=False)
    out = Console(width=None if sys.stdout.isatty() else 110, highlight=False)
    path = scene_file(SCENE)
    scene = renderer.load_file(path, width=given.size, height=given.size)
    try:
        err.print("the cost of a portion ...")
        costs = measure_costs(scene)
        runs = measure_runs(scene, given.spp, given.counts, given.repeats, err.print)
    except (ReportError, ClusterError) as error:
        err.print(f"reports.scaling: {error}")
        return WRONG_USE
    simulated = [simulate(case, costs, n) for case in cases() for n in WORKERS]
    record = Scaling(
        **circumstances("reports.scaling", words),
        scene=SCENE,
        samples=given.size**2 * given.spp,
        costs=costs,
        runs=runs,
        simulated=simulated,
    )
    write_json(given.out / "data" / "scaling.json", record, SCHEMA)
    if sentence := busy_sentence(record.machine):
        out.print(sentence, style="bold yellow", markup=False)
    out.print(_costs(costs), _runs(runs, record.samples), _simulated(simulated), sep="\n")
    return 0


def _costs(costs: Costs) -> Table:
    table = Table("cost", "", title="Dealing out, one worker")
    for name, shown in (
        (
            "a portion, processor time of client and scheduler",
            f"{costs.portion * 1e3:.2f} ms",
        ),
        ("a megabyte of sums", f"{costs.byte * 1e9:.2f} ms"),
        ("an empty task, there and back", f"{costs.alone * 1e3:.1f} ms"),
        ("start of the cluster", f"{costs.start:.1f} s"),
        ("first portion: imports, scene, kernels", f"{costs.first:.1f} s"),
        ("one thread traces", f"{costs.rate / 1e6:.1f} Msamples/s"),
    ):
        table.add_row(name, shown)
    return table


def _runs(runs: list[Run], samples: int) -> Table:
    title = f"{SCENE}, {samples / 1e6:.0f} Msamples: best of {len(runs[0].seconds)}"
    columns = ("", "seconds", "Msamples/s", "of threads", "portions", "MB")
    table = Table(*columns, title=title)
    threads = {run.count: min(run.seconds) for run in runs if run.by == "threads"}
    for run in runs:
        best = min(run.seconds)
        table.add_row(
            f"{run.count} {run.by}",
            f"{best:.2f}",
            f"{samples / best / 1e6:.1f}",
            f"{threads[run.count] / best:.0%}",
            str(run.portions or ""),
            f"{run.megabytes:.0f}" if run.portions else "",
        )
    return table


def _simulated(simulated: list[Simulated]) -> Table:
    columns = ("picture", "workers", "seconds", "efficiency", "client is busy")
    table = Table(*columns, title="Simulated")
    for one in simulated:
        table.add_row(
            one.case,
            str(one.workers),
            f"{one.seconds:.0f}",
            f"{one.efficiency:.0%}",
            f"{one.busy:.0%}",
        )
    return table
