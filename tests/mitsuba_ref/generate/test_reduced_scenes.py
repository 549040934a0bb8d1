"""The reducer, with oracles that need no renderer."""

from __future__ import annotations

from mitsuba_ref.generate.drawing import DrawnScene, scene_text
from mitsuba_ref.generate.reduce import reduce_scene, size_of
from mitsuba_ref.generate.scene import Scenes
from mitsuba_ref.generate.scene_edits import plugins


def first_with(tag, plugin, seed=11):
    scenes = Scenes(seed)
    for number in range(200):
        scene = scenes.draw(number)
        if plugins(scene.root, tag, plugin):
            return scene
    raise AssertionError("no such scene")


def test_what_an_oracle_needs_is_left_and_nothing_else():
    scene = first_with("bsdf", "roughdielectric")

    def differs(candidate: DrawnScene) -> bool:
        return bool(plugins(candidate.root, "bsdf", "roughdielectric"))

    small = reduce_scene(scene, differs, 4000)
    tags = [element.tag for element in small.root.iter()]
    assert tags == ["scene", "bsdf"] or tags == ["scene", "shape", "bsdf"]
    assert not small.files
    assert len(scene_text(small.root).splitlines()) <= 12


def test_a_part_becomes_what_is_inside_of_it():
    """Where what is inside has to stay at its depth, its wrappers go."""
    scene = first_with("bsdf", "blendbsdf")

    def differs(candidate: DrawnScene) -> bool:
        shapes = candidate.root.findall("shape/bsdf")
        return any(len(list(bsdf.iter("bsdf"))) >= 2 for bsdf in shapes)

    small = reduce_scene(scene, differs, 4000)
    (bsdf,) = small.root.findall("shape/bsdf")
    assert len(list(bsdf.iter("bsdf"))) == 2
    assert [e.tag for e in bsdf] == ["bsdf"]


def test_numbers_become_round_as_far_as_they_may():
    scene = first_with("sensor", "thinlens")

    def differs(candidate: DrawnScene) -> bool:
        found = candidate.root.find(".//float[@name='aperture_radius']")
        return found is not None and 0.0 < float(found.get("value", "0")) < 0.5

    small = reduce_scene(scene, differs, 4000)
    (lens,) = (e for e in small.root.iter("float"))
    assert len(lens.attrib["value"]) <= 4


def test_faces_of_a_mesh_are_left_out():
    scene = first_with("shape", "obj")

    def differs(candidate: DrawnScene) -> bool:
        meshes = [c for name, c in candidate.files.items() if name.endswith(".obj")]
        named = candidate.root.find(".//shape[@type='obj']/string[@name='filename']")
        return bool(meshes) and named is not None

    small = reduce_scene(scene, differs, 4000)
    (content,) = small.files.values()
    assert content.count(b"\nf ") == 1


def test_a_limit_of_trials_ends_it_with_the_smallest_so_far():
    scene, tried = first_with("bsdf", "mask"), []

    def differs(candidate: DrawnScene) -> bool:
        tried.append(candidate)
        return bool(plugins(candidate.root, "bsdf", "mask"))

    small = reduce_scene(scene, differs, 10)
    assert len(tried) == 10
    assert plugins(small.root, "bsdf", "mask")
    assert size_of(small) < size_of(scene)
