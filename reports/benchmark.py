"""`python -m reports.benchmark`: ours and Mitsuba on one scene, in turn, in one run."""

from __future__ import annotations

import argparse
import json
import shlex
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

import renderer
from mitsuba_ref import machine
from mitsuba_ref.errors import MitsubaError
from mitsuba_ref.ray_count import mean_rays_per_path
from mitsuba_ref.results import write_atomically
from mitsuba_ref.timing import TimedMitsuba
from renderer.errors import SceneError
from renderer.scene_file import read_file
from reports.records.errors import ReportError
from reports.site import DEFAULT_OUT, WRONG_USE, draw
from reports.speed import starts, turns
from reports.speed.page import benchmark_page
from reports.speed.record import SCHEMA, read_benchmark
from reports.speed.section import REFERENCE
from reports.speed.turns import Contender, Render

OURS = "lightproof"
PEERS = {"mitsuba scalar_rgb": "scalar_rgb", "mitsuba llvm_ad_rgb": "llvm_ad_rgb"}
TARGETS = {"speed_ratio": 6.0, "warm_seconds": 2.0, "cold_seconds": 30.0}
CHECK_SEEDS = range(8)
CHECK_SPP = 16

Progress = Callable[[str], None]


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, or read what was measured, and draw benchmark.html; return the exit status.

    Parameters
    ----------
    arguments
        Without the program's name; None: those of the process.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    given = _parser().parse_args(words)
    target = given.out / "data" / "benchmark.json"
    console = Console(stderr=True)
    try:
        if given.source is None:
            with console.status("") as status:
                measured = measure(given, lambda stage: status.update(stage))
            measured["command"] = shlex.join(["python", "-m", "reports.benchmark", *words])
            write_atomically(target, json.dumps(measured, indent=1).encode())
        else:
            read_benchmark(given.source)  # a damaged file must not replace a sound one
            write_atomically(target, given.source.read_bytes())
        page = given.out / "benchmark.html"
        write_atomically(page, benchmark_page(read_benchmark(target)).encode())
        if (target.parent / "results.json").exists():
            draw(target.parent / "results.json", given.out)  # now with a link to this page
    except (ReportError, SceneError, MitsubaError) as error:
        console.print(f"reports.benchmark: {error}", markup=False, soft_wrap=True)
        return WRONG_USE
    Console().print(f"The benchmark: {page}", markup=False, soft_wrap=True)
    return 0


def measure(given: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    """Check that the pictures agree, time everything in turn; return benchmark.json.

    Raises
    ------
    ReportError
        If the image means differ by more than noise: then nothing is timed.
    """
    scene = _scene_file(given.scene)
    size = {"width": str(given.size), "height": str(given.size)}
    parameters = {**size, "spp": str(given.spp)}
    integrator = read_file(scene, **parameters).integrator
    renderers: dict[str, dict[str, Any]] = {}
    with ExitStack() as stack:
        progress(f"loading {OURS}")
        contenders = {OURS: _ours(scene, parameters, given.threads)}
        for name, variant in PEERS.items():
            progress(f"loading {name}")
            try:
                peer = stack.enter_context(
                    TimedMitsuba(variant, scene, parameters, given.threads)
                )
                contenders[name] = _warmed(_peer(peer), given.spp)
            except MitsubaError as error:
                if name == REFERENCE:
                    raise
                renderers[name] = {"unavailable": str(error)}
        progress("comparing image means")
        means = turns.compare_means(
            contenders[OURS], contenders[REFERENCE], CHECK_SEEDS, CHECK_SPP
        )
        if not means.passed:
            raise ReportError(
                f"{scene}: image means {means.first} and {means.second} are "
                f"{means.z} standard errors apart; nothing was timed"
            )
        progress("starting the program, warm and cold")
        warm = starts.warm_starts(scene, size, given.rounds)
        cold = starts.cold_starts(scene, size, 1) if given.cold else []
        seconds = turns.take_turns(contenders, given.rounds, given.spp, progress)
    renderers |= {name: {"seconds": times} for name, times in seconds.items()}
    progress("counting rays")
    rays = None
    if integrator.name == "path":
        rays = mean_rays_per_path(
            scene, size, max_depth=integrator.max_depth, rr_depth=integrator.rr_depth
        )
    shown = f"scenes/{scene.parent.name}/{scene.name}"
    return {
        "schema": SCHEMA,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "commit": machine.current_commit(),
        "machine": machine.describe_machine(),
        "versions": machine.installed_versions(),
        "scene": {
            "name": scene.parent.name,
            "path": shown,
            "integrator": integrator.name,
            "max_depth": integrator.max_depth,
        },
        "width": given.size,
        "height": given.size,
        "spp": given.spp,
        "workers": given.threads,
        "rays_per_path": rays,
        "check": {
            "passed": means.passed,
            "seeds": len(CHECK_SEEDS),
            "spp": CHECK_SPP,
            "z": means.z,
            "limit": turns.LIMIT,
            "ours_mean": means.first,
            "reference_mean": means.second,
        },
        "renderers": [{"name": n, **renderers[n]} for n in (OURS, *PEERS)],
        "starts": {
            "warm": warm,
            "cold": cold,
            "command": shlex.join(["python", *starts.start_command(shown, size, "o.npy")]),
        },
        "targets": TARGETS,
    }


def _ours(scene: Path, parameters: dict[str, str], threads: int) -> Contender:
    """Return our renderer, loaded, compiled and warm."""
    loaded = renderer.load_file(scene, **parameters)

    def render(seed: int, spp: int) -> Render:
        begin = time.perf_counter()
        image = np.asarray(renderer.render(loaded, spp=spp, seed=seed, threads=threads))
        seconds = time.perf_counter() - begin
        red, green, blue = (float(v) for v in image.mean(axis=(0, 1), dtype=np.float64))
        return Render(seconds, (red, green, blue))

    return _warmed(render, int(parameters["spp"]))


def _peer(peer: TimedMitsuba) -> Contender:
    def render(seed: int, spp: int) -> Render:
        timed = peer.render(seed, spp)
        return Render(timed.seconds, timed.mean)

    return render


def _warmed(contender: Contender, spp: int) -> Contender:
    """Render at both sample counts that will be used; JIT variants compile for each."""
    contender(0, CHECK_SPP)
    contender(0, spp)
    return contender


def _scene_file(given: str) -> Path:
    """Return the scene file for a path, a folder, or the name of one of scenes/."""
    folders = [Path(given), Path("scenes") / given]
    folders.append(Path(__file__).resolve().parent.parent / "scenes" / given)
    for place in folders:
        file = place / "scene.xml" if place.is_dir() else place
        if file.is_file():
            return file.resolve()
    raise ReportError(f"{given}: no such scene file, and no such folder in scenes/")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m reports.benchmark",
        description="Time lightproof and Mitsuba in turn on one scene and draw the page.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    add = parser.add_argument
    add("--out", type=Path, default=DEFAULT_OUT, metavar="DIR", help="where the page goes")
    add("--scene", default="cornell-box", help="name of one of scenes/, or a path")
    add("--from", dest="source", type=Path, metavar="BENCHMARK.json", help="draw only")
    add("--size", type=_positive, default=256, help="pixels a side")
    add("--spp", type=_positive, default=64, help="samples per pixel")
    add("--threads", type=_positive, default=2, help="workers of each renderer")
    add("--rounds", type=_positive, default=7, help="turns of each renderer")
    add(
        "--cold",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="also start the program with an empty cache",
    )
    return parser


def _positive(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{value}: must be 1 or more")
    return value


if __name__ == "__main__":
    raise SystemExit(main())
