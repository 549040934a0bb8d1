"""The ladder of tests as a check of the mutation matrix: every rung, its samples, its time.

Two renderers stand in that do not render: a grey wall with the noise of a seed. Pictures
are a function of the seed, so every outcome is the same in each run. Sound ones climb at
0.7 % false alarms (these seeds give none); a factor of 1.05 is ten times what the rung
"mean" sees with a probability of 99 %.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from canned_renderers import HEIGHT, WIDTH, picture, wall
from test_mutation_matrix import in_make_test

from mitsuba_ref.mutations.climbing import ladder
from mitsuba_ref.mutations.matrix import CHECKS, Row
from mitsuba_ref.mutations.rungs import (
    CLIMB,
    CLIMBED,
    LADDER,
    REPLAY,
    RUNS,
    STATISTICS,
    TESTS,
    CountedRender,
    Rung,
)
from mitsuba_ref.our_renderer.picture import OurPicture
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.reference.errors import MitsubaError
from mitsuba_ref.reference.render import Reference

PROOF = """title = "A wall"
shows = "Noise."
deterministic = {deterministic}
demo = {{width = 24, height = 18, spp = 32}}
test = {{width = 24, height = 18, spp = 32}}
tolerance = {{rmse_factor = 1.25, reason = "the default"}}
"""


def smooth(factor: float = 1.0) -> np.ndarray:
    """A wall without noise or edges."""
    return np.full((HEIGHT, WIDTH, 3), 0.5 * factor, np.float32)


class References:
    """Mitsuba's pictures, and which seeds were requested."""

    def __init__(self, still: bool = False, broken: bool = False) -> None:
        self.still, self.broken = still, broken
        self.seeds: list[int] = []

    def get(self, request: RenderRequest, files: object) -> Reference:
        if self.broken:
            raise MitsubaError("Mitsuba was silent")
        if request.kind == "aovs":
            return Reference(wall(), 0.0, 2, 1, "aov", ())
        self.seeds.append(request.seed)
        pixels = smooth() if self.still else picture(request.seed)
        return Reference({"pixels": pixels}, 0.0, 2, 32, "path", ())


def sound(request: RenderRequest) -> np.ndarray:
    return picture(request.seed)


def climb_wall(folder: Path, made=sound, references=None, still: bool = False):
    """Return the rungs of a renderer that makes pictures with `made`."""
    (folder / "proof.toml").write_text(PROOF.format(deterministic=str(still).lower()))
    scene = folder / "scene.xml"
    scene.write_text("<scene/>")

    def render(request: RenderRequest) -> OurPicture:
        arrays = wall() if request.kind == "aovs" else {"pixels": made(request)}
        spp = 1 if request.kind == "aovs" else 32
        return OurPicture(
            arrays=arrays,
            spp=spp,
            files=(str(scene),),
            seconds=0.0,
            compile_seconds=1e3,
            threads=1,
            integrator="path",
        )

    ours = CountedRender(render)
    return list(ladder(scene, ours, references or References(still)))


def caught(rungs: list[Rung]) -> list[str]:
    return [rung.name.removeprefix(CLIMB) for rung in rungs if rung.caught]


NOISY = tuple(name for name in CLIMBED if name != CLIMB + "radiance")
STILL = tuple(CLIMB + name for name in ("finite", "registration", "aovs", "radiance"))


def test_the_ladder_is_a_check_and_none_of_its_rungs_is_lost():
    """The matrix keeps the names it knows: a rung of another name would be dropped."""
    assert ladder in CHECKS
    assert set(NOISY) | set(STILL) == set(CLIMBED) <= set(LADDER)
    order = [LADDER.index(name) for name in (REPLAY, STATISTICS, *CLIMBED, TESTS)]
    assert order == sorted(order)


def test_a_sound_renderer_climbs_every_rung_with_eight_seeds(tmp_path):
    references = References()
    rungs = climb_wall(tmp_path, references=references)
    assert tuple(rung.name for rung in rungs) == NOISY
    assert caught(rungs) == []
    assert len(set(references.seeds)) == 8
    samples = {rung.name: (rung.spp, rung.seeds) for rung in rungs}
    assert samples.pop("ladder: aovs") == (1, 1)
    assert set(samples.values()) == {(32, 8)}


def test_seconds_grow_from_rung_to_rung_and_leave_compiling_out(tmp_path):
    """Each picture claims to have compiled for 1000 s: the rest is far below zero."""
    seconds = [rung.seconds for rung in climb_wall(tmp_path)]
    assert seconds == sorted(seconds)
    assert seconds[-1] < 0.0


def test_a_defect_is_asked_of_the_rungs_above_the_broken_one(tmp_path):
    """Every picture 5 % brighter: tiles break, and so does what lies above them."""
    rungs = climb_wall(tmp_path, lambda request: 1.05 * picture(request.seed))
    assert tuple(rung.name for rung in rungs) == NOISY
    found = caught(rungs)
    assert {"tiles", "mean", "noise-free mse"} <= set(found)
    assert not {"finite", "registration", "aovs"} & set(found)
    assert all(bool(rung.why) == rung.caught for rung in rungs)


def test_seeds_that_do_nothing_are_seen(tmp_path):
    """No check of a single seed can: the picture of each seed is a right one."""
    assert "pixels" in caught(climb_wall(tmp_path, lambda request: picture(0)))


def test_a_rung_that_does_not_judge_is_left_out(tmp_path):
    """A fifth of Mitsuba's noise: "uniformity" cannot say anything and is not blind."""
    rungs = climb_wall(tmp_path, lambda r: (0.4 + 0.2 * picture(r.seed)).astype("f4"))
    assert CLIMB + "uniformity" not in [rung.name for rung in rungs]


def test_a_scene_without_noise_has_the_still_rungs_of_one_picture(tmp_path):
    for factor, seen in ((1.0, []), (1.01, ["radiance"])):
        rungs = climb_wall(tmp_path, lambda r, factor=factor: smooth(factor), still=True)
        assert tuple(rung.name for rung in rungs) == STILL
        assert caught(rungs) == seen
        assert {rung.seeds for rung in rungs} == {1}


def test_a_nan_in_a_later_seed_ends_the_climb(tmp_path):
    """The comparison looks at seed 0 alone."""

    def made(request: RenderRequest) -> np.ndarray:
        return picture(request.seed) * (np.nan if request.seed == 5 else 1.0)

    rungs = climb_wall(tmp_path, made)
    assert [(rung.name, rung.caught) for rung in rungs] == [("ladder: finite", True)]


def test_a_crash_is_the_mutants_and_mitsubas_is_none(tmp_path):
    def crash(request: RenderRequest) -> np.ndarray:
        raise ValueError("index out of range")

    [rung] = climb_wall(tmp_path, crash)
    assert (rung.name, rung.caught) == (RUNS, True)
    assert rung.why == "ladder: index out of range"
    with pytest.raises(MitsubaError, match="silent"):
        climb_wall(tmp_path, references=References(broken=True))


# ------------------------------------------------------------------------- what is said


def row(*names: str) -> Row:
    """Return a defect on the Cornell box, a quick scene, that these rungs see."""
    rungs = tuple(
        Rung(n, n in names, "", 32, 1.5, 8 if n in CLIMBED else 1) for n in LADDER
    )
    return Row("made-up", "for a test", True, "cornell-box", rungs, 0.0)


def test_the_ladder_closes_no_hole_of_make_test():
    """It does not run there: what it alone sees would not be seen by `make test`."""
    assert in_make_test(row(*CLIMBED)) == []
    assert in_make_test(row(REPLAY, *CLIMBED)) == [REPLAY]
    assert row(*CLIMBED).as_expected
