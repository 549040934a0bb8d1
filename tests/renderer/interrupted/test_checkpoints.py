"""Renders that end before their end and go on: the same bits, or one sentence why not."""

from __future__ import annotations

import dataclasses
import errno
import io
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import renderer
from renderer.command.cli import main
from renderer.errors import CheckpointWarning, SceneError
from renderer.plugins.bsdfs.registry import BSDFS
from renderer.process import worker_pool
from renderer.rendering.checkpoints import checkpoint as checkpoint_module
from renderer.rendering.checkpoints import file as checkpoint_file
from renderer.rendering.checkpoints import identity
from renderer.rendering.checkpoints.file import older, read_checkpoint
from renderer.rendering.checkpoints.identity import content_digest
from renderer.rendering.goal import Halves
from renderer.rendering.job import RenderJob
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.progress_display import Progress, ProgressDisplay
from renderer.rendering.render_loop import RenderLoop
from renderer.rendering.render_options import RenderOptions
from renderer.scene.scene import build_scene
from renderer.scene_file.description import Mesh, OtherBsdf

ROOT = Path(__file__).parents[3]
SCENES = ROOT / "scenes"
CORNELL = SCENES / "cornell-box" / "scene.xml"


@pytest.fixture(scope="module")
def box():
    return renderer.load_file(CORNELL, width=48, height=48)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.ckpt"


@pytest.fixture(autouse=True)
def _looking_often(monkeypatch):
    """Let a render ask a thousand times a second whether it is time for a checkpoint."""
    monkeypatch.setattr(worker_pool, "WAKE", 1e-3)


def in_sittings(scene, path, **settings):
    """Render with an interrupt in each sitting, after a tenth of the samples or more.

    Threads wait for it after each job, so that it comes on the fastest machine too.
    """
    add, latest, firsts = RenderJob.add_samples, [], []

    def is_enough(now, done):
        return 0.1 * now.total <= done - now.resumed < now.total - now.resumed

    def add_and_wait(self, film, place, end, thread):
        add(self, film, place, end, thread)
        for _ in range(50):  # not for ever: it may be stopped for a checkpoint instead
            if latest and is_enough(latest[-1], film.samples_done):
                time.sleep(1e-3)

    def progress(now):
        if now.stage != "render":
            return
        latest.append(now)
        if is_enough(now, now.done):
            firsts.append(latest[0])
            latest.clear()
            raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as context:
        context.setattr(RenderJob, "add_samples", add_and_wait)
        for sitting in range(100):
            image = renderer.render(
                scene,
                threads=1 + sitting % 3,
                progress=progress,
                checkpoint=path,
                checkpoint_every=0.01,
                resume=sitting > 0,
                **settings,
            )
            if image.complete:
                break
    assert firsts[0].resumed == 0
    assert all(first.done == first.resumed > 0 for first in firsts[1:])
    return image, sitting + 1


def same(image, whole):
    """The resumed picture is the unbroken one, bit for bit, and says the same of itself."""
    assert image.spp == whole.spp
    assert image.metadata == whole.metadata
    same_bits("the picture", image.pixels, whole.pixels)
    assert image.aovs.keys() == whole.aovs.keys()
    for name, values in whole.aovs.items():
        same_bits(f"AOV {name}", image.aovs[name], values)


def same_bits(what, resumed, unbroken):
    np.testing.assert_array_equal(
        resumed, unbroken, f"{what} is not that of a render without interruption"
    )


# ---------------------------------------------------------------------- the same bits


@pytest.mark.parametrize("sampler", ["independent", "sobol", "multijitter", "mitsuba"])
def test_a_render_in_sittings_is_the_same_picture(box, path, sampler):
    """Of `mitsuba` each pixel's stream of numbers goes on, too."""
    whole = renderer.render(box, 128, sampler=sampler)
    image, sittings = in_sittings(box, path, spp=128, sampler=sampler)
    assert sittings > 1
    same(image, whole)


@pytest.mark.parametrize("sampler", ["independent", "mitsuba"])
def test_more_samples_later_are_the_picture_made_at_once(box, path, sampler):
    """Counts that end within a part of 16 samples; the last is not more than before."""
    for k, spp in enumerate((3, 40, 97, 97)):
        image = renderer.render(
            box, spp, sampler=sampler, threads=1 + k % 2, checkpoint=path, resume=k > 0
        )
        same(image, renderer.render(box, spp, sampler=sampler))


def test_a_filter_whose_tiles_overlap_and_a_direct_sum_over_all_lights(tmp_path):
    """A job is fewer samples where all lights are sampled, and sums have borders."""
    scene = renderer.load_file(SCENES / "emitters" / "scene.xml", width=40, height=30)
    whole = renderer.render(scene, 100)
    image, _ = in_sittings(scene, tmp_path / "a.ckpt", spp=100)
    same(image, whole)


def test_a_goal_takes_the_same_number_of_samples(box, path):
    """The halves that tell the error are kept, also in the middle of one."""
    whole = renderer.render(box, target_error=0.06)
    image, sittings = in_sittings(box, path, target_error=0.06, spp=4096)
    same(image, whole)
    assert sittings > 1 and image.error == whole.error
    more = renderer.render(box, target_error=0.05, checkpoint=path, resume=True)
    assert more.error <= 0.05 and more.spp > whole.spp
    same_count = renderer.render(box, more.spp, checkpoint=path, resume=True)
    np.testing.assert_array_equal(same_count.pixels, more.pixels)
    with pytest.raises(SceneError, match="has no first half: it is of a render without"):
        renderer.render(box, target_error=0.04, checkpoint=path, resume=True)


def interrupted_at(monkeypatch, number, short):
    """Interrupt a render in its part of this number, `short` samples before its end.

    A goal has two parts for each look, its two halves. Returns how many parts were begun.
    """
    trace, begun = RenderLoop._trace_till_due, []

    def trace_a_part(self, end):
        begun.append(end)
        if len(begun) - 1 != number:
            return trace(self, end)
        assert trace(self, end - short)
        raise KeyboardInterrupt

    monkeypatch.setattr(RenderLoop, "_trace_till_due", trace_a_part)
    return begun


@pytest.mark.parametrize("short", [0, 3])
def test_a_goal_goes_on_from_either_half_of_each_look(box, path, short):
    """Interrupted in each half, at its end or before: the same looks, error and picture.

    In a first half the error of the last look is still known, in a second one it is not.
    """
    errors, end_second = [], Halves.end_second

    def end_second_and_tell(self, threads):
        errors.append(end_second(self, threads).error)
        return self.last_look(threads)

    with pytest.MonkeyPatch.context() as context:
        looks = interrupted_at(context, -1, 0)
        context.setattr(Halves, "end_second", end_second_and_tell)
        whole = renderer.render(box, 4096, target_error=0.15)
    assert len(looks) >= 6, f"a goal of three looks is expected: {looks}"
    sizes = np.diff([0, *looks])
    np.testing.assert_array_equal(
        sizes[::2], sizes[1::2], "both halves of a look are equal"
    )
    for number, end in enumerate(looks):
        for file in (path, older(path)):
            file.unlink(missing_ok=True)
        with pytest.MonkeyPatch.context() as context:
            interrupted_at(context, number, short)
            image = renderer.render(box, 4096, target_error=0.15, checkpoint=path)
        assert not image.complete
        with pytest.MonkeyPatch.context() as context:
            rest = interrupted_at(context, -1, 0)
            shown = []
            image = renderer.render(
                box,
                4096,
                target_error=0.15,
                checkpoint=path,
                resume=True,
                progress=shown.append,
            )
        where = f"interrupted {short} samples before {end}"
        known = errors[number // 2 - 1] if number in range(2, 99, 2) else np.inf
        first = next(now for now in shown if now.stage == "render")
        assert first.error == known, f"{where}: the error that is shown first"
        assert rest == looks[number:], f"{where}: other looks"
        assert image.error == whole.error, f"{where}: another error"
        same(image, whole)


def test_a_time_counts_in_all_sittings(box, path):
    """What was requested is done already."""
    first = renderer.render(box, time_limit=0.2, checkpoint=path)
    before = np.zeros(1)  # what the checkpoint knows; its own writing comes after that
    read_checkpoint(path).read_into({"seconds": before})
    again = renderer.render(box, time_limit=1e-3, checkpoint=path, resume=True)
    assert again.spp == first.spp and again.complete and again.error == first.error
    assert again.seconds > before[0] > 1e-3


def test_aovs_and_the_colours_beside_them(tmp_path):
    scene = renderer.load_file(
        SCENES / "depth-and-normals" / "scene.xml", width=32, height=24
    )
    path = tmp_path / "a.ckpt"
    whole = renderer.render(scene, 300, sampler="independent")
    image, sittings = in_sittings(scene, path, spp=300, sampler="independent")
    assert sittings > 2
    same(image, whole)
    assert (tmp_path / "a.ckpt.colors").is_file()
    more = renderer.render(
        scene, 700, sampler="independent", checkpoint=path, resume=True, threads=1
    )
    same(more, renderer.render(scene, 700, sampler="independent"))
    for file in (path, older(path)):
        file.unlink()
    with pytest.raises(SceneError, match=r"a\.ckpt\.colors is there already"):
        renderer.render(scene, 700, checkpoint=path)


def test_the_work_of_a_scene_is_counted_once(box, path):
    whole = renderer.render(box, 100, integrator="work", accel="bvh")
    image, _ = in_sittings(box, path, spp=100, integrator="work", accel="bvh")
    same(image, whole)
    with pytest.raises(SceneError, match=r"accel is .* bvh there and .* brute here"):
        renderer.render(
            box, 100, integrator="work", accel="brute", checkpoint=path, resume=True
        )


def killed_renders(folder, kills):
    program = [
        sys.executable,
        str(ROOT / "tests" / "probes" / "killed_renders.py"),
        folder,
        kills,
    ]
    done = subprocess.run(
        program,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"{kills} killed")


def test_renders_that_are_killed_go_on_to_the_same_picture(tmp_path):
    killed_renders(str(tmp_path), "20")


@pytest.mark.slow
def test_renders_that_are_killed_two_hundred_times(tmp_path):
    killed_renders(str(tmp_path), "200")


# ------------------------------------------------------------------- what goes wrong


def some_of(box, path, spp=40, **settings):
    """Render; the checkpoint after 24 samples is kept as the older."""
    renderer.render(box, spp - 16, checkpoint=path, **settings)
    return renderer.render(box, spp, checkpoint=path, resume=True, **settings)


def test_a_damaged_checkpoint_costs_what_came_after_the_older(box, path):
    """And the good older one is not pushed out by the damaged one."""
    some_of(box, path)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.warns(
        CheckpointWarning, match="is damaged: .*; this goes on from the older"
    ):
        image = renderer.render(box, 50, checkpoint=path, resume=True, seed=0)
    same(image, renderer.render(box, 50))
    path.write_bytes(b"")
    with pytest.warns(CheckpointWarning, match="is no checkpoint"):
        renderer.render(box, 24, checkpoint=path, resume=True)
    for file in (path, older(path)):
        file.write_bytes(b"lightproof?")
    with pytest.raises(SceneError, match="there is nothing to go on from"):
        renderer.render(box, 50, checkpoint=path, resume=True)
    assert path.read_bytes() == b"lightproof?"


def test_a_full_disk_ends_no_render(box, path, monkeypatch):
    some_of(box, path)
    before = path.read_bytes()

    def full(descriptor):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.warns(
        CheckpointWarning, match="cannot be written: No space left on device"
    ):
        image = renderer.render(
            box, 500, checkpoint=path, checkpoint_every=1e-3, resume=True
        )
    assert image.complete
    assert path.read_bytes() == before
    assert sorted(os.listdir(path.parent)) == ["a.ckpt", "a.ckpt.older"]


def test_a_checkpoint_that_is_there_is_not_written_over(box, path):
    some_of(box, path)
    before = path.read_bytes()
    with pytest.raises(SceneError, match="is there already: go on from it"):
        renderer.render(box, 50, checkpoint=path)
    assert path.read_bytes() == before


def test_what_an_unfinished_writing_left_is_removed(box, path):
    part = path.with_name(f".a.ckpt.{2**22 + 1}.part")  # more than Linux gives
    part.write_bytes(b"lightproof")
    renderer.render(box, 4, checkpoint=path)
    assert os.listdir(path.parent) == ["a.ckpt"]


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("samples", 2**62, "the checkpoint has samples up to"),
        ("samples", -1, "less than no samples"),
        ("seconds", float("nan"), "is of nan seconds"),
        ("seconds", -1.0, "is of -1.0 seconds"),
        ("looks", [4, 2, 0], "next look, at 2 samples, is before the last, at 4"),
        ("looks", [-4, -2, 0], "next look"),
        ("looks", [2, 2**62, 0], "has samples up to 4611686018427387904"),
    ],
)
def test_a_checkpoint_that_somebody_made_is_refused(box, path, name, value, message):
    """All sizes are right, and so is the checksum."""
    goal = {"target_error": 0.9} if name == "looks" else {}
    renderer.render(box, 16, checkpoint=path, **goal)
    stored = checkpoint_file.read_checkpoint(path)
    arrays = {n: np.empty(a.shape, a.dtype) for n, a in stored.arrays.items()}
    stored.read_into(arrays)
    arrays[name][:] = value
    checkpoint_file.write_checkpoint(path, stored.of, arrays, keep=False)
    with pytest.raises(SceneError, match=message):
        renderer.render(box, 16, checkpoint=path, resume=True, **goal)


# --------------------------------------------------------------------- what must fit


def edited(scene, **changes):
    description = scene.description
    return build_scene(dataclasses.replace(description, **changes))


def with_a_vertex_moved(scene):
    shapes = list(scene.description.shapes)
    mesh = next(k for k, shape in enumerate(shapes) if isinstance(shape, Mesh))
    vertices = shapes[mesh].vertices.copy()
    vertices[0, 0] = np.nextafter(vertices[0, 0], np.float32(9))
    shapes[mesh] = dataclasses.replace(shapes[mesh], vertices=vertices)
    return edited(scene, shapes=tuple(shapes))


def with_a_brighter_lamp(scene):
    shapes = [
        s if s.radiance is None else dataclasses.replace(s, radiance=(1.0, 2.0, 3.0))
        for s in scene.description.shapes
    ]
    return edited(scene, shapes=tuple(shapes))


def with_another_filter(scene):
    camera = scene.description.camera
    rfilter = dataclasses.replace(camera.film.rfilter, name="tent", radius=1.0)
    film = dataclasses.replace(camera.film, rfilter=rfilter)
    return edited(scene, camera=dataclasses.replace(camera, film=film))


def with_less_depth(scene):
    less = dataclasses.replace(scene.description.integrator, max_depth=3)
    return edited(scene, integrator=less)


@pytest.mark.parametrize(
    ("edit", "wanted", "reason"),
    [
        (None, {"seed": 1}, "seed is 0 there and 1 here"),
        (None, {"integrator": "direct"}, "integrator is path there and direct here"),
        (None, {"sampler": "sobol"}, "sampler is independent there and sobol here"),
        (None, {"sampler": "mitsuba"}, "sampler is independent there and mitsuba indep"),
        (None, {"ray_offset": "mitsuba"}, "plan there and here are not the same"),
        (with_a_vertex_moved, {}, "shapes .* there and here are not the same"),
        (with_a_brighter_lamp, {}, "shapes .* there and here are not the same"),
        (with_another_filter, {}, "camera there and here are not the same"),
        (with_less_depth, {}, "integrator there and here are not the same"),
        (None, {"spp": 39}, "spp is 39, and the checkpoint has samples up to 40"),
        (None, {"target_error": 0.1}, "has no first half"),
    ],
)
def test_what_does_not_fit_is_refused_and_nothing_lost(box, path, edit, wanted, reason):
    some_of(box, path)
    before = path.read_bytes(), older(path).read_bytes()
    scene = box if edit is None else edit(box)
    with pytest.raises(SceneError, match=reason) as refused:
        renderer.render(scene, **{"spp": 64, "checkpoint": path, "resume": True, **wanted})
    assert "\n" not in str(refused.value)
    assert (path.read_bytes(), older(path).read_bytes()) == before


@pytest.mark.parametrize("sampler", ["stratified", "multijitter", "orthogonal", "sobol"])
def test_points_that_depend_on_their_number_cannot_become_more(box, path, sampler):
    renderer.render(box, 16, sampler=sampler, checkpoint=path)
    with pytest.raises(
        SceneError, match=r"spp \(the points of \w+ depend on it\) is \d+ there"
    ):
        renderer.render(box, 64, sampler=sampler, checkpoint=path, resume=True)


@pytest.mark.parametrize("what", ["lightproof", "Python", "NumPy", "Numba", "processor"])
def test_another_program_or_machine_is_refused(box, path, monkeypatch, what):
    some_of(box, path)
    other = {**identity.made_by(), what: "another"}
    monkeypatch.setattr(identity, "made_by", lambda: other)
    with pytest.raises(SceneError, match=rf"{what} is .* there and another here"):
        renderer.render(box, 50, checkpoint=path, resume=True)


def test_threads_structure_and_where_files_lie_may_differ(path, tmp_path):
    """A texture and a mesh from another folder; the XML with a comment more."""
    here = SCENES / "textured-room"
    scene = renderer.load_file(here / "scene.xml", width=32, height=32)
    renderer.render(scene, 20, threads=2, sampler="independent", checkpoint=path)
    moved = tmp_path / "moved"
    shutil.copytree(here, moved)
    text = (moved / "scene.xml").read_text().replace("<scene", "<!-- hi --><scene", 1)
    (moved / "scene.xml").write_text(text)
    other = renderer.load_file(moved / "scene.xml", width=32, height=32)
    image = renderer.render(
        other,
        40,
        threads=3,
        accel="bvh",
        sampler="independent",
        checkpoint=path,
        resume=True,
    )
    same(image, renderer.render(scene, 40, sampler="independent"))
    pictures = list(moved.rglob("*.png"))
    assert pictures
    for file in pictures:
        shutil.copyfile(SCENES / "bumps" / "textures" / "normals.png", file)
    repainted = renderer.load_file(moved / "scene.xml", width=32, height=32)
    with pytest.raises(SceneError, match="textures"):
        renderer.render(repainted, 50, sampler="independent", checkpoint=path, resume=True)


@pytest.mark.parametrize(
    "file", sorted(SCENES.glob("*/scene.xml")), ids=lambda f: f.parent.name
)
def test_every_scene_has_a_digest(file):
    """What a scene may hold is known, and two readings of it are the same."""
    scenes = [renderer.load_file(file) for _ in range(2)]
    first, second = (
        identity.identity_of(scene, make_plan(scene), RenderOptions()) for scene in scenes
    )
    assert first == second


def test_a_kind_of_the_users_own_is_known_by_its_source(monkeypatch):
    glossy = OtherBsdf("plastic", {})
    before = content_digest(glossy)
    other = dataclasses.replace(BSDFS["plastic"], source="another")
    monkeypatch.setitem(BSDFS, "plastic", other)
    assert content_digest(glossy) != before


def test_contents_differ_where_anything_does():
    values = [
        None,
        0,
        0.0,
        "0",
        False,
        (),
        (0,),
        ((0,),),
        (0, ()),
        {},
        {"0": 0},
        np.zeros(1),
        np.zeros((1, 1)),
        np.zeros(1, np.float32),
        np.array([-0.0]),
        np.zeros(0),
    ]
    assert len({content_digest(value) for value in values}) == len(values)
    assert content_digest(1, 2) != content_digest((1, 2)) != content_digest(12)
    assert content_digest({"a": 1, "b": 2}) == content_digest({"b": 2, "a": 1})
    with pytest.raises(TypeError, match="object in a scene has no digest"):
        content_digest(object())


@pytest.mark.parametrize(
    ("wanted", "error", "message"),
    [
        ({"checkpoint_every": 0}, SceneError, "checkpoint_every is 0"),
        ({"checkpoint_every": "60"}, TypeError, "positive numbers"),
        ({"checkpoint": "nowhere/a.ckpt"}, SceneError, "there is no folder 'nowhere'"),
        ({"checkpoint": "."}, SceneError, "is a folder"),
        ({"checkpoint": None, "resume": True}, SceneError, "no checkpoint is given"),
    ],
)
def test_what_cannot_be_a_checkpoint(box, path, wanted, error, message):
    with pytest.raises(error, match=message):
        renderer.render(box, 4, **{"checkpoint": path, **wanted})
    assert not path.exists()


# ------------------------------------------------------------------------ the command


@pytest.mark.usefixtures("in_an_empty_folder", "heeding_interrupts")
def test_ctrl_c_keeps_a_checkpoint_from_which_the_command_goes_on(capsys, monkeypatch):
    """The finished file is that of one go, byte by byte."""
    words = [str(CORNELL), "-D", "width=48", "-D", "height=48", "--spp", "200"]
    assert main([*words, "-o", "whole.exr", "--quiet"]) == 0
    words += ["-o", "a.exr", "--checkpoint", "a.ckpt"]
    show = ProgressDisplay.__call__

    def interrupted(self, progress):
        show(self, progress)
        if progress.stage == "render" and progress.done > 0:
            signal.raise_signal(signal.SIGINT)

    with monkeypatch.context() as context:
        context.setattr(ProgressDisplay, "__call__", interrupted)
        assert main([*words, "--every", "30s"]) == 130
    said = capsys.readouterr().err
    assert said.endswith("--checkpoint a.ckpt --resume goes on from here\n")
    done = int(re.search(r"interrupted after (\d+) of 460800", said)[1])
    assert main(words) == 1
    assert "a.ckpt is there already: go on" in capsys.readouterr().err
    assert main([*words, "--resume", "--threads", "1"]) == 0
    said = capsys.readouterr()
    assert f"going on at {done / 460800:.0%} of 460800 samples\n" in said.err
    assert Path("a.exr").read_bytes() == Path("whole.exr").read_bytes()
    assert main([*words, "--resume", "--seed", "1"]) == 1
    assert "a.ckpt is of another render: seed is 0 there" in capsys.readouterr().err
    Path("a.ckpt").write_bytes(b"")
    assert main([*words, "--resume"]) == 0
    assert "warning: a.ckpt is no checkpoint of this" in capsys.readouterr().err


@pytest.mark.usefixtures("in_an_empty_folder", "heeding_interrupts")
@pytest.mark.parametrize(
    ("words", "status", "complaint"),
    [
        (["--resume"], 2, "--resume needs --checkpoint FILE"),
        (["--every", "5"], 2, "--every needs --checkpoint FILE"),
        (["--checkpoint", "a", "--every", "0"], 2, "0 is not more than 0"),
        (["--checkpoint", "a.exr", "-o", "a.exr"], 1, "named as the picture and as"),
        (["--checkpoint", "nowhere/a"], 1, "there is no folder 'nowhere'"),
    ],
)
def test_what_the_command_refuses(capsys, words, status, complaint):
    assert main([str(CORNELL), *words]) == status
    said = capsys.readouterr().err
    assert complaint in said and said.count("\n") == 1


def test_the_time_left_is_that_of_the_samples_left():
    """A million in ten seconds; those of the checkpoint took none of them."""
    now = Progress("render", 2_000_000, 10_000_000, 10.0, resumed=1_000_000)
    said = io.StringIO()
    ProgressDisplay(said)(now)
    assert said.getvalue() == "20%, 80 s left, 0.1 Msamples/s\n"


def test_a_checkpoint_is_not_due_while_one_is_written(monkeypatch, path):
    """A slow disk is written to once after the other."""
    kept = checkpoint_module.Checkpoint(
        path, 1e-9, {"said": {}, "hashed": {}}, resume=False
    )
    written, let_go = [], []

    def slow(self, state):
        while not let_go:
            time.sleep(1e-3)
        written.append(state["sums"].copy())

    monkeypatch.setattr(checkpoint_module.Checkpoint, "_write", slow)
    sums = np.zeros(3)
    assert kept.due()
    kept.take({"sums": sums})
    assert not kept.due()
    sums += 1.0  # work goes on: what is written is the copy
    let_go.append(True)
    kept.close()
    assert kept.due()
    np.testing.assert_array_equal(written, [np.zeros(3)])
