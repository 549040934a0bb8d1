"""Whatever is done to a scene file, the reader ends in a scene or in one SceneError."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import pytest

from renderer import scene_file
from renderer.errors import SceneError
from renderer.scene_file.document.xml_elements import XmlElement, parse_xml

SCENE = """<scene version="3.0.0">
<default name="grey" value="0.5"/><default name="n" value="4"/>
<integrator type="aov"><string name="aovs" value="d:depth, n:sh_normal"/>
<integrator type="path"><integer name="max_depth" value="$n"/></integrator></integrator>
<bsdf type="twosided" id="wall"><bsdf type="diffuse"><texture type="checkerboard"
name="reflectance"><rgb name="color0" value="$grey"/><spectrum name="color1" value="400:.1
700:.2"/><transform name="to_uv"><scale x="2" y="3"/></transform></texture></bsdf></bsdf>
<shape type="obj"><string name="filename" value="t.obj"/><ref id="wall"/></shape>
<shape type="sphere"><point name="center" x="0" y="1" z="2"/><float name="radius"
value="2"/><bsdf type="conductor"><string name="material" value="Au"/></bsdf></shape>
<shape type="cylinder"><point name="p1" value="1 2 3"/><transform name="to_world">
<rotate x="1" angle="30"/><translate z="2"/></transform><emitter type="area"/></shape>
<shape type="rectangle"><transform name="to_world"><matrix value="1 0 0 0  0 2 0 1  0 0 3 0
0 0 0 1"/></transform><bsdf type="dielectric"><string name="int_ior" value="water"/></bsdf>
</shape><emitter type="spot"><float name="cutoff_angle" value="30"/><rgb name="intensity"
value="1 2 3"/></emitter><include filename="part.xml"/>
<sensor type="perspective"><transform name="to_world"><lookat origin="1 2 3" target="0 0 0"
up="0 1 0"/></transform><film type="hdrfilm"><integer name="width" value="8"/><rfilter
type="mitchell"/></film><sampler type="multijitter"/></sensor></scene>"""
WORDS = (
    "",
    "0",
    "-1",
    "1e400",
    "nan",
    "$x",
    "\\$n",
    "1 2 3",
    "4:5 6:7",
    "wall",
    "t.obj",
    ":",
)
ROUNDS = 400


def write(element: XmlElement) -> str:
    attributes = "".join(f' {name}="{value}"' for name, value in element.attributes.items())
    inside = "".join(write(child) for child in element.children)
    return f"<{element.tag}{attributes}>{inside}</{element.tag}>"


def elements(root: XmlElement) -> list[XmlElement]:
    return [root, *(e for child in root.children for e in elements(child))]


def mutate(root: XmlElement, rng: random.Random) -> None:
    """Change one thing: an attribute, a tag, or where an element stands."""
    all_elements = elements(root)
    victim, other = rng.choice(all_elements), rng.choice(all_elements)
    key = rng.choice([*victim.attributes, "value", "name"])
    match rng.randrange(8):
        case 0:
            victim.attributes.pop(key, None)
        case 1:
            victim.attributes[key] = rng.choice(WORDS)
        case 2:
            victim.attributes[key] = rng.choice([*other.attributes.values(), ""])
        case 3:
            victim.tag = other.tag
        case 4 if victim.children:
            victim.children.pop(rng.randrange(len(victim.children)))
        case 5 if victim.children:
            victim.children.append(rng.choice(victim.children))
        case 6 if other not in elements(victim) and victim not in elements(other):
            victim.children.append(other)
        case _:
            text = victim.attributes.get(key, "")
            place = rng.randrange(len(text) + 1)
            victim.attributes[key] = (
                text[:place] + rng.choice("09.-e:, x\u0660") + text[place:]
            )


def attempt(read: Any, *arguments: Any) -> bool:
    """Tell whether reading ends well; anything but a scene or a SceneError fails."""
    try:
        read(*arguments)
    except SceneError as error:
        assert "\n" not in str(error)
        assert len(str(error)) > 10
        return False
    return True


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "t.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "part.xml").write_text(
        '<scene version="3.0.0"><shape type="disk"/></scene>'
    )
    return tmp_path


def test_the_scene_that_is_mutated_is_valid(folder: Path) -> None:
    assert len(scene_file.read_string(SCENE, base_dir=folder).shapes) == 5


def test_mutated_elements_end_in_a_scene_or_a_scene_error(folder: Path) -> None:
    rng = random.Random(11)
    good = 0
    for _ in range(ROUNDS):
        root = parse_xml(SCENE, "scene")
        for _ in range(rng.randint(1, 3)):
            mutate(root, rng)
        text = write(root)
        good += attempt(lambda xml: scene_file.read_string(xml, base_dir=folder), text)
    assert 0 < good < ROUNDS // 2  # the mutations bite, but not always


def test_garbled_text_ends_in_a_scene_or_a_scene_error(folder: Path) -> None:
    """Bytes deleted, doubled or replaced, in a file: encodings and syntax break too."""
    rng = random.Random(12)
    path = folder / "scene.xml"
    original = SCENE.encode()
    good = 0
    for _ in range(ROUNDS):
        content = bytearray(original)
        for _ in range(rng.randint(1, 3)):
            place = rng.randrange(len(content))
            content[place : place + rng.randrange(3)] = rng.choice(
                (b"", b"<", b'"', b"&x;", b"\xff", b"\x00", b"9", b"</", b"$")
            )
        path.write_bytes(bytes(content))
        good += attempt(scene_file.read_file, path)
    assert good < ROUNDS


@pytest.mark.parametrize("encoding", ["utf-16", "utf-8-sig", "latin-1"])
def test_other_encodings(folder: Path, encoding: str) -> None:
    declared = "utf-16" if encoding == "utf-16" else encoding.replace("-sig", "")
    text = f'<?xml version="1.0" encoding="{declared}"?><!-- \u00e9 -->{SCENE}'
    path = folder / "scene.xml"
    path.write_bytes(text.encode(encoding))
    assert attempt(scene_file.read_file, path)
    path.write_bytes(text.replace(declared, "klingon").encode(encoding))
    # a byte order mark decides, whatever is declared
    assert attempt(scene_file.read_file, path) == (encoding != "latin-1")


def test_mutated_dictionaries_end_in_a_scene_or_a_scene_error() -> None:
    """Replace each value, at any depth, by each of many odd ones."""
    odd = (
        None,
        "",
        -1,
        2**80,
        float("inf"),
        [],
        [1, "a"],
        {},
        {"type": 3},
        b"x",
        object(),
        {1},
    )

    def content() -> dict[str, Any]:
        return {
            "type": "scene",
            "sensor": {"type": "perspective", "fov": 40, "film": {"type": "hdrfilm"}},
            "ball": {
                "type": "sphere",
                "center": [0, 1, 2],
                "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.5}},
            },
            "lamp": {
                "type": "point",
                "intensity": {"type": "spectrum", "value": [(4, 1), (5, 1)]},
            },
        }

    def paths(node: dict[str, Any]) -> list[tuple[str, ...]]:
        found: list[tuple[str, ...]] = []
        for key, value in node.items():
            found.append((key,))
            if isinstance(value, dict):
                found += [(key, *rest) for rest in paths(value)]
        return found

    assert attempt(scene_file.read_dict, content())
    for path in paths(content()):
        for value in odd:
            changed = content()
            node = changed
            for key in path[:-1]:
                node = node[key]
            node[path[-1]] = value
            attempt(scene_file.read_dict, changed)
