"""The long trials in short: each finds nothing, and finds what is put in its way.

How many rays, files and interrupts the long runs did is in reports/measured/soak.jsonl.
"""

from __future__ import annotations

import itertools
import random
import subprocess
import sys
import zlib
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reports.bench import runner
from reports.bench.rows import Done, Row, Run, Table
from reports.bench.runner import Request, run_study
from reports.bench.steps import Step, Sums, rows_of, sums_of
from reports.bench.store import Store
from reports.bench.study import find_study
from reports.pages.index_page import index_page
from reports.pages.soak_page import merged, soak_page, soaked
from reports.studies import soak
from reports.trials.soaking import formats, interrupts, reading_process, self_hits
from reports.trials.soaking import leaks as rays
from reports.trials.soaking.closed_meshes import ClosedMesh, rays_from_inside
from reports.trials.soaking.damaged_files import Answer, Reader, damaged_file_steps
from reports.trials.soaking.formats import DAMAGE
from reports.trials.soaking.growth import ALPHA, LEAST, MIB, growth_steps, trend
from reports.trials.soaking.sound_files import SoundFile, sound_files

FOREVER = float("inf")


def first(steps, count: int) -> list[Step]:
    return list(itertools.islice(steps, count))


# -------------------------------------------------------------------------------- rays


def test_no_ray_leaks_from_a_closed_mesh() -> None:
    """Each mesh and kind of rays, 2048 rays by two structures."""
    turns = {rays.combination(turn): turn for turn in range(400)}.values()
    steps = [rays.traced(("bvh", "kd-sah"), turn, 2048) for turn in turns]
    assert len(steps) == len(rays.meshes()) * len(rays.KINDS) * 2
    assert [fault for step in steps for fault in step.faults] == []


@pytest.mark.parametrize("kind", rays.KINDS)
@pytest.mark.parametrize(
    "structures",
    [
        pytest.param(("boxes",), id="boxes"),  # which requests the renderer's own records
        pytest.param(rays.STRUCTURES, id="all", marks=pytest.mark.slow),  # 30 s to compile
    ],
)
def test_a_structure_answers_every_kind_of_ray(
    kind: str, structures: tuple[str, ...]
) -> None:
    turn = next(t for t in range(400) if rays.combination(t)[1] == kind)
    step = rays.traced(structures, turn, 64)
    assert step.done == 64 * len(structures)
    assert step.faults == ()


def test_every_kind_of_ray_meets_every_mesh() -> None:
    """In whole rounds of turns each mesh has its share of each kind."""
    shares = sum(mesh.share for mesh in rays.meshes())
    found = Counter(rays.combination(turn) for turn in range(6 * shares))
    assert len(found) == len(rays.meshes()) * len(rays.KINDS) * 2
    assert all(count == mesh.share for (mesh, _, _), count in found.items())


def test_a_short_run_has_every_mesh() -> None:
    """Not 80 turns of the one with most shares before any other."""
    found = {rays.combination(turn)[0].name for turn in range(42)}
    assert found == {mesh.name for mesh in rays.meshes()}


def test_every_structure_has_as_many_rays(monkeypatch: pytest.MonkeyPatch) -> None:
    """Brute force too, which is spared the large meshes; what has enough gets no more."""
    monkeypatch.setattr(rays, "EACH", 128)
    large = next(turn for turn in range(999) if len(rays.combination(turn)[0].faces) > 400)
    part = Sums(counts=Counter({rays.TURNS: large, "rays: bvh": 64}))
    steps = list(rays.ray_steps(part, FOREVER, ("brute", "bvh"), 64))
    assert [step.done for step in steps] == [128, 64]
    counts = Counter(part.counts)
    for step in steps:
        counts.update(step.counts)
    assert counts["rays: brute"] == counts["rays: bvh"] == 128
    assert counts[rays.TURNS] == large + 2


def test_threads_change_nothing() -> None:
    aimed = 1
    steps = [rays.traced(("wide",), aimed, 20_000, threads) for threads in (1, 3)]
    assert steps[0] == steps[1]


def test_every_mesh_is_closed() -> None:
    """Each edge has two faces."""
    for mesh in rays.meshes():
        pairs = np.concatenate([mesh.faces[:, [k, (k + 1) % 3]] for k in range(3)])
        _, faces = np.unique(np.sort(pairs, axis=1), axis=0, return_counts=True)
        assert (faces == 2).all()


def test_rays_are_spread_as_they_should_be() -> None:
    """Directions are uniform, aimed rays pass at 1e-8 to 1e-2 of the edge's length.

    2^16 rays; limits at 5 standard errors: a false alarm in 10^5 seeds, and there is one.
    """
    mesh, n = rays.meshes()[0], 1 << 16
    _, direction, _ = rays_from_inside(mesh, False, 0, n).rows()
    assert np.abs(direction.mean(axis=0)).max() < 5.0 / np.sqrt(3 * n)
    assert np.abs((direction**2).mean(axis=0) - 1 / 3).max() < 5.0 * 0.3 / np.sqrt(n)
    again = rays_from_inside(mesh, False, 1000, 10).rows()[1]
    assert (again == direction[1000:1010]).all()  # any part can be made alone
    origin, direction, _ = (
        rows[:2000].astype(float) for rows in rays_from_inside(mesh, True, 0, n).rows()
    )
    assert np.linalg.norm(origin, axis=1).max() < 0.1001
    ends = (np.stack(mesh.edges)[:, :, None] - origin).astype(float)  # (2, edges, rays, 3)
    ends -= (ends * direction).sum(axis=-1, keepdims=True) * direction
    along = ends[1] - ends[0]
    place = -(ends[0] * along).sum(axis=-1) / (along**2).sum(axis=-1)
    away = ends[0] + np.clip(place, 0.0, 1.0)[..., None] * along
    length = np.linalg.norm(mesh.edges[1] - mesh.edges[0], axis=1)[:, None]
    nearest = (np.linalg.norm(away, axis=-1) / length).min(axis=0)
    assert nearest.max() < 1.1e-2
    for exponent in range(-6, -2):  # nearer than 1e-6 a float32 direction does not aim
        assert abs(np.mean(nearest < 10.0**exponent) - (exponent + 8) / 6) < 0.1


def test_the_page_says_how_many_structures_there_are() -> None:
    assert f"each of {len(rays.STRUCTURES)} structures" in soak.STUDY.about["rays"]


# ------------------------------------------------------------- leaks that are put in


def _with_one_moved(mesh: ClosedMesh, move) -> ClosedMesh:
    """Return the mesh with vertices of its own for face 0, moved."""
    own = move(mesh.vertices[mesh.faces[0]].astype(float)).astype(np.float32)
    faces = mesh.faces.copy()
    faces[0] = len(mesh.vertices) + np.arange(3)
    return replace(mesh, vertices=np.concatenate((mesh.vertices, own)), faces=faces)


def _leaks(monkeypatch: pytest.MonkeyPatch, mesh: ClosedMesh, turn: int) -> Step:
    monkeypatch.setattr(rays, "meshes", lambda: (mesh,))
    return rays.traced(("bvh",), turn, 4096)


@pytest.mark.parametrize("turn", [0, 2, 4])  # anywhere; one by one, any hit, in packets
def test_a_missing_triangle_is_a_leak(monkeypatch: pytest.MonkeyPatch, turn: int) -> None:
    """One of 80: about 1/80 of the rays that go anywhere, by nearest and by any hit."""
    whole = rays.meshes()[1]
    step = _leaks(monkeypatch, replace(whole, faces=whole.faces[1:], share=1), turn)
    assert 4096 / 80 / 3 < step.counts["leaks"] < 3 * 4096 / 80
    assert len(step.faults) == step.counts["leaks"]


@pytest.mark.parametrize(
    "move",
    [
        lambda p: p + 1e-5 * (p[1] - p[0]),
        lambda p: p + 1e-5 * (p.mean(axis=0) - p),
        lambda p: np.stack((p[0] + 1e-5 * (p[1] - p[0]), p[1], p[2])),
    ],
    ids=["shifted", "shrunk", "one vertex moved"],
)
@pytest.mark.parametrize("number", [0, 2, 4], ids=["20", "stretched", "torus"])
def test_a_crack_of_1e_5_is_a_leak(
    monkeypatch: pytest.MonkeyPatch, number: int, move
) -> None:
    """Of an edge's length, along it; an intact mesh has no leak among the same rays."""
    whole = rays.meshes()[number]
    face = whole.vertices[whole.faces[0]].astype(float)
    for mesh, found in ((whole, False), (_with_one_moved(whole, move), True)):
        one = replace(mesh, share=1)
        # aim at the edges of the triangle that is moved
        one.__dict__["edges"] = face, np.roll(face, -1, axis=0)
        step = _leaks(monkeypatch, one, 1)
        assert (step.counts["leaks"] > 0) == found


def test_what_one_structure_loses_is_a_leak(monkeypatch: pytest.MonkeyPatch) -> None:
    """The mesh is whole, and one structure has not got all of it."""
    whole, built = rays.meshes()[0], rays._built
    holed = replace(whole, faces=whole.faces[1:])
    monkeypatch.setattr(
        rays, "_built", lambda s, mesh: built(s, holed if s == "wide" else mesh)
    )
    step = rays.traced(("bvh", "wide"), 0, 4096)
    assert step.counts["leaks"] > 4096 / 20 / 3
    assert all(fault.startswith("wide") for fault in step.faults)


# --------------------------------------------------------------------------- self hits


def test_rays_that_leave_a_surface_do_not_meet_it() -> None:
    """All of the 44 cases, 256 rays each."""
    steps = first(self_hits.self_hit_steps(0, FOREVER, rays=256), len(self_hits.CASES))
    assert len(self_hits.CASES) == 44
    assert [fault for step in steps for fault in step.faults] == []
    assert all(step.counts["rays that left a surface"] > 50 for step in steps)


def test_rays_that_start_on_the_surface_do_meet_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """The check can fail: without an offset some percent of them do."""
    inputs = self_hits._inputs("sphere", 1e3, 1.0)
    settings = inputs.record.settings._replace(rounding_offset=0.0, fixed_offset=0.0)
    monkeypatch.setattr(inputs, "record", inputs.record._replace(settings=settings))
    left, near = self_hits._tried("sphere", 1e3, 1.0, 0, 2048)
    assert near > 0.01 * left


# ----------------------------------------------------------------------- damaged files

FORMATS = [one for one in sound_files() if one.scene]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("damaged")


@pytest.mark.parametrize("sound", FORMATS, ids=lambda one: one.name)
def test_damaged_files_are_refused_or_rendered(folder: Path, sound: SoundFile) -> None:
    """A dozen of each format; the sound one is rendered: the damage is what hurts."""
    assert reading_process.outcome(folder, sound, sound.content) == (
        reading_process.PICTURE,
        "",
    )
    found = Counter()
    for seed in range(12):
        damaged = DAMAGE[Path(sound.name).suffix](random.Random(seed), sound.content)
        outcome, fault = reading_process.outcome(folder, sound, damaged)
        assert fault == "", (seed, outcome)
        found[outcome] += 1
    assert found[reading_process.REFUSED]


def test_damage_knows_the_formats() -> None:
    """Checksums are right, and streams of deflate can be opened: the wrong lies deeper."""
    png = next(one for one in FORMATS if one.name == "rgba.png").content
    bad_sums = opened = 0
    for seed in range(100):
        wrong, place = formats.png(random.Random(seed), png), 8
        while place + 12 <= len(wrong):
            length = int.from_bytes(wrong[place : place + 4], "big")
            kind_and_data = wrong[place + 4 : place + 8 + length]
            check = int.from_bytes(wrong[place + 8 + length : place + 12 + length], "big")
            bad_sums += zlib.crc32(kind_and_data) != check
            if kind_and_data[:4] == b"IDAT":
                try:
                    opened += bool(zlib.decompress(kind_and_data[4:]))
                except zlib.error:
                    pass
            place += 12 + length
    assert bad_sums == 0 and opened > 60


@pytest.mark.parametrize(
    ("raised", "outcome"),
    [
        (ZeroDivisionError("a"), "ZeroDivisionError instead of a SceneError"),
        (MemoryError(), "out of memory"),
    ],
)
def test_what_is_no_scene_error_is_a_fault(
    folder: Path, monkeypatch: pytest.MonkeyPatch, raised: Exception, outcome: str
) -> None:
    def fail(*given: object) -> None:
        raise raised

    monkeypatch.setattr(reading_process, "_rendered", fail)
    found, fault = reading_process.outcome(folder, FORMATS[0], b"")
    assert found == outcome and fault


@pytest.mark.parametrize(
    ("code", "outcome"),
    [
        ("import os; os.abort()", "the process died"),
        ("while True: pass", "more than 10 s"),
        ("import time; time.sleep(1e6)", "hangs"),
    ],
)
def test_a_process_that_dies_or_hangs_is_a_fault(
    monkeypatch: pytest.MonkeyPatch, code: str, outcome: str
) -> None:
    """And the next file finds a new one."""
    start, started = subprocess.Popen, []

    def popen(words, **given):
        started.append(words)
        program = f"import sys\nprint('ready', flush=True)\nsys.stdin.readline()\n{code}"
        return start([sys.executable, "-c", program], **given)

    monkeypatch.setattr(subprocess, "Popen", popen)
    monkeypatch.setattr("reports.trials.soaking.damaged_files.SECONDS", 0.3)
    monkeypatch.setattr("reports.trials.soaking.damaged_files.WAITING", 2.0)
    with Reader() as reader:
        found = reader.answer(0)
    assert found.fault and found.outcome == outcome.replace("10", "0.3")
    assert len(started) == (2 if "more" in outcome else 1)  # too slow: tried once more


def test_a_file_that_was_slow_once_is_tried_again(monkeypatch) -> None:
    """A kernel may have had to be compiled; and a process that died is replaced."""
    program = """if True:
        import os, sys
        print("ready", flush=True)
        for line in sys.stdin:
            if line.strip() == "3":
                os.abort()
            seconds = 5.0 if line.strip() == "1" and os.path.exists(sys.argv[1]) else 0.0
            if seconds:
                os.remove(sys.argv[1])
            print(f'["{line.strip()}", "", {seconds}]', flush=True)
        """
    start, started = subprocess.Popen, []

    def popen(words, **given):
        started.append(words)
        return start([sys.executable, "-c", program, str(slow)], **given)

    monkeypatch.setattr(subprocess, "Popen", popen)
    monkeypatch.setattr("reports.trials.soaking.damaged_files.SECONDS", 4.0)
    with Reader() as reader:
        slow = Path(reader._folder.name) / "slow"
        slow.touch()
        found = [reader.answer(number) for number in range(5)]
    assert [one.outcome for one in found] == [*"012", "the process died", "4"]
    assert [one.fault for one in found if one.fault] == ["the process died: status -6"]
    assert len(started) == 3


def test_a_failing_file_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def answer(self: Reader, number: int) -> Answer:
        return Answer("died", "died" if number == 7 else "", 0.0)

    monkeypatch.setattr(Reader, "answer", answer)
    (step,) = first(damaged_file_steps(5, FOREVER, tmp_path, 4), 1)
    sound, content = reading_process.damaged(7)
    assert step.faults == (f"case 7, {sound.name}: died",)
    assert (tmp_path / f"7-{sound.name}").read_bytes() == content


# -------------------------------------------------------------------------- interrupts


def test_an_interrupted_command_leaves_a_picture_or_nothing() -> None:
    steps = first(interrupts.interrupt_steps(3, FOREVER, spp=16), 1)
    assert [fault for step in steps for fault in step.faults] == []


@pytest.mark.parametrize(
    ("files", "status", "said", "outcome"),
    [
        ([], 130, "interrupted; wrote nothing\n", ""),
        ([], -2, "", ""),
        ([], 1, 'Traceback (most recent call last):\n  File "/usr/lib/site.py"', ""),
        ([], 1, 'Traceback (most recent call last):\n  "/a/renderer/b.py"', "a traceback"),
        (["a.npy", "a.npy.tmp"], 130, "", "another file"),
        (["a.npy"], 130, "", "a picture that cannot be read"),
        ([], 0, "", "a wrong status"),
        ([], 130, "interrupted; wrote a.npy\n", "a wrong message"),
    ],
)
def test_what_an_interrupt_may_leave(
    tmp_path: Path, files: list[str], status: int, said: str, outcome: str
) -> None:
    for name in files:
        (tmp_path / name).write_bytes(b"half")
    found, fault = interrupts._judged(tmp_path, "a.npy", status, said)
    assert (found if fault else "") == outcome


# -------------------------------------------------------------------------------- growth


def test_steady_memory_raises_no_alarm_and_a_leak_does() -> None:
    """50 processes of 200 rounds, noise of 1 MiB: alpha is 0.1 % of false alarms.

    More than one of 50 happens in one of 800 seeds. A leak of 0.1 MiB a round, a hundredth
    of the noise's range, is seen each time.
    """
    rng = np.random.default_rng(5)
    noise = 300 * MIB + MIB * rng.standard_normal((50, 200))
    found = [trend(sizes) for sizes in noise]
    assert sum(one.p <= ALPHA for one in found) <= 1
    leak = 0.1 * MIB * np.arange(200)
    assert all(trend(sizes + leak).grows for sizes in noise[:5])
    # what fills once, and early, is no leak
    step = 50 * MIB * (np.arange(200) > 60)
    assert not any(trend(sizes + step).grows for sizes in noise[:5])


def test_little_growth_and_few_rounds_are_no_alarm() -> None:
    assert trend(range(30)) is None
    steadily = trend(np.linspace(0, LEAST, 200))
    assert steadily.p <= ALPHA and not steadily.grows


def test_memory_of_a_process_is_reported_and_judged() -> None:
    *rounds, last = growth_steps(4, FOREVER, scenes=1)
    assert [step.done for step in rounds] == [2, 2]
    assert rounds[-1].largest["MiB of memory"] > 10.0
    assert last.counts == {"processes with too few rounds to judge": 1}


# ------------------------------------------------------------------- rows and the page


def steps_of(count: int, faults: tuple[str, ...] = (), error: BaseException | None = None):
    for k in range(count):
        yield Step(10, {"a": 1}, {"b": float(k)}, faults if k == 0 else ())
    if error is not None:
        raise error


@pytest.mark.parametrize("error", [None, KeyboardInterrupt(), ValueError("a")])
@pytest.mark.parametrize("every", [0.0, 60.0])
def test_steps_add_up_in_rows_also_when_something_stops_them(error, every) -> None:
    rows = []
    try:
        for row in rows_of(steps_of(3, ("a hole",), error), "c", "things", every):
            rows.append(row)
    except BaseException as found:
        assert found is error
    found = sums_of(Table(tuple(rows)))
    assert (found.done, found.counts, found.largest) == (30, {"a": 3}, {"b": 2.0})
    assert found.faults == ["a hole"]
    assert len(rows) == (5 + 2 * 4 if every == 0.0 else 5)


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Store:
    """Return an empty one; each run is of a day and a commit of its own."""
    number = itertools.count(1)

    def circumstances(module, words):
        day = next(number)
        made = {"created": f"2026-01-{day:02}", "commit": f"c{day}"}
        return {**made, "command": "c", "machine": {}, "versions": {}}

    monkeypatch.setattr(runner, "circumstances", circumstances)
    return Store(tmp_path / "data", tmp_path / "measured")


def run(store: Store, monkeypatch, trial: soak.Trial) -> list[str]:
    monkeypatch.setattr(soak, "TRIALS", {"rays": trial})
    request = Request(store, ["soak"], cases=["rays"], budget=1.0, folder=store.folder)
    return run_study("soak", soak.STUDY, request, lambda stage: None)


def test_a_trial_goes_on_where_the_rows_end(store: Store, monkeypatch) -> None:
    """Each run does three steps of ten; the last stops at the aim, one more has no rows."""
    done_at = []

    def steps(so_far: Sums, deadline: float, folder: Path):
        done_at.append(so_far.done)
        return steps_of(3)

    trial = soak.Trial("things", 100, steps, {"a": 10})
    for _ in range(5):
        assert run(store, monkeypatch, trial) == []
    assert done_at == [0, 30, 60, 90]
    found = sums_of(store.everything("soak"))
    assert (found.done, found.counts["a"]) == (100, 10)
    behind = replace(trial, aims={"a": 11})
    assert trial.complete(found) and not behind.complete(found)


def test_an_interrupt_keeps_what_was_done(store: Store, monkeypatch) -> None:
    """And so does the repository, in one row of each sum."""
    trial = soak.Trial("things", 100, lambda *_: steps_of(2, (), KeyboardInterrupt()))
    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            run(store, monkeypatch, trial)
    before = sums_of(store.everything("soak"))
    assert before.done == 40
    assert store.keep("soak", goes_on=True) == "soak: 8 rows kept"
    assert sums_of(store.everything("soak")).done == 40  # not counted twice
    (store.folder / "soak.jsonl").unlink()
    assert sums_of(store.everything("soak")) == before


def test_kept_sums_are_those_of_all_rows_of_a_run(store: Store) -> None:
    lines = [Run(run="r", created="2026", command="c", commit="abc")]
    for number in (1.0, 2.0):
        for quantity in ("count", "largest"):
            lines.append(Row(case="c", quantity=quantity, value=number, run="r"))
        lines.append(Row(case="c", quantity="fault", value="a hole", run="r"))
    store.append("soak", [*lines, Done(done="c", run="r", seconds=1.0)])
    store.keep("soak", goes_on=True)
    (store.folder / "soak.jsonl").unlink()
    values = [row.value for row in store.everything("soak")]
    assert values == [3.0, 2.0, "a hole", "a hole"]


def test_faults_are_open_until_the_trial_goes_on_without_them(
    store: Store, monkeypatch, tmp_path: Path
) -> None:
    """On the card of the index, too: mended faults are no alarm."""
    (tmp_path / "soak.html").touch()
    study = replace(soak.STUDY, cases=("rays", "growth"))
    states = []
    for faults in ((), ("a <b> hole", "c"), ()):
        trial = soak.Trial("things", 10**9, lambda *_, found=faults: steps_of(1, found))
        assert len(run(store, monkeypatch, trial)) == len(faults)
        table = store.everything("soak")
        shown, page = soaked(study, table), soak_page("soak", study, table)
        states.append((shown.open, shown.mended))
        sign = "fail" if faults else "pass"
        assert f'class="banner {sign}"' in page
        index = index_page({"soak": (study, table)}, tmp_path)
        assert ("✗ 2 faults" in index) == bool(faults)
        assert f"{shown.open} faults open, {shown.mended} found and mended" in page
        assert "a <b> hole" not in page
    assert states == [(0, 0), (2, 0), (0, 2)]
    assert "a &lt;b&gt; hole" in page and page.count("unfinished, ") == 2


def test_equal_counts_of_a_kind_are_one_row() -> None:
    counts = {"rays: a": 5, "rays: b": 5, "rays: c": 6, "leaks": 5}
    expected = [("leaks", 5), ("rays, each of a, b", 5), ("rays: c", 6)]
    assert merged(counts) == expected


def test_the_repositorys_rows_have_the_totals_of_the_old_record() -> None:
    """Those that the page showed before trials had rows."""
    study = find_study("soak")
    every = Store(Path("nowhere")).everything("soak")
    old = [row for row in every if row.run.startswith("soak-")]
    shown = soaked(study, Table(tuple(old), every.runs, every.done))
    assert (shown.open, shown.mended, shown.unfinished) == (0, 27, ["rays", "growth"])
    found = {trial.name: trial for trial in shown.trials}
    assert found["rays"].sums.done == 15_001_190_400
    assert found["rays"].sums.counts["rays: octree"] == 1_000_079_360
    assert found["self-hits"].sums.counts["rays that left a surface"] == 57_262_207
    assert found["damaged-files"].sums.counts["refused"] == 703_355
    assert len(found["damaged-files"].sessions) == 11
    assert [len(one.sums.faults) for one in found["interrupts"].sessions[:3]] == [2, 1, 0]
    assert found["growth"].sums.largest["pictures of one process"] == 23644
    assert found["growth"].chart is not None
