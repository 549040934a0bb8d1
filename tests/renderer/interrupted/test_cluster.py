"""Renders on a cluster: the bits of one process, whichever worker is lost."""

from __future__ import annotations

import dataclasses
import os
import pickle
import random
import signal
import sys
import threading
from collections import OrderedDict
from contextlib import contextmanager
from pathlib import Path

import dask
import numpy as np
import pytest
from distributed import Client, LocalCluster, WorkerPlugin, get_worker

import renderer
from renderer.command import cli
from renderer.errors import ClusterError, NotAllowed, SceneError
from renderer.process import memory
from renderer.rendering import memory_estimate
from renderer.rendering.cluster import connect, source, worker
from renderer.rendering.cluster.portions import Portions
from renderer.rendering.cluster.source import ClusterTiles, ClusterWorkers
from renderer.rendering.cluster.worker import LEAST, PluginFiles, freeze, import_sent, thaw
from renderer.rendering.job import RenderJob
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.render_options import RenderOptions
from renderer.scene_file import plugins as plugin_file

BOX = Path(__file__).parents[3] / "scenes" / "cornell-box" / "scene.xml"


def load(**parameters):
    return renderer.load_file(BOX, **{"width": 72, "height": 48} | parameters)


def prepared(spp=40):
    scene = load()
    job = RenderJob(scene, make_plan(scene, spp=spp), RenderOptions(seed=3, threads=1))
    return job, job.make_film()


@contextmanager
def threads_of_dask(workers):
    """Give a client of workers that are threads of this process, started at once."""
    with (
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=False,
            dashboard_address="127.0.0.1:0",
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        yield client


@pytest.fixture(scope="module")
def local():
    with threads_of_dask(2) as client:
        yield client


@pytest.fixture(scope="module")
def alone():
    """The picture made by threads."""
    return np.asarray(renderer.render(load(), 40, seed=3, threads=2))


# Samples of each pixel: something is left to do when this process first looks at what came
# in, also where it waits for a processor meanwhile.
MANY = 800


@pytest.fixture(scope="module")
def alone_for_long():
    """The picture of many samples, made by threads."""
    return np.asarray(renderer.render(load(), MANY, seed=3, threads=2))


# ----------------------------------------------------------------- what is sent, dealt out


def test_a_scene_is_sent_by_its_content():
    """Small arrays within, large ones once each; types and writability stay."""
    large, fixed = np.arange(LEAST, dtype=np.float32), np.arange(LEAST, dtype=np.int64)
    fixed.setflags(write=False)
    content = freeze({"a": large, "same": large, "equal": large.copy(), "fixed": fixed})
    assert len(content.pieces) == 3  # the skeleton, and two contents
    there = thaw(content.names, list(content.pieces.values()))
    assert there["a"] is there["same"] and there["a"].flags.writeable
    assert not there["fixed"].flags.writeable
    np.testing.assert_array_equal(there["equal"], large)
    np.testing.assert_array_equal(there["fixed"], fixed)
    changed = freeze({"a": large + 1, "same": large, "equal": large, "fixed": fixed})
    assert changed.key != content.key == freeze(there).key


@pytest.mark.parametrize("seed", range(4))
def test_no_bit_depends_on_who_does_what(seed, alone):
    """Portions of any size, answered in any order, some only at the second time."""
    rng = random.Random(seed)
    job, film = prepared()
    content = worker.request_of(job)
    portions = Portions(film, film.work.samples(40))
    out = []
    while out or portions.waiting:
        while portions.waiting and (not out or rng.random() < 0.6):
            portion = portions.take(10.0 ** rng.uniform(0, 5))
            out.append((portion, portions.sums(portion)))
        portion, sums = out.pop(rng.randrange(len(out)))
        arguments = (content.key, content.names, portion, sums, *content.pieces.values())
        answers = [worker.add_samples(*arguments)[0] for _ in range(rng.choice([1, 2]))]
        portions.add(portion, answers[-1])
    assert portions.missing == 0 and film.samples_done == film.pixels * 40
    np.testing.assert_array_equal(film.develop(), alone)


def test_an_interrupted_picture_has_no_holes():
    """Every place gets a first part before any gets its second."""
    _, film = prepared(spp=400)
    portions = Portions(film, film.work.samples(400))
    first = [portions.take(1.0) for _ in range(film.work.places)]
    assert sorted(p.places[0] for p in first) == list(range(film.work.places))
    assert all(p.begins == (0,) and p.ends == (film.work.part,) for p in first)
    assert not portions.waiting


# ------------------------------------------------------------------------- on a cluster


def test_the_picture_is_that_of_one_process(local, alone):
    """The scene goes out once for both workers, and sums come back."""
    notes = []
    image = renderer.render(
        load(), 40, seed=3, cluster=local, progress=lambda now: notes.append(now.cluster)
    )
    assert image.complete
    np.testing.assert_array_equal(np.asarray(image), alone)
    assert "2 workers" in notes[-1] and "MB sent" in notes[-1]


def test_goals_and_colours_beside_aovs(local):
    """Several jobs one after the other: halves of samples, then a second rendering."""
    goal = {"target_error": 0.2, "seed": 3}
    here, there = (renderer.render(load(), **goal, cluster=c) for c in (None, local))
    assert here.spp == there.spp
    np.testing.assert_array_equal(np.asarray(here), np.asarray(there))
    scene = renderer.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "aov", "aovs": "d:depth", "img": {"type": "direct"}},
            "sensor": {"type": "perspective", "film": {"type": "hdrfilm", "width": 40}},
            "ball": {"type": "sphere", "center": [0, 0, 4]},
            "sky": {"type": "constant"},
        }
    )
    here, there = (renderer.render(scene, 4, cluster=c) for c in (None, local))
    np.testing.assert_array_equal(np.asarray(here), np.asarray(there))
    np.testing.assert_array_equal(here.aovs["d"], there.aovs["d"])


def test_an_interrupt_keeps_what_came_in_and_resumes_anywhere(
    local, alone_for_long, tmp_path
):
    def progress(now):
        if now.stage == "render" and now.done:
            raise KeyboardInterrupt

    kept = {"checkpoint": tmp_path / "box.ckpt", "seed": 3}
    image = renderer.render(load(), MANY, cluster=local, progress=progress, **kept)
    assert not image.complete and "interrupted" in image.metadata
    seen = []
    image = renderer.render(
        load(), MANY, cluster=local, resume=True, progress=seen.append, **kept
    )
    assert 0 < seen[0].done < seen[0].total
    np.testing.assert_array_equal(np.asarray(image), alone_for_long)


def test_frames_of_a_sweep_are_begun_ahead(local):
    widths = [40, 41, 42, 43, 44]
    images = list(
        renderer.render_frames((load(width=w) for w in widths), spp=17, cluster=local)
    )
    for width, image in zip(widths, images, strict=True):
        alone = renderer.render(load(width=width), 17)
        np.testing.assert_array_equal(np.asarray(image), np.asarray(alone))


def test_frames_under_way_are_kept_when_a_later_one_cannot_be_read(local):
    def scenes():
        yield load(width=40)
        yield load(width=41)
        raise SceneError("the third is damaged")

    images = renderer.render_frames(scenes(), spp=2, cluster=local)
    assert [next(images).width for _ in range(2)] == [40, 41]
    with pytest.raises(SceneError, match="the third is damaged"):
        next(images)


@pytest.mark.parametrize(
    ("changed", "error", "said"),
    [
        ({"lightproof": "0.0.9 (abc)"}, 0.0, "another lightproof (0.0.9 (abc), here"),
        ({"Numba": "0.1", "processor": "z80"}, 0.0, ""),
        ({"Numba": "0.1"}, 1e-12, "its sums are not ours, nor is its Numba (0.1, here"),
    ],
)
def test_a_worker_that_is_not_like_us_is_refused_or_proved_equal(
    local, alone, monkeypatch, changed, error, said
):
    """Other sources: never. Another Numba: if tiles of this scene have our bits."""
    monkeypatch.setattr(worker, "made_by", lambda: source.made_by() | changed)
    add_samples = worker.add_samples

    def theirs(*arguments):
        sums, seconds = add_samples(*arguments)
        return sums + error, seconds

    monkeypatch.setattr(worker, "add_samples", theirs)
    team = ClusterWorkers(local)
    if said:
        with pytest.raises(ClusterError, match="none of the cluster's 2 workers may work"):
            renderer.render(load(), 40, seed=3, cluster=team)
        assert all(said in why for why in team.tally.refused.values())
        assert len(team.tally.refused) == 2
    else:
        image = renderer.render(load(), 40, seed=3, cluster=team)
        np.testing.assert_array_equal(np.asarray(image), alone)
        assert len(team.tally.shown_equal) == 2
        assert all("processor (z80, here" in d for d in team.tally.shown_equal.values())


def test_a_portion_that_always_fails_ends_the_render_in_one_line(local, monkeypatch):
    def broken(*arguments):
        raise RuntimeError("the disk\nis gone")

    monkeypatch.setattr(worker, "add_samples", broken)
    with pytest.raises(ClusterError, match=r"^RuntimeError: the disk is gone$"):
        renderer.render(load(), 40, cluster=local)


def test_a_worker_that_cannot_read_the_scene_is_refused(local, alone, monkeypatch):
    """One of two: the other one does all. Both: one line, and the picture if there is."""
    prepared, everybody = worker._prepared, list(local.scheduler_info()["workers"])
    broken = {everybody[0]}

    def reading(*arguments):
        if get_worker().address in broken:
            raise SceneError("plugin.py: no such module")
        return prepared(*arguments)

    monkeypatch.setattr(worker, "_prepared", reading)
    team = ClusterWorkers(local)
    image = renderer.render(load(), 40, seed=3, cluster=team)
    assert image.complete
    np.testing.assert_array_equal(np.asarray(image), alone)
    assert team.tally.refused == dict.fromkeys(broken, "plugin.py: no such module")
    broken.update(everybody)
    with pytest.raises(ClusterError, match=r"may work: \S+: plugin\.py: no such module$"):
        renderer.render(load(), 40, cluster=ClusterWorkers(local))


def test_workers_without_memory_are_refused_with_numbers(local, monkeypatch):
    """Before they build anything; the client has enough."""
    room = memory.room

    def room_there():
        try:
            return 64 << 10 if get_worker() else 0
        except ValueError:  # here is none
            return room()

    monkeypatch.setattr(worker, "_ready", OrderedDict())
    monkeypatch.setattr(worker, "RenderJob", None)
    monkeypatch.setattr(memory, "room", room_there)
    said = (
        r"may work: \S+: .*rendering takes about \d.* of memory more .*; this machine "
        r"has 64 KiB free; possible: a worker with more memory"
    )
    with pytest.raises(ClusterError, match=said):
        renderer.render(load(), 40, seed=3, cluster=local)


def test_workers_on_this_machine_share_its_memory(local, monkeypatch):
    """Each would find the same memory free; too many do not even start."""
    monkeypatch.setattr(memory, "room", lambda: 500 << 20)
    monkeypatch.setattr("distributed.LocalCluster", None)
    with pytest.raises(NotAllowed, match="local:4: a process for each takes about 640 MiB"):
        with connect.open_cluster("local:4"):
            pass
    renderer.render(load(), 1, cluster=ClusterWorkers(local, 2))
    with pytest.raises(NotAllowed, match=r"takes about 6\d\d MiB .*fewer than 4 workers"):
        renderer.render(load(), 1, cluster=ClusterWorkers(local, 4))


def test_an_error_of_ours_keeps_the_picture(local, monkeypatch):
    add, added = Portions.add, []

    def failing(self, portion, sums):
        if added:
            raise ValueError("a bug")
        added.append(portion)
        add(self, portion, sums)

    monkeypatch.setattr(Portions, "add", failing)
    image = renderer.render(load(), 40, cluster=local)
    assert not image.complete
    assert image.metadata["interrupted"].endswith("samples: ValueError: a bug")


def test_a_scheduler_that_goes_away_costs_nothing(alone_for_long, tmp_path):
    kept = {"checkpoint": tmp_path / "box.ckpt", "seed": 3}
    # Dask's own cluster looks for its scheduler so long when it is closed
    soon = dask.config.set({"distributed.comm.timeouts.connect": "1s"})
    with soon, threads_of_dask(1) as client:
        gone = []

        def progress(now):
            if now.done and not gone:
                gone.append(now.done)
                client.cluster.sync(client.cluster.scheduler.close)

        image = renderer.render(load(), MANY, cluster=client, progress=progress, **kept)
    assert gone and not image.complete
    assert "the scheduler at" in image.metadata["interrupted"]
    image = renderer.render(load(), MANY, resume=True, **kept)
    np.testing.assert_array_equal(np.asarray(image), alone_for_long)


@pytest.mark.parametrize(
    ("workers", "kills"), [(1, 1), pytest.param(2, 8, marks=pytest.mark.slow)]
)
def test_killed_workers_cost_nothing_but_time(workers, kills, alone_for_long):
    """SIGKILL at any time; Dask starts another one, and its portions are done again."""
    with connect.open_cluster(f"local:{workers}") as team:
        pids = list(team.client.run(os.getpid).values())
        rng, killed = random.Random(1), []

        def progress(now):
            if now.done and len(killed) < kills and (not killed or rng.random() < 0.1):
                if len(killed) >= len(pids):
                    pids[:] = [*pids, *team.client.run(os.getpid).values()]
                victim = rng.choice(pids[-workers:])
                killed.append(victim)
                try:
                    os.kill(victim, signal.SIGKILL)
                except ProcessLookupError:
                    pass

        image = renderer.render(load(), MANY, seed=3, cluster=team, progress=progress)
    assert image.complete, image.metadata
    np.testing.assert_array_equal(np.asarray(image), alone_for_long)
    assert killed and team.tally.lost


def test_a_portion_that_kills_its_workers_ends_the_render(
    local, alone, monkeypatch, tmp_path
):
    """It is named, and the others are kept; here its workers are only said to be lost."""
    task, look = ClusterTiles._task, ClusterTiles._look_around

    def never(self, call, *arguments, workers, **how):
        if call is worker.add_samples and 0 in arguments[0].places:
            workers = ["tcp://127.0.0.1:1"]  # where none is
        return task(self, call, *arguments, workers=workers, **how)

    def look_and_lose(self):
        look(self)
        for future, (portion, _) in list(self._out.items()):
            if 0 in portion.places:
                self._give_back(future)

    monkeypatch.setattr(ClusterTiles, "_task", never)
    monkeypatch.setattr(ClusterTiles, "_look_around", look_and_lose)
    kept = {"checkpoint": tmp_path / "box.ckpt", "seed": 3}
    image = renderer.render(load(), 40, cluster=ClusterWorkers(local), **kept)
    assert not image.complete and source.MOST_DEATHS == 10
    assert image.metadata["interrupted"].endswith(
        "samples: 10 workers died one after the other at the same piece of work, the tile "
        "at pixel (0, 0), samples 0 to 15; their logs may say why, such as a lack of memory"
    )
    image = renderer.render(load(), 40, resume=True, **kept)
    np.testing.assert_array_equal(np.asarray(image), alone)


@pytest.mark.slow  # a process for each death
def test_processes_that_die_at_a_portion_are_counted(monkeypatch):
    class Killing(WorkerPlugin):
        def setup(self, worker):
            from renderer.rendering.cluster import worker as work

            add_samples = work.add_samples

            def die(key, names, portion, *arguments):
                if 0 in portion.places:
                    os.kill(os.getpid(), signal.SIGKILL)
                return add_samples(key, names, portion, *arguments)

            work.add_samples = die

    monkeypatch.setattr(source, "MOST_DEATHS", 2)
    with connect.open_cluster("local:1") as team:
        team.client.register_plugin(Killing())
        with pytest.raises(ClusterError, match=r"2 workers died .* the tile at pixel"):
            renderer.render(load(), 40, cluster=team)


def test_a_worker_without_memory_is_asked_again(local, alone, monkeypatch):
    """It is refused, and works when there is memory, in the same render."""
    prepared, poor = worker._prepared, next(iter(local.scheduler_info()["workers"]))
    refused, late = [], threading.Event()
    team = ClusterWorkers(local)

    def reading(*arguments):
        if get_worker().address != poor:
            late.wait(20)  # the render lasts until the other one has done something
        elif not refused:
            refused.append(poor)
            raise NotAllowed("takes about 9 GiB of memory more")
        else:
            late.set()
        return prepared(*arguments)

    monkeypatch.setattr(worker, "_prepared", reading)
    monkeypatch.setattr(source, "AGAIN", 0.1)
    monkeypatch.setattr(source, "LOOK", 0.02)
    image = renderer.render(load(), 40, seed=3, cluster=team)
    np.testing.assert_array_equal(np.asarray(image), alone)
    assert refused and late.is_set() and not team.tally.refused


def test_kernels_that_a_process_has_are_not_counted_again(local, monkeypatch):
    scene = load()
    plan = make_plan(scene, spp=1)
    for loaded, size in ((False, 150 << 20), (True, 0)):
        monkeypatch.setattr(memory_estimate, "_loaded", loaded)
        found = memory_estimate.estimate_workers(scene, plan, RenderOptions(threads=1))
        assert found.parts["the kernels"] == size
    team, needed = ClusterWorkers(local, 2), []
    check = source.check_room
    monkeypatch.setattr(
        source, "check_room", lambda found, *why: (needed.append(found), check(found, *why))
    )
    for _ in range(2):
        renderer.render(scene, 1, cluster=team)
    first, second = (found.parts["the kernels"] for found in needed)
    assert first == 2 * 150 << 20 and second == 0


# ------------------------------------------------------------------------ the command line


def test_a_sweep_resumes_frame_by_frame(local, monkeypatch, tmp_path, capsys):
    class Open:
        def __init__(self, where):
            assert where == "local:2"

        def __enter__(self):
            return ClusterWorkers(local)

        def __exit__(self, *error):
            pass

    monkeypatch.setattr(connect, "open_cluster", Open)
    size = ["-D", "height=24", "-D", "width={30+frame*2}", "--spp", "5"]
    sweep = [str(BOX), *size, "--frames", "8:14:2", "-o", str(tmp_path / "b_###.exr")]
    assert cli.main([*sweep, "--cluster", "local:2"]) == 0
    names = ["b_008.exr", "b_010.exr", "b_012.exr"]
    assert sorted(path.name for path in tmp_path.glob("*.exr")) == names
    made = {name: (tmp_path / name).read_bytes() for name in names}
    (tmp_path / names[1]).unlink()
    assert cli.main([*sweep, "--resume"]) == 0  # by threads, and to the same files
    assert {name: (tmp_path / name).read_bytes() for name in names} == made
    assert "2 frames were there" in capsys.readouterr().err
    single = tmp_path / "one.exr"
    size[3] = "width=50"
    assert cli.main([str(BOX), *size, "-o", str(single)]) == 0
    assert single.read_bytes() == made["b_010.exr"]


def test_a_frame_of_a_sweep_that_was_not_finished_counts_as_none(tmp_path, monkeypatch):
    """Nor one that was, then written anew and interrupted, nor one with another goal."""
    sweep = [str(BOX), "-D", "height=24", "-D", "width={30+frame*2}", "--spp", "8"]
    sweep += ["--frames", "0:2", "--quiet", "-o", str(tmp_path / "b_#.exr")]
    assert cli.main(sweep) == 0
    made = [(tmp_path / f"b_{k}.exr").read_bytes() for k in range(2)]
    render_frames = renderer.render_frames

    def interrupted(*arguments, **options):
        image = next(render_frames(*arguments, **options))
        metadata = {**image.metadata, "interrupted": "after 3 samples"}
        yield dataclasses.replace(image, complete=False, metadata=metadata)

    with monkeypatch.context() as context:
        context.setattr(renderer, "render_frames", interrupted)
        assert cli.main(sweep) == 1
    assert (tmp_path / "b_0.exr").read_bytes() != made[0]
    (tmp_path / "b_1.exr").write_bytes(b"still there")
    assert cli.main([*sweep, "--resume"]) == 0
    assert (tmp_path / "b_0.exr").read_bytes() == made[0]
    assert (tmp_path / "b_1.exr").read_bytes() == b"still there"
    assert cli.main([*sweep, "--resume", "--target-error", "90%"]) == 0
    assert (tmp_path / "b_1.exr").read_bytes() != b"still there"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--cluster", "local:none"], "local:N starts N processes"),
        (["--cluster", "8786"], "neither local:N nor an address"),
        (["--frames", "3"], "not of the form FIRST:END"),
        (["--frames", "3:3"], "0 frames"),
        (["--frames", "0:2", "--explain"], "--explain is of one picture"),
        (["--frames", "0:2", "-o", "a.png"], "all frames would have one name"),
        (["--frames", "0:2", "-o", "a_{i}.png"], "possible places for a"),
        (["--frames", "0:2", "-o", "a{frame.real}.png"], "possible places for a"),
        (["--frames", "10:12", "-o", "a{frame:.0e}.png"], "possible places for a"),
        (["--frames", "0:2", "-o", "a{frame:c}.png"], "possible places for a"),
        (["--frames", "0:2", "-D", "w={1" + "0" * 400 + "}"], "possible are"),
        (["--frames", "0:2", "-D", "w={" + "-" * 9000 + "1}"], "possible are"),
        (["--frames", "0:2", "-D", "width={1+(2}"], "is no formula"),
        (["--frames", "0:2", "-D", "width={2**9}"], "possible are numbers, frame, + - * /"),
        (["--frames", "0:2", "-D", "width={1/frame}"], "possible are numbers, frame"),
        (["--frames", "0:2", "-D", "width={__import__('os')}"], "is no number"),
    ],
)
def test_what_a_sweep_or_cluster_cannot_be(arguments, said, capsys):
    assert cli.main([str(BOX), *arguments]) in (1, 2)
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1


def test_without_dask_it_is_one_sentence(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ClusterError, match=r"pip install 'lightproof\[cluster\]'"):
        renderer.render(load(), 1, cluster=object())


def test_what_is_no_cluster(local):
    with pytest.raises(TypeError, match=r"possible is a distributed\.Client"):
        renderer.render(load(), 1, cluster="tcp://host:8786")
    with pytest.raises(ClusterError, match="a replay of Mitsuba's random numbers"):
        renderer.render(load(), 1, sampler="mitsuba", cluster=local)
    with pytest.raises(SceneError, match="a checkpoint is of one picture"):
        next(renderer.render_frames([load()], checkpoint="a.ckpt"))


def test_a_file_of_plugins_goes_along_by_its_content(monkeypatch, tmp_path):
    """On the worker it is imported before the scene is read, from a folder of its own."""
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    (here / "sent_plugin.py").write_text("import beside_it\nVALUE = beside_it.VALUE\n")
    (here / "beside_it.py").write_text("VALUE = 7\n")
    monkeypatch.setattr(plugin_file, "imported", [])
    plugin_file.import_plugin_file(str(here / "sent_plugin.py"))
    sent = pickle.dumps((PluginFiles(), "a record of its classes"))
    pickle.loads(sent)
    assert len(plugin_file.imported) == 1  # the sender has it
    plugin_file.imported.clear()
    monkeypatch.setenv("LIGHTPROOF_CACHE", str(there))
    pickle.loads(sent)
    (found,) = plugin_file.imported
    assert found.startswith(str(there)) and found.endswith("sent_plugin.py")
    assert Path(found).with_name("beside_it.py").read_text() == "VALUE = 7\n"


@pytest.mark.parametrize("edited", ["edited_plugin.py", "beside_edited.py"])
def test_plugins_that_were_edited_need_new_workers(monkeypatch, tmp_path, edited):
    """A worker has the modules of before, which Python would take instead."""
    for module in ("lightproof_plugins_edited_plugin", "beside_edited"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    monkeypatch.setattr(plugin_file, "imported", [])
    monkeypatch.setenv("LIGHTPROOF_CACHE", str(tmp_path))
    files = {"edited_plugin.py": b"import beside_edited\n", "beside_edited.py": b"A = 1\n"}
    import_sent((tuple(files.items()),))
    import_sent((tuple(files.items()),))  # it has these
    again = tuple((files | {edited: files[edited] + b"B = 2\n"}).items())
    with pytest.raises(SceneError, match=f"^{edited} is not what .*; restart the workers$"):
        import_sent((again,))
