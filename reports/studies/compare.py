"""`lightproof compare`: how often it gives the right name, and alarms for nothing.

A faulty picture has a mistake with a name (see `reports.trials.faulty_pictures`). The rank
of that name among those that `compare` gives is recorded: 1 is first, 0 is not at all.
Right pictures are those of this renderer, 16 of each scene; a wrong verdict on one of them
is a false alarm. By design 1 in 1,000 is one, so 0.3 of 304 are expected; at 1 in 300 five
or more come with a probability of 0.4 %.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path

from mitsuba_ref.diagnosis.comparison import compare_with_scene
from mitsuba_ref.diagnosis.scene_reference import SceneReference
from reports.bench.rows import Row, Table
from reports.bench.study import Bench, described
from reports.trials.faulty_pictures import (
    SIZE,
    SOURCES,
    FaultyPicture,
    right_picture,
    room,
    scene_path,
)

RIGHT = "right pictures"
RANK, ALARMS = "rank of the right name", "right pictures called different"
SEEDS = 16  # right pictures of each scene
NOISY = tuple(
    """analytic-shapes bumps caustic colour-bleeding cornell-box emitters evening-sky
    grey-furnace instances kaleidoscope leaves many-lights metals principled-gallery
    rough-materials room smooth-mesh textured-room white-furnace""".split()
)


Session = tuple[Path, Callable[[Path], SceneReference]]


@contextmanager
def references(cases: Sequence[str], bench: Bench) -> Iterator[Session]:
    """Give the folder of the scene that is written for a run, and its references."""
    with tempfile.TemporaryDirectory() as folder:
        room(Path(folder))
        yield (
            Path(folder),
            cache(partial(SceneReference, parameters=SIZE, quick=False, show=bench.show)),
        )


def measure(case: str, bench: Bench) -> Iterator[Row]:
    """Yield the rank of each right name, or the number of false alarms."""
    session: Session = bench.session
    folder, reference = session
    if case == RIGHT:
        for name in NOISY[:3] if bench.quick else NOISY:
            bench.show(name)
            path = scene_path(folder, name)
            yield false_alarms(case, name, path, reference(path))
        return
    faulty = list(SOURCES[case](folder))
    for number, picture in enumerate(faulty[::9] if bench.quick else faulty, 1):
        bench.show(f"{picture.name}, {number} of {len(faulty)}")
        yield from ranked(case, picture, reference(picture.scene))


def false_alarms(case: str, name: str, path: Path, reference: SceneReference) -> Row:
    """Count right pictures that are called different."""
    verdicts = [
        compare_with_scene(right_picture(path, 1000 + seed), reference)
        for seed in range(SEEDS)
    ]
    wrong = sum(one.differs for one in verdicts)
    return Row(case=case, contender=name, quantity=ALARMS, value=wrong, unit=f"of {SEEDS}")


def ranked(case: str, picture: FaultyPicture, reference: SceneReference) -> Iterator[Row]:
    """Yield the rank of the right name, and the names given where it is not first."""
    found = compare_with_scene(picture.make(), reference)
    given = found.diagnosis.names
    right = {picture.name, *picture.also}
    places = [place for place, name in enumerate(given, 1) if name in right]
    scene = picture.scene
    place = f"{picture.name}, {'room' if scene.stem == 'room' else scene.parent.name}"
    if not found.differs:
        # what changes nothing has no name
        yield Row(case=case, contender=place, quantity="no difference seen", value="yes")
        return
    yield Row(case=case, contender=place, quantity=RANK, value=min(places, default=0))
    if places[:1] != [1]:
        first = ", ".join(given[:3]) or "none"
        yield Row(case=case, contender=place, quantity="names given", value=first)


def verdict(table: Table) -> str:
    """Return how many names are right, and how many verdicts are wrong."""
    ranks = [row.value for row in table.where(quantity=RANK)]
    first, second, none = (sum(rank == place for rank in ranks) for place in (1, 2, 0))
    alarms = table.where(quantity=ALARMS).rows
    words = (
        f"Of {len(ranks)} pictures with a known mistake that is seen, {first} get the "
        f"right name first, {second} second, {none} not at all."
    )
    if alarms:
        wrong = sum(int(row.value or 0) for row in alarms)
        are = "is" if wrong == 1 else "are"
        words += f" Of {SEEDS * len(alarms)} right pictures {wrong} {are} called different."
    return words


STUDY = described(
    "compare",
    cases=(RIGHT, *SOURCES),
    measure=measure,
    session=references,
    verdict=verdict,
)
