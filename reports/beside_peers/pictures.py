"""Pictures of several scenes, ours and Mitsuba's in turn, after their means agreed.

All by independent samples, so that every renderer takes as many: what samples are worth is
measured elsewhere (study `speed-accuracy`). Rays start as far off their surface as
Mitsuba's do: by ours a ball of small triangles under a sun is darker by 1e-4, which the
comparison of means would see.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

from reports.beside_peers.record import PictureTimes
from reports.errors import ReportError
from reports.speed.contenders import OURS, load_all
from reports.speed.measure import CHECK_SEEDS, scene_file
from reports.speed.record import Renderer
from reports.speed.section import REFERENCE
from reports.speed.turns import compare_means, take_turns
from reports.trials.large_meshes import LARGE, written

SAMPLER, RAY_OFFSET = "independent", "mitsuba"


class Wanted(NamedTuple):
    """A picture that is timed."""

    scene: str  # of scenes/, or one of `LARGE`
    width: int
    height: int
    spp: int


PICTURES = (
    Wanted("cornell-box", 256, 256, 64),
    Wanted("appel-teapot", 1920, 1080, 1),
    Wanted("appel-teapot", 1920, 1080, 4),
    Wanted("ball-and-sun", 1280, 720, 16),
    Wanted("ball-and-lamp", 1280, 720, 4),
    Wanted("instances", 144, 96, 64),
    Wanted("textured-room", 256, 192, 32),
    Wanted("metals", 256, 192, 32),
)


def time_pictures(
    threads: int,
    rounds: int,
    progress: Callable[[str], None],
    wanted: tuple[Wanted, ...] = PICTURES,
) -> tuple[PictureTimes, ...]:
    """Time each picture in every renderer.

    Raises
    ------
    ReportError
        If our mean and that of `REFERENCE` differ by more than noise: then nothing more is
        timed. Another variant whose mean does is left out, as the llvm variant is where
        there are instances.
    """
    large = sorted({one.scene for one in wanted} & set(LARGE))
    with written(large) as paths:
        files = {path.parent.name: path for path in paths}
        return tuple(
            _time(
                one,
                files.get(one.scene) or scene_file(one.scene),
                threads,
                rounds,
                progress,
            )
            for one in wanted
        )


def _time(
    wanted: Wanted,
    scene: Path,
    threads: int,
    rounds: int,
    progress: Callable[[str], None],
) -> PictureTimes:
    name, width, height, spp = wanted
    size = {"width": str(width), "height": str(height), "spp": str(spp)}
    title = f"{name}, {width} x {height}, {spp} samples"
    with ExitStack() as stack:
        contenders, absent = load_all(
            stack,
            scene,
            size,
            threads,
            (spp,),
            lambda stage: progress(f"{title}: {stage}"),
            SAMPLER,
            ray_offset=RAY_OFFSET,
        )
        unavailable = {peer: f"not available: {why}" for peer, why in absent.items()}
        checks = {}
        for peer in list(contenders)[1:]:
            progress(f"{title}: comparing image means with {peer}")
            means = compare_means(contenders[OURS], contenders[peer], CHECK_SEEDS, spp)
            checks[peer] = means
            if means.passed:
                continue
            apart = (
                f"image means {means.first} and, by {peer}, {means.second} are {means.z} "
                "standard errors apart; it was not timed"
            )
            if peer == REFERENCE:
                raise ReportError(f"{scene}: {apart}")
            unavailable[peer] = f"{name}: {apart}"
            del contenders[peer]
        means = checks[REFERENCE]
        seconds = take_turns(
            contenders, rounds, spp, lambda stage: progress(f"{title}: {stage}")
        )
    check = means.record(len(CHECK_SEEDS), spp)
    renderers = tuple(
        Renderer(each, tuple(seconds.get(each, ())), unavailable.get(each, ""))
        for each in (*contenders, *unavailable)
    )
    return PictureTimes(name, width, height, spp, check, renderers)
