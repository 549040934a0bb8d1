"""`python -m reports.benchmark`: ours and Mitsuba in turn; how long kernels compile."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from mitsuba_ref.command.stages import Show, shown_stages
from mitsuba_ref.records.json_files import write_atomically
from mitsuba_ref.reference.errors import MitsubaError
from renderer.errors import SceneError
from reports.argument_types import at_least
from reports.beside_peers.measure import measure_peers
from reports.beside_peers.record import FILE as PEERS_FILE
from reports.beside_peers.record import SCHEMA as PEERS_SCHEMA
from reports.beside_peers.record import read_peers
from reports.beside_peers.table import print_peers
from reports.commands.pages import (
    BENCHMARK,
    COMPILE_TIMES,
    DEFAULT_OUT,
    INTERRUPTED,
    WRONG_USE,
    draw,
    draw_benchmark,
)
from reports.errors import ReportError
from reports.records.json_file import write_json
from reports.speed.compile_times import SCHEMA as COMPILE_SCHEMA
from reports.speed.compile_times import measure_compile_times, read_compile_times
from reports.speed.measure import BenchmarkSettings, measure
from reports.speed.record import SCHEMA, read_benchmark
from reports.speed.table import output, print_benchmark, print_compile_times


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, or read what was measured, draw and print it; return the exit status.

    Parameters
    ----------
    arguments
        Without the program's name; None: those of the process.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    parser = _parser()
    given = parser.parse_args(words)
    if given.peers and given.source is not None:
        parser.error("--from draws what was measured; --peers measures")
    # an empty cache is what `--no-cold` spares
    given.compile = given.compile_only or (
        given.source is None and given.cold and not given.peers
    )
    data = given.out / "data"
    command = shlex.join(["python", "-m", "reports.benchmark", *words])
    console = Console(stderr=True)
    try:
        with shown_stages() as show:
            _measure(given, data, command, show)
        page = draw_benchmark(given.out)
        if (data / "results.json").exists():
            draw(data / "results.json", given.out)  # now with a link to this page
        if given.peers:
            print_peers(read_peers(data / PEERS_FILE), output())
        elif not given.compile_only:
            print_benchmark(read_benchmark(data / BENCHMARK), output())
        if given.compile:
            print_compile_times(read_compile_times(data / COMPILE_TIMES), output())
    except KeyboardInterrupt:
        console.print("reports.benchmark: interrupted")
        return INTERRUPTED
    except (ReportError, SceneError, MitsubaError) as error:
        console.print(f"reports.benchmark: {error}", markup=False, soft_wrap=True)
        return WRONG_USE
    if page is not None and not given.peers:
        Console().print(f"The benchmark: {page}", markup=False, soft_wrap=True)
    return 0


def _measure(given: argparse.Namespace, data: Path, command: str, show: Show) -> None:
    """Write benchmark.json, peers.json, compile_times.json: what is asked for."""
    if given.source is not None:
        read_benchmark(given.source)  # a damaged file must not replace a sound one
        write_atomically(data / BENCHMARK, given.source.read_bytes())
    elif given.peers:
        peers = measure_peers(given.threads, given.rounds, command, show)
        write_json(data / PEERS_FILE, peers, PEERS_SCHEMA)
    elif not given.compile_only:
        settings = BenchmarkSettings(
            given.scene, given.size, given.spp, given.threads, given.rounds, given.cold
        )
        write_json(data / BENCHMARK, measure(settings, command, show), SCHEMA)
    if given.compile:
        times = measure_compile_times(command, show)
        write_json(data / COMPILE_TIMES, times, COMPILE_SCHEMA)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m reports.benchmark",
        allow_abbrev=False,
        description="Time lightproof and Mitsuba in turn on one scene, and what nine "
        "scenes take to compile; print the tables and draw the page.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    add = parser.add_argument
    sizes = BenchmarkSettings()
    add("--out", type=Path, default=DEFAULT_OUT, metavar="DIR", help="where the page goes")
    add("--scene", default=sizes.scene, help="name of one of scenes/, or a path")
    add("--from", dest="source", type=Path, metavar="BENCHMARK.json", help="draw only")
    add("--size", type=at_least(1), default=sizes.size, help="pixels a side")
    add("--spp", type=at_least(1), default=sizes.spp, help="samples per pixel")
    add(
        "--threads",
        type=at_least(1),
        default=sizes.threads,
        help="workers of each renderer",
    )
    add("--rounds", type=at_least(1), default=sizes.rounds, help="turns of each renderer")
    add(
        "--cold",
        action=argparse.BooleanOptionalAction,
        default=sizes.cold,
        help="also start the program with an empty cache, and time what compiles",
    )
    alone = parser.add_mutually_exclusive_group()
    alone.add_argument(
        "--compile",
        dest="compile_only",
        action="store_true",
        help="time nothing but what compiles",
    )
    alone.add_argument(
        "--peers",
        action="store_true",
        help="time nothing but pictures of several scenes beside Mitsuba, and rays "
        "through large meshes beside Embree, each at its own size (a quarter of an hour); "
        "print both tables, write data/peers.json",
    )
    return parser
