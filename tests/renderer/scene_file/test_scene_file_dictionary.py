"""Dictionaries: the same scene as the XML with the same content, and as Mitsuba's."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from scene_file_samples import ours

from renderer import scene_file
from renderer.errors import SceneError
from renderer.scene_file import transforms

SENSOR: dict[str, Any] = {"type": "perspective", "fov": 40.0}


def scene(**content: Any) -> dict[str, Any]:
    return {"type": "scene", "sensor": SENSOR, **content}


def description_text(description: Any) -> str:
    """Return everything that a record holds but where it was read."""
    text = repr(description)
    for shape in description.shapes:
        text = text.replace(repr(shape.location), "")
    return text


def test_dictionary_is_the_scene_of_the_same_xml() -> None:
    """One of everything, written twice."""
    move = transforms.translate(1, 2, 3) @ transforms.scale(2, 2, 2)
    from_dictionary = scene_file.read_dict(
        {
            "type": "scene",
            "integrator": {
                "type": "aov",
                "aovs": "d:depth",
                "image": {"type": "path", "max_depth": 4, "hide_emitters": True},
            },
            "sensor": {
                "type": "perspective",
                "fov": 40,
                "to_world": transforms.translate(0, 0, -5),
                "film": {
                    "type": "hdrfilm",
                    "width": 20,
                    "height": np.int64(10),
                    "filter": {"type": "tent"},
                },
                "sampler": {"type": "stratified", "sample_count": 9},
            },
            "glass": {"type": "dielectric", "int_ior": "water"},
            "ball": {
                "type": "sphere",
                "center": [1, 2, 3],
                "radius": np.float32(0.5),
                "material": {"type": "ref", "id": "glass"},
            },
            "wall": {
                "type": "rectangle",
                "to_world": move,
                "bsdf": {
                    "type": "twosided",
                    "inner": {
                        "type": "diffuse",
                        "reflectance": {
                            "type": "checkerboard",
                            "color0": {"type": "rgb", "value": [0.1, 0.2, 0.3]},
                            "color1": {
                                "type": "spectrum",
                                "value": [(400, 0.5), (700, 0.25)],
                            },
                            "to_uv": np.diag([4.0, 4.0, 1.0]),
                        },
                    },
                },
                "light": {"type": "area", "radiance": {"type": "rgb", "value": 2.0}},
            },
            "lamp": {
                "type": "point",
                "position": np.array([0.0, 1.0, 0.0]),
                "intensity": {"type": "spectrum", "value": 3},
            },
        }
    )
    from_xml = ours(
        '<integrator type="aov"><string name="aovs" value="d:depth"/><integrator '
        'type="path">'
        '<integer name="max_depth" value="4"/><boolean name="hide_emitters" value="true"/>'
        "</integrator></integrator>"
        '<bsdf type="dielectric" id="glass"><string name="int_ior" value="water"/></bsdf>'
        '<shape type="sphere" id="ball"><point name="center" x="1" y="2" z="3"/>'
        '<float name="radius" value="0.5"/><ref id="glass"/></shape>'
        '<shape type="rectangle" id="wall"><transform name="to_world"><scale value="2"/>'
        '<translate x="1" y="2" z="3"/></transform><bsdf type="twosided"><bsdf '
        'type="diffuse">'
        '<texture type="checkerboard" name="reflectance"><rgb name="color0" value=".1 '
        '.2 .3"/>'
        '<spectrum name="color1" value="400:0.5 700:0.25"/><transform name="to_uv">'
        '<scale x="4" y="4"/></transform></texture></bsdf></bsdf>'
        '<emitter type="area"><rgb name="radiance" value="2"/></emitter></shape>'
        '<emitter type="point"><point name="position" x="0" y="1" z="0"/>'
        '<spectrum name="intensity" value="3"/></emitter>',
        sensor='<sensor type="perspective"><float name="fov" value="40"/>'
        '<transform name="to_world"><translate z="-5"/></transform><film type="hdrfilm">'
        '<integer name="width" value="20"/><integer name="height" value="10"/>'
        '<rfilter type="tent"/></film><sampler type="stratified">'
        '<integer name="sample_count" value="9"/></sampler></sensor>',
    )
    text = description_text(from_dictionary)
    assert text == description_text(from_xml).replace("<string>", "<dictionary>")


def test_mitsubas_own_scenes_are_read() -> None:
    """`mi.cornell_box()` is a dictionary, with Mitsuba's transform objects in it."""
    content = mi.cornell_box()
    mine, reference = scene_file.read_dict(content), mi.load_dict(content, optimize=False)
    assert len(mine.shapes) == len(reference.shapes()) == 8
    for shape, expected in zip(mine.shapes, reference.shapes(), strict=True):
        center = np.array(expected.bbox().center())
        if shape.radiance is not None or type(shape).__name__ == "Rectangle":
            np.testing.assert_allclose(shape.to_world[:3, 3], center, atol=1e-5)
    assert mine.camera.fov_x == pytest.approx(mi.traverse(reference.sensors()[0])["x_fov"])
    assert mine.integrator.max_depth == 8


def test_files_of_a_dictionary_are_found_in_the_base_folder(tmp_path: Path) -> None:
    (tmp_path / "t.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "p.spd").write_text("400 0.5\n700 0.5\n")
    content = scene(
        mesh={
            "type": "obj",
            "filename": "t.obj",
            "bsdf": {
                "type": "diffuse",
                "reflectance": {"type": "spectrum", "filename": "p.spd"},
            },
        }
    )
    files = scene_file.read_dict(content, base_dir=tmp_path).files
    assert {Path(file).name for file in files} == {"t.obj", "p.spd"}


def cyclic() -> dict[str, Any]:
    content = scene()
    content["again"] = content
    return content


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ([], "<dictionary>: found a list, expected a dictionary"),
        ({}, '<dictionary> scene: the dictionary lacks a "type"'),
        (
            {"type": "diffuse"},
            '<dictionary> scene: the root is bsdf "diffuse"; expected a scene',
        ),
        (cyclic(), "more than 100 dictionaries inside each other"),
        (
            scene(a={"type": "sphere", "b": {}}),
            '<dictionary> scene.a.b: the dictionary lacks a "',
        ),
        (
            scene(a={"type": "velvet"}),
            '<dictionary> scene.a: type "velvet" is not supported; ',
        ),
        (
            scene(a={"type": "sphere", "x": 1}),
            '<dictionary> scene.a: shape "sphere" has no prop',
        ),
        (
            scene(a={"type": "sphere", "radius": np.nan}),
            '<dictionary> scene.a.radius: "radius"',
        ),
        (
            scene(a={"type": "sphere", "radius": None}),
            "scene.a.radius: found a NoneType; expec",
        ),
        (
            scene(a={"type": "sphere", "center": [1, 2]}),
            "a list of shape (2,); expected a numb",
        ),
        (scene(a={"type": "sphere", "center": [1, 2, np.inf]}), "expected a finite number"),
        (scene(a={"type": "sphere", "to_world": np.diag([1, 1, 0, 1])}), "singular"),
        (scene(a={"type": "sphere", "to_world": np.full((4, 4), np.nan)}), "not finite"),
        (scene(a={"type": "sphere", "to_world": np.eye(2)}), "a ndarray of shape (2, 2)"),
        (scene(a={"type": "sphere", 3: 4}), "the key 3 is not a string"),
        (scene(a={"type": "sphere", "id": 3}), "the id is a int, expected a string"),
        (
            scene(a={"type": "sphere"}, b={"type": "sphere", "id": "a"}),
            'id "a" is taken already',
        ),
        (scene(a={"type": "sphere", "radius": 2**70}), "too large for a 64-bit integer"),
        (scene(a={"type": "ref", "id": "nobody"}), '<ref> to the unknown id "nobody"'),
        (
            scene(a={"type": "twosided", "b": {"type": "ref", "id": "a"}}),
            "cyclic <ref>: a -> a",
        ),
        (
            scene(a={"type": "point", "intensity": {"type": "rgb", "value": [1, 2]}}),
            "scene.a.intensity: the rgb value is a list; expected 1 or 3 numbers",
        ),
        (
            scene(a={"type": "point", "intensity": {"type": "spectrum", "value": [1, 2]}}),
            'scene.a.intensity: a spectrum needs a "value": a number, or (wavelength, '
            "value) p",
        ),
        (
            scene(a={"type": "point", "intensity": {"type": "spectrum", "value": "400:1"}}),
            "scene.a.intensity: a spectrum over wavelengths has 1 entries",
        ),
    ],
)
def test_dictionaries_that_are_wrong(content: Any, message: str) -> None:
    with pytest.raises(SceneError) as caught:
        scene_file.read_dict(content)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
