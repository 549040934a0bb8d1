"""What a scene keeps of one render for the next: less to do, and the same picture."""

from __future__ import annotations

import copy
import dataclasses
import pickle

import numpy as np
import pytest
from scene_file_samples import scene_text
from scene_xml import element, props, tag, to_world

import renderer
from renderer.rendering.job import RenderJob
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.render_loop import run
from renderer.rendering.render_options import RenderOptions
from renderer.rendering.tables import kernel_record
from renderer.scene.scene import RECENT

# none of these may be taken for another: in their tables, their plan or their structures
WAYS = [
    {},
    {"integrator": "direct"},
    {"integrator": "whitted"},
    {"integrator": "depth"},
    {"accel": "wide"},
    {"ray_offset": "mitsuba"},
    {"sampler": "stratified"},
    {"sampler": "sobol"},
    {"sampler": "multijitter"},
    {"sampler": "mitsuba"},
    {"light_choice": "uniform"},
]


VIEW = element(
    "sensor",
    "perspective",
    to_world('<lookat origin="0,0,-0.9" target="0,0,0" up="0,1,0"/>'),
    element("film", "hdrfilm", '<rfilter type="box"/>', width=8, height=8),
    element("sampler", "independent", sample_count=4),
)
ROOM = scene_text(
    element("integrator", "path", max_depth=4, rr_depth=100)
    + element("shape", "cube", props(flip_normals=True))
    + element("emitter", "point", tag("rgb", intensity="1 2 3")),
    sensor=VIEW,
)


def room():
    return renderer.load_string(ROOM)


def by_pickle(scene):
    return pickle.loads(pickle.dumps(scene))


@pytest.fixture
def made(monkeypatch):
    """Return a list that grows with each making of a scene's tables."""
    made, real = [], kernel_record._SceneTables

    def make(*arguments):
        made.append(arguments)
        return real(*arguments)

    monkeypatch.setattr(kernel_record, "_SceneTables", make)
    return made


def test_another_seed_or_number_of_samples_finds_the_tables_made(made):
    scene = room()
    pictures = [
        np.asarray(renderer.render(scene, spp, seed, threads=2))
        for spp, seed in ((1, 0), (1, 1), (4, 1), (1, 0))
    ]
    assert len(made) == 1
    np.testing.assert_array_equal(pictures[0], pictures[3])  # whatever came between
    assert not np.array_equal(pictures[0], pictures[1])


def test_no_way_takes_the_tables_of_another(monkeypatch):
    """In turn on one scene that keeps all, twice around, as on a scene of its own."""
    monkeypatch.setitem(RECENT, "tables", 99)
    scene = room()
    alone = [np.asarray(renderer.render(room(), 2, **way)) for way in WAYS]
    for _ in range(2):
        for way, expected in zip(WAYS, alone, strict=True):
            found = np.asarray(renderer.render(scene, 2, **way))
            np.testing.assert_array_equal(found, expected, err_msg=str(way))


def test_no_more_is_kept_than_was_asked_for_last(made):
    scene = room()
    ways = ["path", "direct", "whitted"]
    for name in ways:
        renderer.render(scene, 1, integrator=name)
    assert len(ways) > RECENT["tables"] == 2
    renderer.render(scene, 1, integrator=ways[-1])
    assert len(made) == 3  # the last is there
    renderer.render(scene, 1, integrator=ways[0])
    assert len(made) == 4  # the first is not


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, by_pickle])
def test_a_copy_of_a_scene_has_tables_of_its_own(copied, made):
    """Those of the first are addresses, which mean nothing in another process."""
    scene = room()
    expected = np.asarray(renderer.render(scene, 1))
    other = copied(scene)
    np.testing.assert_array_equal(np.asarray(renderer.render(other, 1)), expected)
    assert len(made) == 2


@pytest.mark.parametrize("copied", [copy.deepcopy, by_pickle])
def test_copies_of_tables_of_one_column_or_none(copied, tmp_path):
    """NumPy's copies of a rectangle, a triangle without normals, forget how they lie."""
    (tmp_path / "one.obj").write_text("v -1 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    others = """<shape type="rectangle"><transform name="to_world">
        <translate z="0.5"/></transform><bsdf type="diffuse"/></shape>
      <shape type="obj"><string name="filename" value="one.obj"/></shape>"""
    (tmp_path / "scene.xml").write_text(ROOM.replace("</scene>", others + "</scene>"))
    scene = renderer.load_file(tmp_path / "scene.xml")
    expected = np.asarray(renderer.render(scene, 1))
    np.testing.assert_array_equal(np.asarray(renderer.render(copied(scene), 1)), expected)
    assert not np.array_equal(expected, np.asarray(renderer.render(room(), 1)))


def test_a_refusal_is_not_kept():
    scene = room()
    for _ in range(2):
        with pytest.raises(renderer.SceneError, match="'cube' is unknown"):
            make_plan(scene, sampler="cube")
    assert make_plan(scene, spp=3) is make_plan(scene, spp=3)
    assert make_plan(scene, spp=3) is not make_plan(scene, spp=4)


def test_another_record_is_looked_at_anew():
    """The method is called with the address of the record before, no longer than that."""
    scene = room()
    job = RenderJob(scene, make_plan(scene, spp=1), RenderOptions(threads=1))
    job.compile()
    record = job.kernel_scene
    settings = record.settings._replace(max_depth=1)
    film, expected_film = job.make_film(), job.make_film()
    assert run(job.with_record(record._replace(settings=settings)), film).complete
    plan = dataclasses.replace(job.plan, max_depth=1)
    expected = RenderJob(scene, plan, RenderOptions(threads=1))
    assert run(expected, expected_film).complete
    np.testing.assert_array_equal(film.develop(), expected_film.develop())
    assert not np.array_equal(film.develop(), np.asarray(renderer.render(scene, 1)))
