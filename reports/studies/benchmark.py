"""Pictures, rays and starts: ours, Mitsuba's and Embree's, in turn.

Image means and hits are compared before anything is timed. Pictures are of independent
samples, so that every renderer takes as many: what samples are worth is another study
(`speed-accuracy`). Rays start as far off their surface as Mitsuba's do: by our own rule a
ball of small triangles under a sun is darker by 1e-4, which the comparison of means would
see.
"""

from __future__ import annotations

import functools
import statistics
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

from mitsuba_ref.records.machine import usable_cores
from mitsuba_ref.speed.rays_per_path import mean_rays_per_path
from renderer.kernels.records.batch import BOXES, PRIMITIVES
from renderer.scene_file import read_file
from reports.bench.rows import Row, Table
from reports.bench.study import Bench, Study
from reports.bench.timing import median, ratio, take_turns
from reports.look.formatting import number
from reports.trials.contenders import (
    OURS,
    REFERENCE,
    compare_means,
    load_all,
)
from reports.trials.first_pictures import start_seconds
from reports.trials.large_meshes import FREQUENCY, LARGE, written
from reports.trials.meshes import displaced_icosphere, teapot
from reports.trials.ray_times import Effort, time_rays
from reports.trials.scene_files import scene_content, scene_file
from reports.trials.structures import NAIVE
from reports.trials.tracing import tallied

SAMPLER, RAY_OFFSET = "independent", "mitsuba"
CHECK_SEEDS, CHECK_SPP = range(8), 16
TREE = "wide"  # the one that `auto` takes for the meshes of `RAYS`
START = "start of the program"


class Picture(NamedTuple):
    """A picture that is timed."""

    scene: str  # of scenes/, one of `LARGE`, or a path
    width: int = 256
    height: int = 256
    spp: int = 64


PICTURES = {
    "cornell-box": Picture("cornell-box"),
    "appel-teapot, 1 sample": Picture("appel-teapot", 1920, 1080, 1),
    "appel-teapot, 4 samples": Picture("appel-teapot", 1920, 1080, 4),
    "ball-and-sun": Picture("ball-and-sun", 1280, 720, 16),
    "ball-and-lamp": Picture("ball-and-lamp", 1280, 720, 4),
    "instances": Picture("instances", 144, 96, 64),
    "textured-room": Picture("textured-room", 256, 192, 32),
    "metals": Picture("metals", 256, 192, 32),
    "rough-materials": Picture("rough-materials"),
}
MESHES = {"teapot": teapot, "ball": lambda: displaced_icosphere(FREQUENCY)}
RAYS = {
    f"{mesh}, {kind} rays": (mesh, kind)
    for mesh in MESHES
    for kind in ("camera", "shadow", "diffuse")
}
TIMES = {
    "picture": "time of a picture, that of lightproof is 1",
    "ray": "time of a ray, that of lightproof is 1",
}


def measure(case: str, bench: Bench) -> Iterator[Row]:
    """Yield times and ratios of a picture, of the rays of a mesh, or of the start."""
    if case == START:
        return _start(bench)
    if case in RAYS:
        return _rays(case, bench)
    picture = PICTURES.get(case) or Picture(
        case, bench.whole("size", 256), bench.whole("size", 256), bench.whole("spp", 64)
    )
    return _picture(case, picture, bench)


def _picture(case: str, wanted: Picture, bench: Bench) -> Iterator[Row]:
    """Time a picture.

    Raises
    ------
    ValueError
        If our mean and that of `REFERENCE` differ by more than noise. Another variant
        whose mean does is left out, as the llvm variant is where there are instances.
    """
    name, width, height, spp = wanted
    size = {"width": str(width), "height": str(height)}
    check = min(spp, CHECK_SPP)
    with ExitStack() as stack:
        large = stack.enter_context(written([name] if name in LARGE else []))
        path = large[0] if large else scene_file(name)
        contenders, absent = load_all(
            stack,
            path,
            {**size, "spp": str(spp)},
            bench.whole("threads", max(2, usable_cores()), 2),
            bench.show,
            SAMPLER,
            ray_offset=RAY_OFFSET,
        )
        for peer, why in absent.items():
            yield Row(case=case, contender=peer, quantity="left out", value=why)
        mine = functools.cache(contenders[OURS])
        for peer in list(contenders)[1:]:
            bench.show(f"comparing image means with {peer}")
            means = compare_means(mine, contenders[peer], CHECK_SEEDS, check)
            apart = means.sentence(OURS, peer)
            if not means.passed and peer == REFERENCE:
                raise ValueError(f"{apart}; nothing was timed")
            if not means.passed:
                yield Row(case=case, contender=peer, quantity="left out", value=apart)
                del contenders[peer]
        for contender in contenders.values():
            contender(0, spp)  # compiles, which variants do for each sample count
        seconds = take_turns(
            {
                name: lambda turn, one=one: one(turn, spp).seconds  # type: ignore[misc]
                for name, one in contenders.items()
            },
            _rounds(bench),
            show=bench.show,
        )
        yield from compared(case, "picture", seconds, OURS, "s")
        yield Row(case=case, quantity="size", value=f"{width} x {height}, {spp} samples")
        yield from _throughput(case, path, size, width * height * spp / 1e6, seconds)


def _throughput(
    case: str,
    path: Path,
    size: dict[str, str],
    million_paths: float,
    seconds: Mapping[str, Sequence[float]],
) -> Iterator[Row]:
    """Yield rays per second, if the rays of a path can be counted."""
    integrator = read_file(path, **size).integrator
    if integrator.name != "path":
        return
    rays = mean_rays_per_path(
        path, size, max_depth=integrator.max_depth, rr_depth=integrator.rr_depth
    )
    for name, times in seconds.items():
        yield Row(
            case=case,
            contender=name,
            quantity="million rays per second",
            value=rays * million_paths / statistics.median(times),
        )


def _rays(case: str, bench: Bench) -> Iterator[Row]:
    """Time rays by one thread and by all.

    Raises
    ------
    ValueError
        If our hits are not those of brute force.
    """
    mesh, kind = RAYS[case]
    effort = Effort(192 if bench.quick else 768, _rounds(bench), 1, 0.25)
    threads = sorted({1, bench.whole("threads", max(2, usable_cores()), 2)})
    found = time_rays(MESHES[mesh](), effort, threads, (NAIVE, TREE), (kind,), bench.show)
    tree = found.structure(TREE)
    if tree.fault:
        raise ValueError(tree.fault)
    for peer in found.peers:
        if peer.fault:
            yield Row(case=case, contender=peer.name, quantity="left out", value=peer.fault)
    for count in threads:
        seconds = {
            name: times
            for (name, _, by), times in found.seconds.items()
            if by == count and name != NAIVE and times
        }
        names = {name: f"{name} ({_threads(count)})" for name in seconds}
        names[TREE] = f"{OURS} ({_threads(count)})"
        nanoseconds = {names[n]: [1e9 * x for x in ts] for n, ts in seconds.items()}
        yield from compared(case, "ray", nanoseconds, names[TREE], "ns")
    query = found.queries[kind]
    work = tallied(tree.accel, query, query.batches)[BOXES : PRIMITIVES + 1].sum(axis=0)
    yield Row(
        case=case, quantity="tests of boxes and triangles a ray", value=float(work.mean())
    )


def _threads(count: int) -> str:
    return "1 thread" if count == 1 else f"{count} threads"


def compared(
    case: str, what: str, times: Mapping[str, Sequence[float]], ours: str, unit: str
) -> Iterator[Row]:
    """Yield the ratio of each other contender to ours, then all times.

    Parameters
    ----------
    case, what
        What was timed: a "picture" or a "ray".
    times
        By contender, one of each round.
    ours, unit
        Name of ours; unit of the times.
    """
    row = functools.partial(Row, case=case)
    for name, values in times.items():
        if name != ours:
            value, interval = ratio(values, times[ours])
            yield row(
                contender=name,
                quantity=TIMES[what],
                unit="times",
                value=value,
                interval=interval,
            )
    for name, values in times.items():
        yield row(
            contender=name,
            quantity=f"time of a {what}",
            unit=unit,
            **median(values),
        )


def _start(bench: Bench) -> Iterator[Row]:
    """Start the program with compiled kernels in the cache, and once with none."""
    scene, size = scene_file("cornell-box"), {"width": "256", "height": "256"}
    start = functools.partial(start_seconds, scene, size)
    row = functools.partial(Row, case=START, quantity="time of a start", unit="s")
    bench.show("kernels in the cache")
    start()  # fills it
    warm = [start() for _ in range(_rounds(bench))]
    yield row(contender="kernels in the cache", **median(warm))
    if not bench.quick:
        bench.show("nothing in the cache")
        with tempfile.TemporaryDirectory() as empty:
            yield row(contender="nothing in the cache", value=start(Path(empty)))


def _rounds(bench: Bench) -> int:
    return bench.whole("rounds", 3 if bench.quick else 7)


def verdict(table: Table) -> str:
    """Say how many times as long others take, as geometric means with the range."""
    sentences = []
    for what, quantity in TIMES.items():
        part = table.where(quantity=quantity)
        for name in part.distinct("contender"):
            values = [
                row.value
                for row in part.where(contender=name)
                if isinstance(row.value, float)
            ]
            if not values:
                continue
            ends = [number(end(values), 2) for end in (min, max)]
            spread = f" ({' to '.join(ends)})" if len(values) > 1 else ""
            sentences.append(
                f"For a {what} {name} takes {number(statistics.geometric_mean(values))} "
                f"times as long as lightproof{spread}"
            )
    return ". ".join(sentences) + "." if sentences else ""


STUDY = Study(
    title="Speed against Mitsuba and Embree",
    sentence="How long do lightproof and Mitsuba take for the same picture with the same "
    "samples, and lightproof and Embree for the same rays? Times are ratios of one run, in "
    "turn; right of the line lightproof is faster.",
    advice="Measure a scene of yours: `python -m reports benchmark --case my_scene.xml`.",
    minutes=12,
    quick_minutes=1.5,
    cases=(*PICTURES, *RAYS, START),
    inputs=lambda case, options: scene_content(case),
    quick_cases=("cornell-box", "metals", "teapot, diffuse rays", START),
    any_case=True,
    options={
        "threads": "of each renderer (all cores, at least 2)",
        "rounds": "turns of each (7)",
        "size": "pixels of a side of a scene that --case names (256)",
        "spp": "samples of a scene that --case names (64)",
    },
    measure=measure,
    verdict=verdict,
)
