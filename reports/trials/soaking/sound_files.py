"""The sound files: one of each format, in the scene that reads it, and whole scenes."""

from __future__ import annotations

import functools
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from reports.errors import ReportError
from reports.trials.large_meshes import ply_bytes

ROOT = Path(__file__).resolve().parents[3]
PLUGINS, SCENES = ROOT / "tests" / "plugins", ROOT / "scenes"

_BITMAP = (
    '<shape type="rectangle"><bsdf type="diffuse"><texture type="bitmap" '
    'name="reflectance">{}</texture></bsdf></shape>'
)
_MESH = '<shape type="{}">{{}}</shape>'
_SIZE = re.compile(rb'(name="(?:width|height)" value=")\d+')
_OBJ = b"""v -1 -1 0
v 1 -1 0
v 0 1 0
vn 0 0 1
vt 0 0
vt 1 0
vt 0.5 1
f 1/1/1 2/2/1 3/3/1
"""
_SPECTRUM = b"# sampled\n400 0.1\n500 0.3\n600 0.4\n700 .2\n"
_SCENE = """<scene version="3.0.0">
<integrator type="path"><integer name="max_depth" value="4"/></integrator>
<sensor type="perspective"><float name="fov" value="60"/>
<transform name="to_world"><lookat origin="0.4 0.3 3" target="0 0 0" up="0 1 0"/>
</transform>
<film type="hdrfilm"><integer name="width" value="4"/><integer name="height" value="4"/>
</film></sensor>
<emitter type="point"><point name="position" value="1 2 3"/></emitter>
{}
</scene>"""


@dataclass(frozen=True)
class SoundFile:
    """A file that is read without a fault, and the scene that reads it."""

    name: str  # its end is its format
    content: bytes
    scene: str  # XML that names the file; "" if the file is the scene itself
    folder: Path  # where the scene's other files are


@functools.cache
def sound_files() -> tuple[SoundFile, ...]:
    """Return one file of every format that is read, and the scenes of this repository.

    Raises
    ------
    ReportError
        If the files of the tests are not there, as in an installed package.
    """
    if not PLUGINS.is_dir():
        raise ReportError(f"{PLUGINS} is missing: damaged files need a clone's tests")
    textures = [
        *("rgb.bmp", "rgb.hdr", "rgb.jpg", "rgba.png", "grey_16.png", "rgb.tga"),
        *("half.exr", "grey_float.exr", "float.exr"),
    ]
    files = [_used(f"textures/{name}", _BITMAP) for name in textures]
    files += [
        _used("textures/octahedron.ply", _MESH.format("ply")),
        _used("meshes/version-3.serialized", _MESH.format("serialized")),
        _used("meshes/version-4.serialized", _MESH.format("serialized")),
        _used("grids/torus.vol", _MESH.format("sdfgrid")),
        _used("small.binary", '<shape type="sphere"><bsdf type="merl">{}</bsdf></shape>'),
        _used("sky.exr", '<shape type="sphere"/><emitter type="envmap">{}</emitter>'),
        _made("binary.ply", _binary_ply(), _MESH.format("ply")),
        _made("mesh.obj", _OBJ, _MESH.format("obj")),
        _made(
            "colour.spd",
            _SPECTRUM,
            '<shape type="sphere"><bsdf type="diffuse">{}</bsdf></shape>',
            '<spectrum name="reflectance" filename="colour.spd"/>',
        ),
    ]
    return (*files, *scenes())


def scenes() -> list[SoundFile]:
    """Return whole scenes, of the tests of plugins and of scenes/."""
    paths = [*sorted(PLUGINS.glob("*.xml")), *sorted(SCENES.glob("*/scene.xml"))]
    return [
        SoundFile(
            f"{path.parent.name}-{path.stem}.xml",
            _small(path.read_bytes()),
            "",
            path.parent,
        )
        for path in paths
    ]


def _small(scene: bytes) -> bytes:
    """Return the scene with a film of 6 x 6 pixels, but where it is cropped."""
    return scene if b"crop_" in scene else _SIZE.sub(rb"\g<1>6", scene)


def _used(place: str, use: str) -> SoundFile:
    path = PLUGINS / place
    return _made(path.name, path.read_bytes(), use)


def _made(name: str, content: bytes, use: str, reference: str = "") -> SoundFile:
    given = reference or f'<string name="filename" value="{name}"/>'
    return SoundFile(name, content, _SCENE.format(use.format(given)), PLUGINS)


def _binary_ply() -> bytes:
    """Return a triangle with normals and texture coordinates."""
    rows = [(-1, -1, 0, 0, 0, 1, 0, 0), (1, -1, 0, 0, 0, 1, 1, 0), (0, 1, 0, 0, 0, 1, 0, 1)]
    properties = ("x", "y", "z", "nx", "ny", "nz", "u", "v")
    return ply_bytes(np.array(rows), np.array([(0, 1, 2)]), properties)
