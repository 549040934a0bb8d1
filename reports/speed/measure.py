"""Times ours and Mitsuba on one scene, in turn, after their pictures were compared."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from mitsuba_ref.records import machine
from mitsuba_ref.speed.rays_per_path import mean_rays_per_path
from renderer.scene_file import read_file
from reports.errors import ReportError
from reports.speed import starts, turns
from reports.speed.contenders import OURS, load_all
from reports.speed.record import Benchmark, Renderer, Starts
from reports.speed.section import REFERENCE

TARGETS = {"speed_ratio": 6.0, "warm_seconds": 2.0, "cold_seconds": 30.0}
CHECK_SEEDS = range(8)
CHECK_SPP = 16

Progress = Callable[[str], None]


@dataclass(frozen=True)
class BenchmarkSettings:
    """What is timed, and for how long."""

    scene: str = "cornell-box"  # name of one of scenes/, or a path
    size: int = 256  # pixels a side
    spp: int = 64
    threads: int = 2  # of each renderer
    rounds: int = 7
    cold: bool = True  # start the program with an empty cache, too


def measure(given: BenchmarkSettings, command: str, progress: Progress) -> Benchmark:
    """Check that the pictures agree, then time everything in turn.

    Parameters
    ----------
    given
        What is timed.
    command
        That repeats the measurement.
    progress
        Told what is being done.

    Raises
    ------
    ReportError
        If the image means differ by more than noise: then nothing is timed.
    """
    scene = scene_file(given.scene)
    size = {"width": str(given.size), "height": str(given.size)}
    parameters = {**size, "spp": str(given.spp)}
    integrator = read_file(scene, **parameters).integrator
    with ExitStack() as stack:
        contenders, unavailable = load_all(
            stack, scene, parameters, given.threads, (CHECK_SPP, given.spp), progress
        )
        progress("comparing image means")
        means = turns.compare_means(
            contenders[OURS], contenders[REFERENCE], CHECK_SEEDS, CHECK_SPP
        )
        if not means.passed:
            raise ReportError(
                f"{scene}: image means {means.first} and {means.second} are "
                f"{means.z} standard errors apart; nothing was timed"
            )
        progress("starting the program, warm")
        warm = starts.warm_starts(scene, size, given.rounds)
        cold = []
        if given.cold:
            progress("starting the program, cold")
            cold = starts.cold_starts(scene, size, 1)
        seconds = turns.take_turns(contenders, given.rounds, given.spp, progress)
    progress("counting rays")
    rays = None
    if integrator.name == "path":
        rays = mean_rays_per_path(
            scene, size, max_depth=integrator.max_depth, rr_depth=integrator.rr_depth
        )
    shown = f"scenes/{scene.parent.name}/{scene.name}"
    return Benchmark(
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        command=command,
        commit=machine.current_commit(),
        machine=machine.describe_machine(),
        versions=machine.installed_versions(),
        scene={
            "name": scene.parent.name,
            "path": shown,
            "integrator": integrator.name,
            "max_depth": integrator.max_depth,
        },
        width=given.size,
        height=given.size,
        spp=given.spp,
        workers=given.threads,
        rays_per_path=rays,
        check=means.record(len(CHECK_SEEDS), CHECK_SPP),
        renderers=tuple(
            Renderer(name, tuple(seconds.get(name, ())), unavailable.get(name, ""))
            for name in (*contenders, *unavailable)
        ),
        starts=Starts(
            tuple(warm),
            tuple(cold),
            shlex.join(["python", *starts.start_command(shown, size, "o.npy")]),
        ),
        targets=TARGETS,
    )


def scene_file(given: str) -> Path:
    """Return the scene file for a path, a folder, or the name of one of scenes/."""
    folders = [Path(given), Path("scenes") / given]
    folders.append(Path(__file__).resolve().parents[2] / "scenes" / given)
    for place in folders:
        file = place / "scene.xml" if place.is_dir() else place
        if file.is_file():
            return file.resolve()
    raise ReportError(f"{given}: no such scene file, and no such folder in scenes/")
