"""Cached references: found again when nothing changed, rendered anew when anything did."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from mitsuba_stand_in import write_scene

from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.reference import cache as cache_module
from mitsuba_ref.reference.cache import ReferenceCache, entry_name, read_entry, write_entry
from mitsuba_ref.reference.errors import MitsubaError
from mitsuba_ref.reference.picture_process import MitsubaWorker
from mitsuba_ref.reference.render import Reference, render_reference


class CountingRenderer:
    """Writes a small entry and counts how often it had to."""

    def __init__(self) -> None:
        self.requests: list[RenderRequest] = []

    def __call__(self, request: RenderRequest, path: Path) -> None:
        self.requests.append(request)
        pixels = np.full((2, 3, 3), len(self.requests), dtype=np.float32)
        write_entry(Reference({"pixels": pixels}, 0.5, 2, 4, "path", ("float32",)), path)


@pytest.fixture
def scene(tmp_path):
    scene = tmp_path / "scene.xml"
    scene.write_text("<scene/>")
    (tmp_path / "mesh.ply").write_text("ply")
    return scene


@pytest.fixture
def renderer():
    return CountingRenderer()


@pytest.fixture
def cache(tmp_path, renderer):
    return ReferenceCache(renderer, tmp_path / "cold" / "cache")


def test_cold_cache_renders_and_warm_cache_reads(scene, cache, renderer):
    """The folder does not exist at first; the second answer is the first one's bytes."""
    request = RenderRequest(str(scene))
    cold = cache.get(request, [])
    warm = cache.get(request, [])
    assert len(renderer.requests) == 1
    assert (cold.from_cache, warm.from_cache) == (False, True)
    np.testing.assert_array_equal(cold.pixels, warm.pixels)
    assert (warm.seconds, warm.threads, warm.spp, warm.changes) == (0.5, 2, 4, ("float32",))


@pytest.mark.parametrize(
    "other",
    [
        {"seed": 1},
        {"spp": 8},
        {"kind": "aovs"},
        {"box_filter": True},
        {"parameters": {"width": "4"}},
    ],
    ids=lambda other: next(iter(other)),
)
def test_another_request_is_another_entry(scene, cache, renderer, other):
    cache.get(RenderRequest(str(scene)), [])
    cache.get(RenderRequest(str(scene), **other), [])
    assert len(renderer.requests) == 2


CHANGED = {"kind": "aovs", "parameters": {"width": "4"}}
CHANGED |= {"camera": tuple(range(16))}
NO_MATTER = {"threads": 4, "allow_outside": ("elsewhere",)}


@pytest.mark.parametrize("field", fields(RenderRequest), ids=lambda field: field.name)
def test_each_field_of_a_request_names_another_entry(scene, field):
    """All that there are, now or later; but threads, and where files may lie."""
    (scene.parent / "other.xml").write_text("<scene/>")
    (scene.parent / "plugin.py").write_text("")
    usual = RenderRequest(str(scene))
    value = getattr(usual, field.name)
    if field.name == "plugins":
        changed = str(scene.parent / "plugin.py")
    elif field.name == "path":
        changed = str(scene.parent / "other.xml")
    elif field.name in CHANGED | NO_MATTER:
        changed = (CHANGED | NO_MATTER)[field.name]
    else:
        changed = not value if isinstance(value, bool) else (value or 0) + 1
    same = entry_name(replace(usual, **{field.name: changed}), []) == entry_name(usual, [])
    assert same == (field.name in NO_MATTER), f"{field.name}: {value} and {changed}"


def test_threads_change_no_picture(scene, cache, renderer):
    cache.get(RenderRequest(str(scene), threads=2), [])
    cache.get(RenderRequest(str(scene), threads=4), [])
    assert len(renderer.requests) == 1


@pytest.mark.parametrize("changed", ["scene.xml", "mesh.ply"])
def test_an_edit_of_any_file_makes_a_new_entry(scene, cache, renderer, changed):
    """A mesh that changes behind an unchanged scene.xml must not show the old picture."""
    files = [scene, scene.parent / "mesh.ply"]
    cache.get(RenderRequest(str(scene)), files)
    (scene.parent / changed).write_text("edited")
    cache.get(RenderRequest(str(scene)), files)
    assert len(renderer.requests) == 2


@pytest.mark.parametrize(
    ("name", "other"),
    [
        ("installed_version", lambda: "0.0.1"),
        ("drjit_version", lambda: "0.0.1"),
        ("AOV_KINDS", ("depth",)),
    ],
    ids=["mitsuba", "drjit", "AOV kinds"],
)
def test_another_version_or_other_aovs_make_a_new_entry(scene, monkeypatch, name, other):
    before = entry_name(RenderRequest(str(scene)), [])
    monkeypatch.setattr(cache_module, name, other)
    assert entry_name(RenderRequest(str(scene)), []) != before


def test_a_copy_of_the_scene_elsewhere_finds_the_same_entry(scene, tmp_path):
    """What counts is what the files say, not where a clone happens to be."""
    copy = tmp_path / "elsewhere" / "scene.xml"
    copy.parent.mkdir()
    copy.write_bytes(scene.read_bytes())
    assert entry_name(RenderRequest(str(copy)), [copy]) == entry_name(
        RenderRequest(str(scene)), [scene]
    )


@pytest.mark.parametrize("damage", ["truncated", "overwritten", "empty", "other content"])
def test_a_damaged_entry_is_rendered_anew(scene, cache, renderer, damage):
    cache.get(RenderRequest(str(scene)), [])
    (entry,) = cache.folder.iterdir()
    content = entry.read_bytes()
    if damage == "truncated":
        entry.write_bytes(content[: len(content) // 2])
    elif damage == "overwritten":
        entry.write_bytes(b"\0" * len(content))
    elif damage == "empty":
        entry.write_bytes(b"")
    else:
        with entry.open("wb") as stream:
            np.savez(stream, facts=np.array(json.dumps({"seconds": 1})))
    again = cache.get(RenderRequest(str(scene)), [])
    assert len(renderer.requests) == 2
    assert not again.from_cache
    assert again.pixels[0, 0, 0] == 2.0


def test_a_failed_render_stores_nothing(scene, tmp_path):
    def fail(request: RenderRequest, path: Path) -> None:
        raise MitsubaError("refused")

    cache = ReferenceCache(fail, tmp_path / "cache")
    with pytest.raises(MitsubaError, match="refused"):
        cache.get(RenderRequest(str(scene)), [])
    assert list(cache.folder.iterdir()) == []


def test_an_interrupted_write_leaves_no_file(tmp_path, monkeypatch):
    """Ctrl-C in the middle: neither the entry nor a temporary file stays."""

    def interrupted(*arguments: object, **arrays: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(cache_module.np, "savez", interrupted)
    reference = Reference({"pixels": np.zeros((1, 1, 3), np.float32)}, 0, 2, 1, "path", ())
    with pytest.raises(KeyboardInterrupt):
        write_entry(reference, tmp_path / "entry.npz")
    assert list(tmp_path.iterdir()) == []


def test_a_missing_file_is_named(scene):
    with pytest.raises(MitsubaError, match=r"gone\.ply"):
        entry_name(RenderRequest(str(scene)), [scene.parent / "gone.ply"])


def test_worker_process_renders_what_this_process_renders(tmp_path):
    """The picture that comes through process, file and cache is Mitsuba's, bit for bit."""
    scene = write_scene(tmp_path / "scene")
    request = RenderRequest(str(scene), {"width": "8", "height": "6"}, spp=4, seed=3)
    with MitsubaWorker() as worker:
        through_worker = ReferenceCache(worker.render, tmp_path / "cache").get(request, [])
    np.testing.assert_array_equal(through_worker.pixels, render_reference(request).pixels)


def test_worker_survives_a_refused_scene(tmp_path):
    """Mitsuba's sentence arrives, and the same process renders the next scene."""
    scene = write_scene(tmp_path / "scene")
    refused = tmp_path / "refused.xml"
    refused.write_text(scene.read_text().replace('"sphere"', '"teapot"'))
    with MitsubaWorker() as worker:
        with pytest.raises(MitsubaError, match="teapot"):
            worker.render(RenderRequest(str(refused)), tmp_path / "refused.npz")
        size = {"width": "8", "height": "6"}
        worker.render(RenderRequest(str(scene), size, spp=1), tmp_path / "entry.npz")
    assert read_entry(tmp_path / "entry.npz") is not None
    assert not (tmp_path / "refused.npz").exists()


def test_a_worker_that_died_between_two_requests_is_named_and_replaced(tmp_path):
    """Killed from outside, say for its memory: one sentence, and the next scene renders."""
    scene = write_scene(tmp_path / "scene")
    request = RenderRequest(str(scene), {"width": "8", "height": "6"}, spp=1)
    with MitsubaWorker() as worker:
        worker.render(request, tmp_path / "first.npz")
        worker._process._process.kill()
        worker._process._process.wait()
        with pytest.raises(MitsubaError, match="ended with status -9"):
            worker.render(request, tmp_path / "second.npz")
        worker.render(request, tmp_path / "third.npz")
    assert not (tmp_path / "second.npz").exists()
    assert read_entry(tmp_path / "third.npz") is not None


def test_silent_worker_is_ended_and_replaced(tmp_path):
    """Half an hour of samples against a limit of a moment; then a picture that fits."""
    scene = write_scene(tmp_path / "scene")
    with MitsubaWorker(time_limit=0.01) as worker:
        endless = RenderRequest(str(scene), spp=1_000_000)
        with pytest.raises(MitsubaError, match=r"within 0.01 s"):
            worker.render(endless, tmp_path / "endless.npz")
        worker.time_limit = 60.0
        size = {"width": "8", "height": "6"}
        worker.render(RenderRequest(str(scene), size, spp=1), tmp_path / "entry.npz")
    assert read_entry(tmp_path / "entry.npz") is not None


def test_a_folder_that_cannot_be_written_is_no_obstacle(scene, tmp_path, renderer):
    """The reference is rendered each time; another user's folder must not stop a run."""
    (tmp_path / "file").write_text("")
    cache = ReferenceCache(renderer, tmp_path / "file" / "cache")
    for count in (1, 2):
        reference = cache.get(RenderRequest(str(scene)), [])
        assert (reference.from_cache, reference.pixels[0, 0, 0]) == (False, count)


def test_a_full_disk_of_the_cache_is_no_obstacle(scene, tmp_path, renderer):
    """Mitsuba's process cannot write the entry: the picture is rendered and not kept."""
    folder = tmp_path / "cache"

    def render(request, path):
        if path.parent == folder:
            said = "[Errno 28] No space left on device"
            raise MitsubaError(f"Mitsuba: OSError: {said}: '{path}'")
        renderer(request, path)

    reference = ReferenceCache(render, folder).get(RenderRequest(str(scene)), [])
    assert (reference.from_cache, len(renderer.requests)) == (False, 1)
    assert list(folder.iterdir()) == []
