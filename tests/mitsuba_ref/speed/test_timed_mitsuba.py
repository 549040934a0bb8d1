"""Mitsuba that is timed: a process that stays, dies or refuses; the rays of a path."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from closed_room import CLOSED_ROOM

from mitsuba_ref.reference.errors import MitsubaError
from mitsuba_ref.reference.variant_process import find_llvm
from mitsuba_ref.speed.rays_per_path import mean_rays_per_path
from mitsuba_ref.speed.timed_mitsuba import TimedMitsuba


@pytest.fixture
def room(tmp_path: Path) -> Path:
    path = tmp_path / "room" / "scene.xml"
    path.parent.mkdir()
    path.write_text(CLOSED_ROOM)
    return path


def test_timed_mitsuba_renders_the_file_and_stays_alive(room: Path) -> None:
    """Two renders of one process: same seed, same mean; the light is 1 : 2 : 3."""
    with TimedMitsuba("scalar_rgb", room, {"width": "6"}, threads=2) as mitsuba:
        first, again, other = (mitsuba.render(seed, 4) for seed in (1, 1, 2))
    assert first.seconds > 0.0
    assert first.mean == again.mean != other.mean
    assert first.mean[1] / first.mean[0] == pytest.approx(2.0, rel=1e-5)
    assert first.mean[2] / first.mean[0] == pytest.approx(3.0, rel=1e-5)


def test_timed_mitsuba_says_why_it_cannot(tmp_path: Path) -> None:
    """A refusal is Mitsuba's sentence; an unknown variant and one worker are refused."""
    with pytest.raises(MitsubaError, match=r"scalar_rgb: .*does not exist"):
        TimedMitsuba("scalar_rgb", tmp_path / "none.xml", {}, threads=2)
    with pytest.raises(MitsubaError, match="scalar_nonsense: "):
        TimedMitsuba("scalar_nonsense", tmp_path / "none.xml", {}, threads=2)
    with pytest.raises(MitsubaError, match="needs 2 threads"):
        TimedMitsuba("scalar_rgb", tmp_path / "none.xml", {}, threads=1)


def test_process_that_dies_is_not_available_and_says_its_last_words(
    room: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Mitsuba may end its whole process, as llvm variants do; ours goes on."""
    module = tmp_path / "broken" / "drjit.py"
    module.parent.mkdir()
    module.write_text(
        "import os, sys\n"
        "print('LLVM ERROR: Cannot select', file=sys.stderr, flush=True)\n"
        "print('what was being compiled', file=sys.stderr, flush=True)\n"
        "os.abort()\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(module.parent))
    with pytest.raises(MitsubaError, match="status -6: LLVM ERROR: Cannot select"):
        TimedMitsuba("scalar_rgb", room, {}, threads=2)


def test_process_that_dies_between_two_renders_says_so_to_the_end(room: Path) -> None:
    """The request that was never read must not fail once more when the pipe is closed."""
    with TimedMitsuba("scalar_rgb", room, {"width": "6"}, threads=2) as mitsuba:
        mitsuba._process.kill()
        mitsuba._process.wait()
        with pytest.raises(
            MitsubaError, match="scalar_rgb: the process ended with status -9"
        ):
            mitsuba.render(1, 4)


def test_newest_usable_llvm_is_found(tmp_path: Path) -> None:
    """15 aborts and 23 is unknown: neither is taken; names of all styles are read."""
    for name in (
        "libLLVM-15.so",
        "libLLVM-14.0.6.so.1",
        "libLLVM.so.17.0",
        "libLLVM-19.so",
        "libLLVM.so.23.1",
        "libLLVMCore.a",
        "libLLVM.so",
    ):
        (tmp_path / name).touch()
    assert find_llvm([str(tmp_path)]) == tmp_path / "libLLVM-19.so"
    (tmp_path / "libLLVM-19.so").unlink()
    assert find_llvm([str(tmp_path)]) == tmp_path / "libLLVM.so.17.0"
    (tmp_path / "libLLVM.so.17.0").unlink()
    assert find_llvm([str(tmp_path)]) is None


def test_rays_of_a_path_in_a_closed_room(room: Path) -> None:
    """Depth 4 without roulette, nothing to escape through, one point light: every path
    has 4 rays to surfaces, and a shadow ray from each surface but the last: 7.
    """
    assert mean_rays_per_path(room, {}, max_depth=4, rr_depth=100, paths=64) == 7.0
    assert mean_rays_per_path(room, {}, max_depth=1, rr_depth=100, paths=64) == 1.0
    endless = mean_rays_per_path(room, {}, max_depth=-1, rr_depth=1, paths=2048)
    # Albedo 1/2: the path survives its n-th bounce with probability 1/2, so it has
    # 1 + 1/2 + 1/4 + ... = 2 surfaces, each with one ray to it and one to the light.
    assert endless == pytest.approx(4.0, abs=6 * 2 * np.sqrt(2 / 2048))
