"""From accelerators.json to what its page shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reports.accelerator_page.beside_embree import (
    Ratios,
    any_hit_ratio,
    beside_embree,
    judged_structure,
)
from reports.accelerator_page.growth_section import GrowthSection, growth_section
from reports.accelerator_page.scene_tables import SceneSection, median_speed, scene_section
from reports.accelerator_study.record import (
    AcceleratorStudy,
    Figure,
    FigureRow,
    StudyScene,
    WorkMaps,
)
from reports.look.heat_map import heat_map_uri

SCALED = "diffuse"  # the rays of parallel scaling
STADIUM = "stadium"
GRID_AT_LEAST = 4500.0  # tests of a ray into the ball by a uniform grid: 0.9 of 5000
TREE_AT_MOST = 50.0  # by what adapts to the scene


@dataclass(frozen=True)
class ScalingRow:
    """One contender by number of threads."""

    name: str
    speeds: tuple[float | None, ...]  # million rays/s
    gain: float | None  # of the most threads over one


@dataclass(frozen=True)
class FigureLine:
    """One structure at the lecture's figure."""

    row: FigureRow
    share: float  # of the picture's rays that were measured
    one: float | None  # seconds for the whole picture, one thread
    all: float | None
    tests: float  # of the whole picture
    gain: float | None  # brute force's seconds over this one's, one thread


@dataclass(frozen=True)
class Picture:
    """One map of work."""

    name: str
    uri: str
    mean: float


@dataclass(frozen=True)
class MapsSection:
    """All maps of one scene on one scale."""

    title: str
    width: int
    height: int
    most: int
    pictures: tuple[Picture, ...]


@dataclass(frozen=True)
class StadiumRow:
    """Primitive tests of a ray that hits the ball in the stadium."""

    name: str
    tests: float
    share: float  # of the ball's triangles, for a bar


@dataclass(frozen=True)
class AcceleratorsSection:
    """The whole page, ready to be drawn."""

    record: AcceleratorStudy
    judged: str  # the structure that stands beside Embree
    beside_embree: tuple[Ratios, ...]
    any_hit: float | None  # its speed over that of the nearest hit, the same rays
    scenes: tuple[SceneSection, ...]
    growth: GrowthSection
    figure: tuple[FigureLine, ...]
    thread_counts: tuple[int, ...]
    scaling: tuple[ScalingRow, ...]
    maps: tuple[MapsSection, ...]
    stadium: tuple[StadiumRow, ...]


def build_accelerators_section(study: AcceleratorStudy) -> AcceleratorsSection:
    """Work out what the page shows from the raw times and counts."""
    scenes = tuple(scene_section(scene, study) for scene in study.scenes)
    titles = {scene.name: scene.title for scene in study.scenes}
    counts = _thread_counts(study.scenes[0])
    return AcceleratorsSection(
        record=study,
        judged=judged_structure(study),
        beside_embree=beside_embree(study),
        any_hit=any_hit_ratio(study),
        scenes=scenes,
        growth=growth_section(study.growth, study.naive),
        figure=_figure_lines(study.figure, study),
        thread_counts=counts,
        scaling=_scaling(study.scenes[0], counts),
        maps=tuple(_maps(one, titles.get(one.scene, one.scene)) for one in study.maps),
        stadium=_stadium(study),
    )


def _thread_counts(scene: StudyScene) -> tuple[int, ...]:
    found = {
        threads for row in scene.structures for threads in row.nanoseconds.get(SCALED, {})
    }
    return tuple(sorted(found))


def _scaling(scene: StudyScene, counts: tuple[int, ...]) -> tuple[ScalingRow, ...]:
    rows = []
    contenders = [(row.name, row.nanoseconds) for row in scene.structures]
    contenders += [(row.name, row.nanoseconds) for row in scene.peers]
    for name, times in contenders:
        speeds = tuple(median_speed(times, SCALED, count) for count in counts)
        if any(speeds):
            first, last = speeds[0], speeds[-1]
            gain = last / first if first and last and len(counts) > 1 else None
            rows.append(ScalingRow(name, speeds, gain))
    return tuple(rows)


def _figure_lines(figure: Figure | None, study: AcceleratorStudy) -> tuple[FigureLine, ...]:
    if figure is None:
        return ()
    rays = figure.width * figure.height

    def whole(row: FigureRow, threads: int) -> float | None:
        each = row.nanoseconds.get(threads)
        return None if each is None else each * rays * 1e-9

    naive = next((row for row in figure.rows if row.name == study.naive), None)
    slowest = whole(naive, 1) if naive else None
    lines = []
    for row in figure.rows:
        one = whole(row, 1)
        lines.append(
            FigureLine(
                row=row,
                share=row.rays / rays,
                one=one,
                all=whole(row, study.threads),
                tests=row.tests * rays,
                gain=slowest / one if slowest and one else None,
            )
        )
    return tuple(lines)


def _maps(record: WorkMaps, title: str) -> MapsSection:
    works = [np.array(one.work, np.int64) for one in record.maps]
    most = max((int(work.max()) for work in works), default=1)
    return MapsSection(
        title=title,
        width=record.width,
        height=record.height,
        most=most,
        pictures=tuple(
            Picture(one.name, heat_map_uri(work, most), one.mean)
            for one, work in zip(record.maps, works, strict=True)
        ),
    )


def _stadium(study: AcceleratorStudy) -> tuple[StadiumRow, ...]:
    return tuple(
        StadiumRow(one.name, one.ball_tests, one.ball_tests / 5000.0)
        for maps in study.maps
        if maps.scene == STADIUM
        for one in maps.maps
        if one.ball_tests is not None
    )
