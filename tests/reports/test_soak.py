"""The long trials in short: each finds nothing, and finds what is put in its way.

How many rays, files and interrupts the long runs did is in reports/measured/soak.json.
"""

from __future__ import annotations

import itertools
import json
import random
import subprocess
import sys
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reports.errors import ReportError
from reports.soak import command, interrupts, self_hits
from reports.soak.damage import formats, process
from reports.soak.damage.formats import DAMAGE
from reports.soak.damage.sound_files import SoundFile, sound_files
from reports.soak.damaged_files import Answer, Reader, damaged_file_steps
from reports.soak.growth import ALPHA, LEAST, MIB, trend
from reports.soak.page import soak_page
from reports.soak.rays import trial as rays
from reports.soak.rays.closed_meshes import ClosedMesh, Starts
from reports.soak.rays.making import rays_from_inside
from reports.soak.rays.rounding import certainty
from reports.soak.record import FAULTS_KEPT, Part, Session, Soak, Step, read_soak
from reports.soak.studies import STUDIES, Study

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
    lost = "lost within rounding of an edge, aimed at edges"
    assert sum(step.counts.get(lost, 0) for step in steps) > 0  # known, and not hidden


@pytest.mark.parametrize("kind", rays.KINDS)
@pytest.mark.parametrize(
    "structures",
    [
        pytest.param(("boxes",), id="boxes"),  # which asks for the renderer's own records
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
    """Brute force too, which is spared the large meshes; who has enough has no more."""
    monkeypatch.setattr(rays, "EACH", 128)
    large = next(turn for turn in range(999) if len(rays.combination(turn)[0].faces) > 400)
    part = Part(counts={rays.TURNS: large, "rays: bvh": 64})
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
    assert steps[0].largest


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
    assert "no triangle is near it" in step.faults[0]


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
    assert "times what rounding can do" in step.faults[0]


_TRIANGLES = {
    "like its neighbours": [(0, 0, 3), (1, 0.1, 3.2), (0.3, 0.9, 2.9)],
    "a needle": [(-1, 0, 5), (1, 0.001, 5), (0.9, 0.002, 5.001)],
    "at 10^4": [(1e4, 1e4, 1e4), (1e4 + 1, 1e4, 1e4 + 1), (1e4, 1e4 + 1, 1e4)],
    "edge on": [(0, 0.02, 1), (0.001, 0.02, 9), (-0.5, 0.02, 5)],
    "tiny": [(0, 0, 1), (1e-5, 0, 1), (0, 1e-5, 1.00001)],
}


@pytest.mark.parametrize("corners", _TRIANGLES.values(), ids=_TRIANGLES)
def test_what_is_certain_comes_true(corners) -> None:
    """Rays past the edges of one triangle, 40,960 each, as the renderer decides them."""
    vertices = np.array(corners, np.float32)
    away = 1e4 - 3.0 if vertices.max() > 1e3 else 0.0
    mesh = ClosedMesh("one", vertices, np.array([[0, 1, 2]]), Starts(0, 0.1, 1, away), 1)
    made = rays_from_inside(mesh, True, 0, 40_960)
    origin, direction, _ = (rows.astype(float) for rows in made.rows())
    sure = certainty(mesh, origin, direction)
    hit = rays._met("brute", mesh, rays.make_query("random", made))
    assert hit[sure > 1.0].all() and not hit[sure < -1.0].any()
    assert np.mean(np.abs(sure) > 1.0) > 0.02  # rays pass at most 0.01 edges away


def test_a_tenth_of_the_bound_would_be_too_little() -> None:
    """It is not so wide that it would hide a leak."""
    step = rays.traced(("wide",), 1, 100_000)
    assert 0.1 < step.largest[rays.FARTHEST_LOST] < 1.0


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
    assert process.outcome(folder, sound, sound.content) == (process.PICTURE, "")
    found = Counter()
    for seed in range(12):
        damaged = DAMAGE[Path(sound.name).suffix](random.Random(seed), sound.content)
        outcome, fault = process.outcome(folder, sound, damaged)
        assert fault == "", (seed, outcome)
        found[outcome] += 1
    assert found[process.REFUSED]


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

    monkeypatch.setattr(process, "_rendered", fail)
    found, fault = process.outcome(folder, FORMATS[0], b"")
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
    monkeypatch.setattr("reports.soak.damaged_files.SECONDS", 0.3)
    monkeypatch.setattr("reports.soak.damaged_files.WAITING", 2.0)
    with Reader() as reader:
        (found,) = reader.answers([0])
    assert found.fault and found.outcome == outcome.replace("10", "0.3")
    assert len(started) == (2 if "more" in outcome else 1)  # too slow: tried once more


def test_others_are_asked_again_where_a_file_ends_the_process(monkeypatch) -> None:
    """Each number has one answer; several are in the pipe when 3 and 4 end a process."""
    program = """if True:
        import os, sys
        print("ready", flush=True)
        for line in sys.stdin:
            if line.strip() in ("3", "4"):
                os.abort()
            seconds = 5.0 if line.strip() == "6" and os.path.exists(sys.argv[1]) else 0.0
            if seconds:
                os.remove(sys.argv[1])
            print(f'[{int(line)}, "{line.strip()}", "", {seconds}]', flush=True)
        """
    start, started = subprocess.Popen, []

    def popen(words, **given):
        started.append(words)
        return start([sys.executable, "-c", program, str(slow)], **given)

    monkeypatch.setattr(subprocess, "Popen", popen)
    monkeypatch.setattr("reports.soak.damaged_files.SECONDS", 4.0)
    with Reader() as reader:
        slow = Path(reader._folder.name) / "slow"
        slow.touch()  # number 6 is slow the first time
        found = list(reader.answers(range(9)))
        more = list(reader.answers(range(10, 29)))  # nothing was asked twice
        more += list(reader.answers(range(50, 60)))
    numbers = [*range(10, 29), *range(50, 60)]
    assert [one.outcome for one in more] == list(map(str, numbers))
    died = "the process died"
    assert [one.outcome for one in found] == [*"012", died, died, *"5678"]
    assert [one.fault for one in found if one.fault] == [f"{died}: status -6"] * 2
    assert len(started) == 4


def test_a_failing_file_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def answers(self: Reader, numbers: range) -> Iterator[Answer]:
        return (Answer("died", "died" if k == 7 else "", 0.0) for k in numbers)

    monkeypatch.setattr(Reader, "answers", answers)
    (step,) = first(damaged_file_steps(5, FOREVER, tmp_path, 4), 1)
    sound, content = process.damaged(7)
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
        (["a.npy", "a.npy.tmp"], 130, "", "a file besides the picture"),
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


# ------------------------------------------------------------------- record and command


def counted(name: str, done_at: list[int], faults: tuple[str, ...] = ()) -> Study:
    def steps(part: Part, deadline: float) -> Iterator[Step]:
        done_at.append(part.done)
        for _ in range(3):
            yield Step(10, {"a": 1}, {"b": float(part.done)}, faults)

    return Study(name, name.title(), "things", 100, "About it.", steps)


def test_a_run_goes_on_where_the_record_was(tmp_path: Path, monkeypatch, capsys) -> None:
    done_at: list[int] = []
    monkeypatch.setattr(command, "STUDIES", (counted("rays", done_at),))
    monkeypatch.setattr("reports.soak.page.STUDIES", command.STUDIES)
    words = ["--record", str(tmp_path / "soak.json"), "--out", str(tmp_path)]
    for _ in range(5):
        assert command.main(words) == 0
    soak = read_soak(tmp_path / "soak.json")
    part = soak.parts["rays"]
    assert done_at == [0, 30, 60, 90]  # the fifth run finds all done
    assert part.done == 100
    assert part.counts == {"a": 10} and part.largest == {"b": 90.0}
    assert [one.done for one in part.sessions] == [30, 30, 30, 10]
    assert {one.commit for one in part.sessions} == {soak.commit}
    assert "Rays" in (tmp_path / "soak.html").read_text()
    assert "100 things, no fault" in capsys.readouterr().out


def test_a_trial_is_complete_when_each_of_its_counts_is() -> None:
    study = replace(counted("rays", []), wanted_of={"a": 5, "b": 5})
    assert not study.complete(Part(done=100, counts={"a": 9}))
    assert not study.complete(Part(done=99, counts={"a": 9, "b": 5}))
    assert study.complete(Part(done=100, counts={"a": 9, "b": 5}))


def test_a_fault_is_status_1_and_on_the_page(tmp_path: Path, monkeypatch) -> None:
    """Once: the next run that finds none is status 0, and the page still tells of it."""
    words = ["--record", str(tmp_path / "soak.json"), "--out", str(tmp_path)]
    for faults, status in ((("a <b> hole",), 1), ((), 0)):
        study = counted("rays", [], faults)
        monkeypatch.setattr(command, "STUDIES", (study,))
        monkeypatch.setattr("reports.soak.page.STUDIES", (study,))
        assert command.main(words) == status
        assert "a &lt;b&gt; hole" in (tmp_path / "soak.html").read_text()


def test_faults_are_open_until_the_trial_goes_on_without_them() -> None:
    """The banner counts those of each trial's last session, the others are mended."""
    begun = (
        Part()
        .begun(Session("2026", "c0ffee", "cpu"))
        .after(Step(9, faults=("a", "b")), 1.0)
    )
    gone_on = begun.begun(Session("2027", "c0ffee", "cpu")).after(Step(9), 1.0)
    for part, banner in (
        (Part(), '"banner pass">✓ 0 faults open, 0 found and mended'),
        (begun, '"banner fail">✗ 2 faults open, 0 found and mended'),
        (gone_on, '"banner pass">✓ 0 faults open, 2 found and mended'),
    ):
        assert banner in soak_page(Soak(parts={STUDIES[0].name: part}))


def test_a_record_has_no_paths_of_the_machine(tmp_path: Path, monkeypatch) -> None:
    """Faults quote tracebacks, and the command says where its files are."""
    study = counted("rays", [], ('File "/a/b/.venv/lib/c.py", line 3',))
    monkeypatch.setattr(command, "STUDIES", (study,))
    monkeypatch.setattr("reports.soak.page.STUDIES", (study,))
    command.main(["--record", str(tmp_path / "soak.json"), "--out", str(tmp_path)])
    soak = read_soak(tmp_path / "soak.json")
    assert soak.parts["rays"].faults[0] == 'File ".venv/lib/c.py", line 3'
    assert str(tmp_path.parent) not in soak.command and "soak.json" in soak.command


def test_an_interrupt_keeps_what_was_done(tmp_path: Path, monkeypatch) -> None:
    def steps(part: Part, deadline: float):
        yield Step(10)
        raise KeyboardInterrupt

    study = Study("rays", "Rays", "things", 100, "About it.", steps)
    monkeypatch.setattr(command, "STUDIES", (study,))
    words = ["--record", str(tmp_path / "soak.json"), "--out", str(tmp_path)]
    assert command.main(words) == 130
    assert read_soak(tmp_path / "soak.json").parts["rays"].done == 10


def test_a_damaged_record_is_one_line(tmp_path: Path, capsys) -> None:
    (tmp_path / "soak.json").write_text('{"schema": 1, "parts": {"rays": 3}}')
    words = ["--record", str(tmp_path / "soak.json"), "--out", str(tmp_path)]
    assert command.main(words) == 2
    assert "soak.json: parts.rays: expected `object`, found 3" in capsys.readouterr().err
    with pytest.raises(ReportError):
        read_soak(tmp_path / "soak.json")


def test_many_faults_are_all_counted_and_the_first_kept() -> None:
    part = Part().begun(Session("now", "abc", "cpu"))
    for k in range(30):
        part = part.after(Step(1, faults=(f"{k}a", f"{k}b")), 0.5)
    assert part.fault_count == part.sessions[0].faults == 60
    assert len(part.faults) == FAULTS_KEPT and part.faults[0] == "0a"
    assert part.sessions[0].seconds == 15.0
    assert Soak(parts={"a": part}).fault_count == 60


def test_the_repositorys_record_is_of_todays_trials() -> None:
    path = command.MEASURED / "soak.json"
    soak = read_soak(path)
    assert set(soak.parts) == {study.name for study in STUDIES}
    assert all(part.sessions and part.done for part in soak.parts.values())
    assert len(json.dumps(path.read_text())) < 200_000
