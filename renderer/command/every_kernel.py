"""Small scenes that together need the kernels of every plugin, method and accelerator.

They are made from the registries, so that a new plugin is among them without a change here,
unless a scene must give one of its properties (`_REQUIRED`). A nested BSDF has kernels of
its own for each combination: here wrappers hold `diffuse`, and `twosided` holds each BSDF
that light does not go through. Other combinations are compiled when a scene has them.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from renderer.integrators.registry import IN_FILES, INTEGRATORS
from renderer.plugins.bsdfs.parameters import Nested, hints_of
from renderer.plugins.bsdfs.principled import TRANSMITTING
from renderer.plugins.bsdfs.registry import BSDFS, VARIANTS, WRAPPERS
from renderer.plugins.bsdfs.tensor_file import tensor_file
from renderer.plugins.lights.registry import LIGHTS
from renderer.plugins.sensors.registry import SENSORS
from renderer.plugins.shapes.registry import SHAPES
from renderer.plugins.textures.registry import TEXTURES
from renderer.process.names import ACCELERATORS, REPLAY, SAMPLERS
from renderer.rendering.render import render
from renderer.scene.scene import build_scene
from renderer.scene_file import read_dict
from renderer.scene_file.images.png_filters import undo_filters
from renderer.scene_file.meshes.obj_blocks import distinct, read_blocks
from renderer.scene_file.plugins import supported_plugins
from renderer.scene_file.transform_functions import look_at, translate

Properties = dict[str, Any]


class SmallScene(NamedTuple):
    """A scene and the arguments of the renders that need kernels of it."""

    name: str
    scene: Properties
    renders: tuple[Properties, ...]


def render_small(small: SmallScene, folder: Path) -> None:
    """Compile what a scene needs; its files are in a folder, see `write_files`."""
    scene = build_scene(read_dict(small.scene, base_dir=folder))
    for options in small.renders:
        arguments: Properties = {"spp": 1, "threads": 1} | options
        render(scene, **arguments)


def without_replay(small: SmallScene) -> SmallScene:
    """Return a scene without its renders with Mitsuba's random numbers."""
    renders = (one for one in small.renders if one.get("sampler") != REPLAY)
    return small._replace(renders=tuple(renders))


def compile_others() -> None:
    """Compile what no scene in memory needs: readers of OBJ and 16-bit PNG files."""
    blocks = read_blocks(b"v 0 0 0\nf 1 1 1\n", face_normals=False)
    distinct(blocks.corners, 1)  # type: ignore[union-attr]
    rows = np.frombuffer(bytes(7), np.uint8).reshape(1, 7)  # read-only, as those of files
    undo_filters(rows, np.zeros((1, 6), np.uint8), 6)


# ------------------------------------------------------------ what scenes are made of

_MESH = "mesh.ply"
_MEASURED = {"merl": "measured.binary", "measured": "measured_rgb.bsdf"}
_CURVE = "curve.txt"
_PIXELS = np.linspace(0.1, 0.9, 48, dtype=np.float32).reshape(4, 4, 3)
_BITMAP = {"type": "bitmap", "data": _PIXELS, "raw": True}
_REQUIRED: dict[str, Properties] = {  # properties without a default, by plugin
    "aov": {"aovs": "z:depth"},
    "bitmap": _BITMAP,
    "blendbsdf": {"weight": 0.5},
    "bsplinecurve": {"filename": _CURVE},
    "bumpmap": {"heights": _BITMAP},
    "envmap": {"bitmap": _PIXELS},
    "implicit": {"expression": "x*x + y*y + z*z - 0.5"},
    "linearcurve": {"filename": _CURVE},
    **{name: {"filename": file} for name, file in _MEASURED.items()},
    "mesh_attribute": {"name": "vertex_heat"},
    "moment": {"inner": {"type": "path"}},
    "normalmap": {"normalmap": _BITMAP},
    "ply": {"filename": _MESH},
    "sdfgrid": {"grid": np.mgrid[-1.0:2.0, :3, :3][0][..., None]},
    "thinlens": {"aperture_radius": 0.1, "focus_distance": 4.0},
    "uniform": {"value": 0.5},
    "volume": {"volume": {"type": "gridvolume", "grid": np.full((2, 2, 2, 3), 0.5)}},
}
_VARIANTS = {  # of BSDFs, with the properties that choose them
    TRANSMITTING: {"type": "principled", "spec_trans": 0.5},
}
_PATH: Properties = {"integrator": "path"}
_REPLAY = _PATH | {"sampler": REPLAY}
_FIRST_HIT: Properties = {"integrator": "aov"}
_TREE: Properties = {"integrator": "whitted"}
_MEDIA: Properties = {"integrator": "volpath"}
# shapes that cannot shine
_DARK = {"implicits", "sdf_cells", "linear_segments", "bspline_pieces"}
_PLAIN = _DARK | {"cylinders"}  # or in one colour alone
_UP = np.diag([1.0, -1.0, -1.0, 1.0])  # turns a rectangle over


def write_files(folder: Path) -> None:
    """Write the files that scenes name."""
    properties = "".join(f"property float {name}\n" for name in "x y z u v heat_x".split())
    (folder / _MESH).write_text(
        f"ply\nformat ascii 1.0\nelement vertex 3\n{properties}"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0 0 0 0.2\n1 0 0 1 0 0.5\n0 1 0 0 1 0.8\n3 0 1 2\n"
    )
    counts, values = np.full(3, 2, np.int32), np.full(24, 100.0)
    (folder / _CURVE).write_text("-1 0 0 .2\n0 1 0 .2\n1 0 0 .2\n2 1 0 .2\n")
    (folder / _MEASURED["merl"]).write_bytes(counts.tobytes() + values.tobytes())
    shapes = {"theta_i": (1,), "phi_i": (1,), "ndf": (2, 2), "sigma": (2, 2)}
    shapes |= {"vndf": (1, 1, 2, 2), "luminance": (1, 1, 2, 2), "rgb": (1, 1, 3, 2, 2)}
    fields = {name: np.ones(shape, np.float32) for name, shape in shapes.items()}
    flags = {name: np.ones(1, np.uint8) for name in ("description", "jacobian")}
    (folder / _MEASURED["measured"]).write_bytes(tensor_file(fields | flags))


def _plugin(name: str, **properties: Any) -> Properties:
    return {"type": name} | _REQUIRED.get(name, {}) | properties


_FLOOR = _plugin("rectangle")
_LAMP = _plugin("rectangle", to_world=translate([0, 0, 3]) @ _UP, emitter=_plugin("area"))
_PANE = _plugin("rectangle", to_world=translate([0, 0, 1]), bsdf=_plugin("dielectric"))
_BULB = _plugin("point", position=[0.5, 0.5, 2.0])


def _scene(*objects: Properties, sensor: str = "perspective", **others: Any) -> Properties:
    film = _plugin("hdrfilm", width=4, height=4, rfilter=_plugin("box"))
    eye = look_at([0, 0, 4], [0, 0, 0], [0, 1, 0])
    camera = _plugin(sensor, to_world=eye, film=others.pop("film", film))
    parts = {f"object {k}": part for k, part in enumerate(objects)}
    return {"type": "scene", "sensor": camera} | parts | others


def _wrapped(wrapper: str, name: str) -> Properties:
    """Return a BSDF in a wrapper, as often as that has parameters for others."""
    hints = hints_of(WRAPPERS[wrapper].parameters).values()
    count = sum(hint is Nested for hint in hints)
    return _plugin(wrapper, **{f"inside {k}": _plugin(name) for k in range(count)})


def _shape(kind: str) -> Properties:
    """Return a shape of a kind: a mesh from a file, others by their properties."""
    plugins = SHAPES[kind].plugins
    return _plugin("ply" if "ply" in plugins else next(iter(plugins)))


# --------------------------------------------------------------------------------- scenes


def small_scenes() -> Iterator[SmallScene]:
    """Yield all scenes, those that take the longest first."""
    yield from _accelerators()
    yield from _methods()
    yield from _shapes()
    yield from _bsdfs()
    yield from _textures()
    yield from _lights()


def _methods() -> Iterator[SmallScene]:
    """Integrators, samplers, sensors and filters, over one rectangle."""
    objects = _FLOOR, _LAMP, _BULB
    by_name = tuple({"integrator": name} for name in INTEGRATORS)
    yield SmallScene("integrators", _scene(*objects), by_name)
    for name in IN_FILES:
        yield SmallScene(name, _scene(*objects, integrator=_plugin(name)), ({},))
    fog = _plugin("sphere", bsdf=_plugin("null"), interior=_plugin("homogeneous"))
    scene = _scene(*objects, fog, integrator=_plugin("volpath"))
    yield SmallScene("a bulb in fog", scene, ({},))
    several = {"emitter_samples": 2, "bsdf_samples": 2}
    direct = _scene(*objects, integrator=_plugin("direct", **several))
    yield SmallScene("several samples", direct, ({}, {"sampler": REPLAY}))
    goal = _PATH | {"target_error": 0.5, "spp": 64}
    yield SmallScene("goal", _scene(*objects), (goal,))
    for name in SAMPLERS:
        # one light is chosen as several are uniformly; lenses draw numbers of their own
        scene = _scene(_FLOOR, _LAMP, sensor="thinlens")
        renders: tuple[Properties, ...] = (_PATH | {"sampler": name, "spp": 4},)
        if name in supported_plugins("sampler"):  # Mitsuba has it, and can be replayed
            scene["sensor"]["sampler"] = _plugin(name, sample_count=4)
            renders += (_REPLAY | {"spp": 4},)
        yield SmallScene(name, scene, renders)
    for name in SENSORS:
        yield SmallScene(name, _scene(*objects, sensor=name), (_PATH, _REPLAY))
    film = _plugin("hdrfilm", width=4, height=4, rfilter=_plugin("gaussian"))
    yield SmallScene("filter", _scene(*objects, film=film), (_PATH, _REPLAY))


def _bsdfs() -> Iterator[SmallScene]:
    """Each BSDF, and each plugin in each wrapper."""
    variants = {name: _VARIANTS[name] for name in VARIANTS}
    for name, bsdf in ({name: _plugin(name) for name in BSDFS} | variants).items():
        scene = _scene(_FLOOR | {"bsdf": bsdf}, _LAMP)
        renders: tuple[Properties, ...] = (_PATH, _TREE, _FIRST_HIT, _REPLAY)
        if name in BSDFS and BSDFS[name].straight:
            renders += (_MEDIA,)
        yield SmallScene(name, scene, renders)
    for wrapper in WRAPPERS:
        for name, kind in BSDFS.items():
            if not (kind.transmits and WRAPPERS[wrapper].opaque):
                scene = _scene(_FLOOR | {"bsdf": _wrapped(wrapper, name)}, _LAMP)
                renders = (_PATH, _FIRST_HIT, _REPLAY) if name == "diffuse" else (_PATH,)
                yield SmallScene(f"{name} in {wrapper}", scene, renders)


def _textures() -> Iterator[SmallScene]:
    """Textures as colours and as numbers, bitmaps as heights too; each is a kernel."""
    for texture in (*map(_plugin, TEXTURES), *_bitmaps()):
        bsdfs = [
            _plugin("diffuse", reflectance=texture),
            _plugin("roughconductor", alpha=texture),
        ]
        if texture["type"] == "bitmap":
            bsdfs.append(_wrapped("bumpmap", "diffuse") | {"heights": texture})
        shapes = [_plugin("ply", bsdf=bsdf) for bsdf in bsdfs]
        yield SmallScene(texture["type"], _scene(*shapes, _LAMP), (_PATH,))
        # with a texture that has another in it all are read in another way
        board = _plugin("checkerboard", color0=_BITMAP)
        nested = _plugin("ply", bsdf=_plugin("diffuse", reflectance=board))
        scene = _scene(*shapes, nested, _LAMP)
        yield SmallScene(f"nested {texture['type']}", scene, (_PATH,))


def _bitmaps() -> Iterator[Properties]:
    """Yield a bitmap of each format that files have."""
    for pixels in (_PIXELS, _PIXELS[..., :1]):
        for texels in (
            (255.0 * pixels).astype(np.uint8),
            pixels.astype(np.float16),
            pixels,
        ):
            for raw in (True, False):
                yield _plugin("bitmap", data=texels, raw=raw)


def _lights() -> Iterator[SmallScene]:
    """Lights of one colour and with pictures; area lights on each shape that can shine.

    There is a pane, behind which paths look for lights that have an extent.
    """
    pictures = [
        _plugin("bitmap", data=x) for x in ((255.0 * _PIXELS).astype("u1"), _PIXELS)
    ]
    renders: tuple[Properties, ...] = ({}, _PATH, _TREE, _REPLAY, _MEDIA)
    for name, plugin in LIGHTS.items():
        key = "radiance" if plugin.on_shapes else plugin.texture
        lights = [_plugin(name), *(_plugin(name, **{key: x}) for x in pictures if key)]
        for light in lights:
            if not plugin.on_shapes:
                yield SmallScene(name, _scene(_FLOOR, _PANE, light), renders)
                continue
            dark = _DARK if light is lights[0] else _PLAIN
            for kind in (kind for kind in SHAPES if kind not in dark):
                scene = _scene(_FLOOR, _PANE, _shape(kind) | {"emitter": light})
                yield SmallScene(f"{name} {kind}", scene, renders)


def _shapes() -> Iterator[SmallScene]:
    """Shapes of each kind, as lamps too, with bumps, and in instances."""
    for kind in SHAPES:
        shape = _shape(kind)
        yield SmallScene(
            kind,
            _scene(shape | {"bsdf": _wrapped("bumpmap", "diffuse")}, _BULB),
            (_PATH, _REPLAY),
        )
        group = _plugin("shapegroup", id="group", shape=shape)
        placed = [
            _plugin(
                "instance",
                to_world=translate([x, 0.0, 0.0]),
                of={"type": "ref", "id": "group"},
            )
            for x in (0.0, 1.0)
        ]
        renders = _PATH, _PATH | {"accel": "brute"}, _REPLAY
        yield SmallScene(f"instances of {kind}", _scene(group, *placed, _BULB), renders)


def _accelerators() -> Iterator[SmallScene]:
    shapes = [_shape(kind) for kind in SHAPES]
    for name in ACCELERATORS:
        yield SmallScene(name, _scene(*shapes, _BULB), (_PATH | {"accel": name},))
    lamp = _scene(*shapes, _LAMP)  # its shadow rays go through wide trees in another way
    yield SmallScene("shadows of lamps", lamp, (_PATH | {"accel": "wide"},))
