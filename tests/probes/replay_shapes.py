"""Every shape in a grid, plain and in instances, for our kernels and for Mitsuba."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from kernel_probes import directions, unit
from replay_probes import replay_inputs
from scene_file_samples import mi, scene_text

import renderer

GREY = '<bsdf type="diffuse"/>'
BOTH_SIDES = f'<bsdf type="twosided">{GREY}</bsdf>'
SPACING = 8.0

TURN = '<rotate x="0.6" z="0.8" angle="130"/>'
MIRROR = '<scale x="-1"/>' + TURN
WALL = '<scale x="2" y="0.7"/><rotate x="1" angle="90"/>'  # normals with a zero for z
FLIP = '<boolean name="flip_normals" value="true"/>'

# name: (plugin, properties, steps of to_world)
SHAPES = {
    "rectangle": ("rectangle", "", TURN),
    "wall": ("rectangle", "", WALL),
    "rectangle, flipped": ("rectangle", FLIP, TURN),
    "rectangle, mirrored": ("rectangle", "", MIRROR),
    "disk": ("disk", "", TURN),
    "ellipse, flipped": ("disk", FLIP, '<scale x="0.4" y="1.7"/>' + TURN),
    "disk, mirrored": ("disk", "", MIRROR),
    "sphere": ("sphere", '<float name="radius" value="1.5"/>', ""),
    "sphere, turned": ("sphere", "", TURN),
    "sphere, flipped": ("sphere", FLIP, TURN),
    "sphere, mirrored": ("sphere", "", '<scale value="-1"/>' + TURN),
    "cylinder": (
        "cylinder",
        '<point name="p0" x="0" y="1" z="-1"/><point name="p1" x="0.5" y="-1" z="1"/>'
        '<float name="radius" value="0.8"/>',
        TURN,
    ),
    "cylinder, flipped": ("cylinder", FLIP, TURN),
    "cube": ("cube", "", TURN),
    "cube, flipped": ("cube", FLIP, WALL),
    "with uv": ("obj", '<string name="filename" value="uv.obj"/>', TURN),
    "without uv": ("obj", '<string name="filename" value="bare.obj"/>', TURN),
    "without uv, flipped": ("obj", '<string name="filename" value="bare.obj"/>' + FLIP, ""),
    "smooth": ("obj", '<string name="filename" value="smooth.obj"/>', TURN),
    "smooth, flipped": ("obj", '<string name="filename" value="smooth.obj"/>' + FLIP, TURN),
    "uv without area": ("obj", '<string name="filename" value="line.obj"/>', TURN),
}


def write_meshes(folder: Path) -> None:
    """An octahedron of unequal triangles, with and without uv and normals."""
    rng = np.random.default_rng(0)
    axes = np.concatenate((np.eye(3), -np.eye(3)))
    corners = axes * rng.uniform(0.5, 1.5, (6, 1))
    v = "".join(f"v {x:.7g} {y:.7g} {z:.7g}\n" for x, y, z in corners)
    n = "".join(f"vn {x:.7g} {y:.7g} {z:.7g}\n" for x, y, z in unit(corners + 0.2))
    t = "".join(f"vt {a:.6f} {b:.6f}\n" for a, b in rng.uniform(-2, 2, (6, 2)))
    line = "".join(f"vt {a} {a}\n" for a in range(6))
    faces = [(0, 1, 2), (1, 3, 2), (3, 4, 2), (4, 0, 2)]
    faces += [(1, 0, 5), (3, 1, 5), (4, 3, 5), (0, 4, 5)]

    def f(form: str) -> str:
        corner = [[form.replace("#", str(k + 1)) for k in face] for face in faces]
        return "".join(f"f {a} {b} {c}\n" for a, b, c in corner)

    (folder / "bare.obj").write_text(v + f("#"))
    (folder / "uv.obj").write_text(v + t + f("#/#"))
    (folder / "line.obj").write_text(v + line + f("#/#"))
    (folder / "smooth.obj").write_text(v + n + f("#//#"))


def place(k: int) -> np.ndarray:
    return SPACING * np.array([k % 5, (k // 5) % 5, k // 25], float)


def shape(name: str, k: int | None, child: str) -> str:
    plugin, properties, steps = SHAPES[name]
    if k is not None:
        x, y, z = place(k)
        steps += f'<translate x="{x}" y="{y}" z="{z}"/>'
    to_world = f'<transform name="to_world">{steps}</transform>'
    return f'<shape type="{plugin}">{properties}{to_world}{child}</shape>\n'


def load(folder: Path, content: str) -> tuple[Any, Any]:
    """Our kernels' inputs of a scene, and Mitsuba's scene."""
    path = folder / "scene.xml"
    path.write_text(scene_text(content))
    return replay_inputs(renderer.load_file(path)), mi.load_file(str(path), optimize=False)


def rays_at(k: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays at what stands at the places k, from outside and from within."""
    rng = np.random.default_rng(seed)
    n = len(k)
    centre = np.array([place(i) for i in k])
    target = centre + rng.uniform(0, 0.6, (n, 1)) * directions(n, rng)
    origin = target + rng.choice([0.3, 3.0], (n, 1)) * directions(n, rng)
    origin = origin.astype(np.float32)
    return origin, unit(target - origin).astype(np.float32)


INSTANCES = [
    "",
    TURN,
    '<scale x="0.5" y="1.5" z="0.8"/><rotate z="1" angle="30"/>',
    '<scale x="-1"/>' + TURN,
    '<matrix value="-1 .4 0 0 0 1 .3 0 0 0 .7 0 0 0 0 1"/><rotate x="1" angle="33"/>',
]


def in_a_grid() -> str:
    """All shapes, two-sided, each at its place."""
    return "".join(shape(name, k, BOTH_SIDES) for k, name in enumerate(SHAPES))


GROUPED = [name for name in SHAPES if name not in ("wall", "sphere, mirrored")]


def in_instances() -> str:
    """The shapes of `GROUPED`, each in a group with one instance at its place."""
    groups, copies = "", ""
    for k, name in enumerate(GROUPED):
        member = shape(name, None, BOTH_SIDES)
        groups += f'<shape type="shapegroup" id="group {k}">{member}</shape>\n'
        x, y, z = place(k)
        steps = INSTANCES[k % 5] + f'<translate x="{x}" y="{y}" z="{z}"/>'
        copies += (
            f'<shape type="instance"><ref id="group {k}"/>'
            f'<transform name="to_world">{steps}</transform></shape>\n'
        )
    return groups + copies
