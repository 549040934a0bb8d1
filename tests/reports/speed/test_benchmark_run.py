"""The benchmark's machinery: taking turns, the check before it, Mitsuba in a process."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mitsuba_ref.reference.errors import MitsubaError
from mitsuba_ref.reference.variant_process import find_llvm
from mitsuba_ref.speed.rays_per_path import mean_rays_per_path
from mitsuba_ref.speed.timed_mitsuba import TimedMitsuba
from reports.commands import benchmark
from reports.errors import ReportError
from reports.speed import compile_times, contenders, starts, turns
from reports.speed.compile_times import SceneTime
from reports.speed.turns import Render

CLOSED_ROOM = """<scene version="3.0.0">
<default name="spp" value="4"/><default name="width" value="8"/>
<default name="height" value="8"/>
<integrator type="path"><integer name="max_depth" value="4"/>
  <integer name="rr_depth" value="100"/></integrator>
<sensor type="perspective">
  <transform name="to_world">
    <lookat origin="0,0,-0.9" target="0,0,0" up="0,1,0"/></transform>
  <film type="hdrfilm"><integer name="width" value="$width"/>
    <integer name="height" value="$height"/><rfilter type="box"/></film>
  <sampler type="independent"><integer name="sample_count" value="$spp"/></sampler>
</sensor>
<emitter type="point"><point name="position" x="0.1" y="0.2" z="0.3"/>
  <rgb name="intensity" value="1 2 3"/></emitter>
<shape type="cube"><boolean name="flip_normals" value="true"/>
  <bsdf type="diffuse"/></shape>
</scene>"""


@pytest.fixture
def room(tmp_path: Path) -> Path:
    folder = tmp_path / "room"
    folder.mkdir()
    (folder / "scene.xml").write_text(CLOSED_ROOM)
    return folder / "scene.xml"


def noisy(level: float, spread: float) -> Callable[[int, int], Render]:
    """A contender whose image means scatter around `level`."""

    def render(seed: int, spp: int) -> Render:
        red, green, blue = np.random.default_rng(seed).normal(level, spread, 3)
        return Render(0.1, (float(red), float(green), float(blue)))

    return render


def test_contenders_alternate() -> None:
    order: list[tuple[str, int]] = []

    def contender(name: str) -> Callable[[int, int], Render]:
        def render(seed: int, spp: int) -> Render:
            order.append((name, spp))
            return Render(float(len(order)), (0.0, 0.0, 0.0))

        return render

    seconds = turns.take_turns({"a": contender("a"), "b": contender("b")}, rounds=3, spp=5)
    assert order == [("a", 5), ("b", 5)] * 3
    assert seconds == {"a": [1.0, 3.0, 5.0], "b": [2.0, 4.0, 6.0]}


def test_equal_means_pass_and_a_shift_of_ten_errors_does_not() -> None:
    """Standard error of a difference of two means of 8: spread x sqrt(2 / 8) = 0.005."""
    seeds = range(8)
    same = turns.compare_means(noisy(0.5, 0.01), noisy(0.5, 0.01), seeds, 1)
    assert same.passed
    shifted = turns.compare_means(noisy(0.5, 0.01), noisy(0.55, 0.01), seeds, 1)
    assert not shifted.passed
    assert shifted.z[0] == pytest.approx(-10.0, rel=0.6)
    assert 6.0 < shifted.limit < 8.0  # 14 degrees of freedom


def test_equal_means_are_stopped_as_often_as_is_said(monkeypatch) -> None:
    """Where one side is much noisier, with alpha 1 %: 20 of 2000 pairs of 8 seeds, +- 13.

    13 are three standard errors. By the limits of normal noise it would be 130.
    """
    monkeypatch.setattr(turns, "ALPHA", 0.01)
    pairs = np.random.default_rng(1).normal(0.5, 0.01, (2000, 16, 3))
    pairs[:, 8:] = 0.5 + (pairs[:, 8:] - 0.5) / 100.0
    stopped = 0
    for means in pairs:

        def drawn(seed: int, spp: int, means: Any = means) -> Render:
            return Render(0.1, tuple(means[seed]))

        stopped += not turns.compare_means(drawn, drawn, range(8), 1).passed
    assert 7 <= stopped <= 33


def test_means_without_noise_are_compared_up_to_rounding() -> None:
    """No spread at all gives no division by zero, and a real difference still shows."""
    assert turns.compare_means(noisy(0.5, 0.0), noisy(0.5, 0.0), range(2), 1).passed
    assert turns.compare_means(noisy(0.5, 0.0), noisy(0.500001, 0.0), range(2), 1).passed
    assert not turns.compare_means(noisy(0.5, 0.0), noisy(0.51, 0.0), range(2), 1).passed
    assert turns.compare_means(noisy(0.0, 0.0), noisy(0.0, 0.0), range(2), 1).passed


def test_means_that_are_no_numbers_do_not_pass() -> None:
    """In whatever channel: `max` of numbers and a NaN depends on their order."""
    for channel in range(3):

        def broken(seed: int, spp: int, channel: int = channel) -> Render:
            mean = list(noisy(0.5, 0.01)(seed, spp).mean)
            mean[channel] = math.nan
            return Render(0.1, tuple(mean))  # type: ignore[arg-type]

        assert not turns.compare_means(broken, noisy(0.5, 0.01), range(8), 1).passed


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
    """The request that nobody read must not fail once more when the pipe is closed."""
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


def run_small(room: Path, out: Path, monkeypatch: pytest.MonkeyPatch, scale: float) -> int:
    """Run the benchmark with Mitsuba in the place of ours, its picture times `scale`."""
    with TimedMitsuba("scalar_rgb", room, {"width": "8", "height": "8"}, 2) as mitsuba:

        def render(seed: int, spp: int) -> Render:
            timed = mitsuba.render(seed, spp)
            red, green, blue = (scale * value for value in timed.mean)
            return Render(timed.seconds, (red, green, blue))

        monkeypatch.setattr(contenders, "ours", lambda *_, **ways: render)
        monkeypatch.setattr(contenders, "PEERS", {"mitsuba scalar_rgb": "scalar_rgb"})
        monkeypatch.setattr(starts, "warm_starts", lambda *_: [1.0])
        size = ["--size", "8", "--spp", "2", "--rounds", "2", "--no-cold"]
        return benchmark.main(["--scene", str(room), "--out", str(out), *size])


def test_benchmark_writes_record_and_page(
    room: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The whole command, with Mitsuba in our place: checked, in turn, with its origin."""
    assert run_small(room, tmp_path, monkeypatch, scale=1.0) == 0
    shown = capsys.readouterr()
    assert "loading lightproof" in shown.err.splitlines()[0]  # before any of the work
    for wanted in ("mitsuba scalar_rgb", "times ours", "versions: python", "machine: cpu"):
        assert wanted in shown.out
    written = json.loads((tmp_path / "data/benchmark.json").read_text())
    assert [len(one["seconds"]) for one in written["renderers"]] == [2, 2]
    assert written["check"]["passed"] is True
    assert written["rays_per_path"] == 7.0
    assert str(tmp_path) not in json.dumps(written["scene"])
    assert (tmp_path / "benchmark.html").is_file()


def test_wrong_picture_is_not_timed(
    room: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A renderer that is half as bright is refused before the first round."""
    assert run_small(room, tmp_path, monkeypatch, scale=0.5) == 2
    assert "nothing was timed" in capsys.readouterr().err
    assert os.listdir(tmp_path) == ["room"]


class Processes:
    """Stands for `subprocess.run`: notes each call and writes the picture it names."""

    def __init__(self, status: int = 0, writes: bool = True) -> None:
        self.status, self.writes = status, writes
        self.commands: list[list[str]] = []
        self.caches: list[str | None] = []
        self.cache_was_empty: list[bool] = []

    def __call__(
        self, command: list[str], *, env: dict[str, str], **_: object
    ) -> subprocess.CompletedProcess[str]:
        self.commands.append(command)
        self.caches.append(env.get("LIGHTPROOF_CACHE"))
        self.cache_was_empty.append(not os.listdir(env["LIGHTPROOF_CACHE"]))
        if self.writes:
            Path(command[command.index("-o") + 1]).touch()
        return subprocess.CompletedProcess(command, self.status, "", "first\nit broke\n")


@pytest.fixture
def warm_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    folder = tmp_path / "cache"
    folder.mkdir()
    (folder / "kernel").touch()
    monkeypatch.setenv("LIGHTPROOF_CACHE", str(folder))
    return str(folder)


def test_warm_starts_share_the_cache_and_do_not_count_the_first(
    warm_cache: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = Processes()
    monkeypatch.setattr(subprocess, "run", run)
    assert len(starts.warm_starts(Path("a.xml"), {"width": "8"}, repeats=3)) == 3
    assert run.caches == [warm_cache] * 4
    begin = [sys.executable, "-m", "renderer", "a.xml", "--spp", "1", "-o"]
    assert run.commands[0][:7] == begin
    assert run.commands[0][8:] == ["-D", "width=8"]


def test_cold_starts_have_an_empty_cache_each(
    warm_cache: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = Processes()
    monkeypatch.setattr(subprocess, "run", run)
    assert len(starts.cold_starts(Path("a.xml"), {}, repeats=2)) == 2
    assert run.cache_was_empty == [True, True]
    assert warm_cache not in run.caches
    assert len(set(run.caches)) == 2


@pytest.mark.parametrize(("status", "writes"), [(1, True), (0, False)])
def test_start_without_a_picture_is_not_a_time(
    warm_cache: str, monkeypatch: pytest.MonkeyPatch, status: int, writes: bool
) -> None:
    monkeypatch.setattr(subprocess, "run", Processes(status, writes))
    with pytest.raises(ReportError, match=f"status {status}: it broke"):
        starts.warm_starts(Path("a.xml"), {}, repeats=1)


def test_start_that_takes_too_long_is_an_error_of_the_report(
    warm_cache: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def endless(command: list[str], **options: object) -> None:
        raise subprocess.TimeoutExpired(command, 300.0)

    monkeypatch.setattr(subprocess, "run", endless)
    with pytest.raises(ReportError, match="no picture within 300 s"):
        starts.warm_starts(Path("a.xml"), {}, repeats=1)


def test_compile_times_are_of_one_process_whose_cache_is_empty(
    warm_cache: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two scenes of a stand-in: each time as it says it, in order, beside the former."""
    program = (
        "import json, os, sys\n"
        "cache = os.environ['LIGHTPROOF_CACHE']\n"
        "for n, scene in enumerate(sys.argv[1:]):\n"
        "    seconds = len(os.listdir(cache)) + 0.5\n"
        "    open(os.path.join(cache, scene), 'w').close()\n"
        "    print(json.dumps({'scene': scene, 'seconds': seconds}), flush=True)\n"
    )
    told: list[str] = []
    stand_in(monkeypatch, program)
    found = compile_times.measure_compile_times("c", told.append, ["metals", "mine"])
    assert found.scenes == (SceneTime("metals", 0.5, 28.3), SceneTime("mine", 1.5, None))
    assert (found.seconds, found.former) == (2.0, 28.3)
    assert ["metals, 1 of 2" in told[0], "mine, 2 of 2" in told[1]] == [True, True]
    assert os.listdir(warm_cache) == ["kernel"]


def test_process_that_ends_early_is_no_compile_time(
    warm_cache: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in(monkeypatch, "import sys\nsys.exit('it broke')")
    with pytest.raises(ReportError, match="metals: no picture: it broke"):
        compile_times.measure_compile_times("c", lambda stage: None, ["metals"])


def stand_in(monkeypatch: pytest.MonkeyPatch, program: str) -> None:
    """Let the process that compiles be this program, with the same arguments."""
    popen = subprocess.Popen

    def start(command: list[str], **options: Any) -> Any:
        if "reports.speed.compile_times" not in command:
            return popen(command, **options)  # git
        return popen([sys.executable, "-c", program, *command[3:]], **options)

    monkeypatch.setattr(compile_times.subprocess, "Popen", start)


def test_first_picture_is_timed_in_processor_seconds(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The real program on one scene: a line of JSON with a time above 0."""
    compile_times.main(["white-furnace"])
    line = json.loads(capsys.readouterr().out)
    assert line["scene"] == "white-furnace"
    assert line["seconds"] > 0.0


def test_nine_scenes_are_compiled_by_default() -> None:
    """The scenes are there, and the former figures are 119 s in all."""
    assert len(compile_times.FORMER) == 9
    assert round(sum(compile_times.FORMER.values())) == 119
    for name in compile_times.FORMER:
        assert (compile_times.ROOT / "scenes" / name / "scene.xml").is_file()
