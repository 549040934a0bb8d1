"""Shapegroups and instances as the reader sees them, compared with what Mitsuba says."""

from __future__ import annotations

import numpy as np
import pytest
from scene_file_samples import error_of, mitsuba_refuses, ours, scene_text, theirs

import renderer
from renderer import scene_file
from renderer.scene_file import transforms
from renderer.scene_file.description import Disk, Sphere

GROUP = '<shape type="shapegroup" id="g"><shape type="sphere"/></shape>\n'


def instance(inside):
    return f'<shape type="instance">{inside}</shape>'


BAD = {
    "no group": ("\n" + instance(""), 'shape "instance" has 0 shapegroups', True),
    "two groups": (
        GROUP + instance('<ref id="g"/><ref id="g"/>'),
        'shape "instance" has 2 shapegroups',
        True,
    ),
    "a shape": (
        '<shape type="sphere" id="s"/>\n' + instance('<ref id="s"/>'),
        'shape "instance" holds shape "sphere"; expected a <ref> to a shapegroup',
        True,
    ),
    "a bsdf": (
        '<bsdf type="diffuse" id="b"/>\n' + instance('<ref id="b"/>'),
        'shape "instance" has no <bsdf>',
        True,
    ),
    "a group of its own": (
        "\n" + instance(GROUP.strip()),
        'shape "instance" holds shape "shapegroup"; expected a <ref>',
        True,
    ),
    "an unknown id": ("\n" + instance('<ref id="h"/>'), 'unknown id "h"', True),
    "an empty group": (
        '\n<shape type="shapegroup"/>',
        'shape "shapegroup" is empty; expected shapes',
        False,
    ),
    "an instance in a group": (
        GROUP + '<shape type="shapegroup">' + instance('<ref id="g"/>') + "</shape>",
        'shape "instance" inside shape "shapegroup"; groups do not nest',
        True,
    ),
    "a group in a group": (
        f'\n<shape type="shapegroup">{GROUP.strip()}</shape>',
        'shape "shapegroup" inside shape "shapegroup"; groups do not nest',
        True,
    ),
    "a light in a group": (
        '\n<shape type="shapegroup"><shape type="sphere"><emitter type="area"/></shape>'
        "</shape>",
        'shape "sphere" emits light inside shape "shapegroup"',
        True,
    ),
    "a bsdf in a group": (
        '\n<shape type="shapegroup"><shape type="sphere"/><bsdf type="diffuse"/></shape>',
        'shape "shapegroup" has no <bsdf>',
        True,
    ),
    "a bsdf in an instance": (
        GROUP + instance('<ref id="g"/><bsdf type="diffuse"/>'),
        'shape "instance" has no <bsdf>',
        True,
    ),
    "flip_normals": (
        GROUP + instance('<ref id="g"/><boolean name="flip_normals" value="true"/>'),
        'shape "instance" has no property "flip_normals"',
        True,
    ),
    "a flat transform": (
        GROUP
        + instance('<ref id="g"/><transform name="to_world"><scale z="0"/></transform>'),
        'shape "instance", property "to_world": found a transform that cannot be used',
        False,
    ),
}


TURN = '<transform name="to_world"><rotate z="1" angle="30"/></transform>'
WHOLE = (
    instance('<ref id="b"/>' + TURN)  # before the group that it shows
    + '<shape type="rectangle" id="r"/>'
    + '<shape type="shapegroup" id="a"><shape type="disk"/></shape>'
    + '<shape type="shapegroup" id="b"><shape type="sphere"/><ref id="r"/></shape>'
    + instance('<ref name="what" id="c"/>')
    + '<shape type="cube"/><alias id="a" as="c"/>'
    + instance('<ref id="b"/><float name="silhouette_sampling_weight" value="2"/>')
)


def test_groups_and_instances_are_numbered_as_mitsuba_does():
    """Groups in the order of their use; places count shapes and instances, not groups."""
    scene = ours(WHOLE)
    assert [group.id for group in scene.groups] == ["b", "a"]
    assert [len(group.shapes) for group in scene.groups] == [2, 1]
    assert [instance.group for instance in scene.instances] == [0, 1, 0]
    assert [instance.place for instance in scene.instances] == [0, 2, 4]
    kinds = [type(shape).__name__ for shape in scene.every_shape]
    assert kinds == ["Rectangle", "Mesh", "Sphere", "Rectangle", "Disk"]
    turned = transforms.rotate((0, 0, 1), 30)
    np.testing.assert_allclose(scene.instances[0].to_world, turned)
    np.testing.assert_array_equal(scene.instances[1].to_world, np.eye(4))

    names = [str(shape).split("[")[0] for shape in theirs(WHOLE).shapes()]
    assert names == ["Instance", "Rectangle", "Instance", "Cube", "Instance"]


def test_a_dictionary_makes_the_same_groups():
    """In Mitsuba's form: the keys of the scene are ids."""
    scene = scene_file.read_dict(
        {
            "type": "scene",
            "sensor": {"type": "perspective"},
            "g": {"type": "shapegroup", "one": {"type": "sphere"}, "two": {"type": "disk"}},
            "copy": {
                "type": "instance",
                "to_world": transforms.scale(2, 2, 2),
                "shapegroup": {"type": "ref", "id": "g"},
            },
        }
    )
    (group,), (copy,) = scene.groups, scene.instances
    assert [type(shape) for shape in group.shapes] == [Sphere, Disk]
    assert (group.id, copy.id, copy.group, copy.place) == ("g", "copy", 0, 0)
    np.testing.assert_array_equal(copy.to_world, np.diag([2, 2, 2, 1]))


@pytest.mark.parametrize("name", BAD)
def test_bad_groups_and_instances_are_one_line_with_their_place(name):
    """Mitsuba refuses them too, but for two: it shows nothing where we say why."""
    text, expected, refused = BAD[name]
    message = error_of(text)
    assert message.startswith("<string>:3: ")
    assert expected in message
    assert mitsuba_refuses(text) == refused


def test_a_group_that_nobody_uses_is_left_out_but_read():
    scene = ours(GROUP)
    assert scene.groups == () and scene.every_shape == ()
    assert 'has no property "x"' in error_of(
        GROUP.replace("</", '<float name="x" value="1"/></', 1)
    )


def test_the_transform_of_a_group_does_nothing_but_a_warning():
    """Mitsuba takes it without a word, so the same file must show the same."""
    moved_group = GROUP.replace(
        "</shape>\n", '<transform name="to_world"><scale value="3"/></transform></shape>'
    )
    text = moved_group + instance('<ref id="g"/>')
    description = ours(text)
    assert "to_world of shape" in description.warnings[0]
    scene = renderer.load_string(scene_text(text))
    np.testing.assert_allclose(scene.bounds, [[-1] * 3, [1] * 3], rtol=1e-5)
