"""`--sampler mitsuba`: what the plan takes, what it refuses, and that it is deterministic.

That the numbers lead to Mitsuba's own picture is tested in test_replay_scenes.py.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_scenes import (
    diffuse,
    floor,
    mirror,
    point_light,
    rectangle,
    scene,
    sensor,
    sphere,
)

import renderer
from renderer.command.cli import main
from renderer.command.plan_text import plan_text
from renderer.errors import NotReplayable
from renderer.kernels.records import batch
from renderer.rendering.planning.make_plan import make_plan

CORNELL_BOX = Path(__file__).parents[3] / "scenes" / "cornell-box" / "scene.xml"
CAMERA = sensor((0, -3, 2), (0, 0, 0), fov=40, size=(70, 40), spp=4, jitter=True)
CAMERA["sampler"]["type"] = "independent"
del CAMERA["sampler"]["jitter"]
LAMP = rectangle((0, 0, 1), (0.3, 0, 0), (0, -0.3, 0), diffuse(0.0), shine=5.0)


def loaded(integrator, *parts, **settings):
    return renderer.load_dict(scene(CAMERA, integrator, *parts, **settings))


def plan_of(integrator, *parts, **settings):
    return make_plan(loaded(integrator, *parts, **settings), sampler="mitsuba")


def test_the_files_sampler_and_mitsubas_ray_offset_are_taken():
    plan = plan_of("path", floor(), LAMP)
    assert (plan.replay, plan.sampler.name, plan.spp) == (True, "independent", 4)
    assert plan.ray_offset == "mitsuba"
    assert plan.sampler_name == "mitsuba independent"


def test_another_ray_offset_can_be_asked_for():
    """To see what the offset does and nothing else."""
    plan = make_plan(loaded("path", floor(), LAMP), sampler="mitsuba", ray_offset="tight")
    assert plan.ray_offset == "tight"


def test_no_leaner_method_is_taken():
    """Direct light alone gives the answer of a short path, but by other paths."""
    plan = plan_of("path", floor(), point_light((0, 0, 1)), max_depth=2)
    assert (plan.method, plan.every_light) == ("path", False)


def test_direct_asks_one_light_as_mitsuba_does():
    plan = plan_of("direct", floor(), point_light((0, 0, 1)), point_light((1, 0, 1)))
    assert (plan.method, plan.every_light) == ("direct", False)


def test_a_tree_of_rays_with_point_lights_is_replayed():
    """It draws nothing but the place on the film."""
    plan = plan_of("whitted", floor(), sphere(mirror()), point_light((0, 2, 2)))
    assert plan.replay


@pytest.mark.parametrize(
    ("integrator", "settings", "words"),
    [
        ("whitted", {}, "whitted with point"),
        ("direct", {"bsdf_samples": 257}, "possible are up to 256"),
        ("direct", {"emitter_samples": 1000}, "possible are up to 256"),
    ],
)
def test_what_cannot_be_replayed_is_refused_with_what_can(integrator, settings, words):
    with pytest.raises(NotReplayable, match=words):
        plan_of(integrator, floor(), LAMP, **settings)


@pytest.mark.parametrize("spectral", [True, False])
def test_volpathmis_is_replayed_in_its_own_order(spectral):
    """And volpath, where the options name it, in that of volpath."""
    scene = loaded("volpathmis", floor(), LAMP, use_spectral_mis=spectral)
    plan = make_plan(scene, sampler="mitsuba")
    assert (plan.method, plan.mis_densities) == ("volpath", 3 if spectral else 1)
    named = make_plan(scene, sampler="mitsuba", integrator="volpath")
    assert (named.method, named.mis_densities) == ("volpath", 0)


def test_shadow_rays_of_two_groups_have_room(monkeypatch):
    """A point of a two-sided BSDF of two kinds stands in two; its path has one ray."""
    beyond, rows = [], batch._rows

    def longer(count, capacity):
        made = rows(count + 1, capacity)
        beyond.append(made[count])
        return made[:count]

    monkeypatch.setattr(batch, "_rows", longer)
    sides = {"type": "twosided", "a": diffuse(0.5), "b": {"type": "roughconductor"}}
    wall = rectangle((0, 0, 0), (9, 0, 0), (0, 9, 0), sides)
    renderer.render(loaded("volpath", wall, point_light((0, -1, 3))), sampler="mitsuba")
    assert beyond
    assert not any(row.any() for row in beyond)


def test_the_explanation_says_whose_numbers_they_are():
    text = plan_text(loaded("path", floor(), LAMP), sampler="mitsuba")
    assert "the scalar variants of Mitsuba" in " ".join(text.split())


def test_the_picture_is_the_same_for_any_number_of_threads():
    """Each pixel keeps its stream; a tile's samples are drawn one after the other.

    The Cornell box, as its kernels are those of other tests.
    """
    box = renderer.load_file(CORNELL_BOX, width=70, height=40, spp=4)
    one, three = (
        renderer.render(box, seed=5, threads=n, sampler="mitsuba") for n in (1, 3)
    )
    again = renderer.render(box, seed=6, threads=2, sampler="mitsuba")
    np.testing.assert_array_equal(one.pixels, three.pixels)
    assert (one.pixels != again.pixels).any()
    assert one.metadata["sampler"] == "mitsuba independent"


def test_the_command_takes_it(tmp_path, capsys):
    """`--sampler mitsuba --explain` on a file."""
    file = tmp_path / "scene.xml"
    file.write_text(
        '<scene version="3.0.0"><sensor type="perspective"/>'
        '<shape type="sphere"/><emitter type="constant"/></scene>'
    )
    assert main([str(file), "--sampler", "mitsuba", "--explain"]) == 0
    assert "the scalar variants of Mitsuba" in " ".join(capsys.readouterr().out.split())
