"""Scenes of architecture size: a columned hall, a street at night, a library.

Each has 100,000 to 2,000,000 triangles, textures and dozens to hundreds of lamps, and is
written to the cache when it is measured first. Lengths are metres, z is up. All surfaces
are diffuse on both sides, so that programs with other material models can draw them too.
"""

# ruff: noqa: RUF005  an array plus a tuple is a sum, not a longer tuple

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from mitsuba_ref.records.json_files import write_atomically
from renderer.process.cache_folder import cache_folder
from reports.trials.large_meshes import scene_head

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]
Mesh = tuple[Floats, NDArray[np.int64], Floats]  # vertices (V, 3), faces (F, 3), uv (V, 2)

TEXTURE = 256  # [pixels] a side
CORNERS = np.array(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij")).reshape(3, 8).T
SIDES = np.array(  # corners of the six sides of a box
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
)


@dataclass
class Model:
    """Meshes by material, lamps, and a camera."""

    eye: Vector
    target: Vector
    fov: float  # [degrees] across the width
    colours: dict[str, str]  # rgb of a material, or the name of a texture
    meshes: dict[str, list[Mesh]] = field(default_factory=dict)
    lamps: list[tuple[Vector, Vector, tuple[float, float], str]] = field(
        default_factory=list
    )  # centre, direction, half sizes, radiance
    sky: str = ""  # radiance

    def boxes(self, material: str, low: Any, high: Any, tile: float = 1.0) -> None:
        """Add boxes between corners (n, 3); a texture repeats every `tile` metres."""
        a, b = np.broadcast_arrays(np.atleast_2d(low), np.atleast_2d(high))
        corners = a[:, None] + CORNERS * (b - a)[:, None]  # (n, 8, 3)
        vertices = corners[:, SIDES]  # (n, 6, 4, 3)
        axes = np.array([[1, 2], [1, 2], [0, 2], [0, 2], [0, 1], [0, 1]])
        index = np.broadcast_to(axes[None, :, None], (*vertices.shape[:3], 2))
        uv = np.take_along_axis(vertices, index, axis=3) / tile
        quads = np.arange(vertices.size // 3).reshape(-1, 4)
        self._add(material, vertices.reshape(-1, 3), quads, uv.reshape(-1, 2))

    def lathe(
        self,
        material: str,
        profile: Sequence[tuple[float, float]],
        places: Any,
        around: int,
        flutes: int = 0,
        rings: int = 0,
    ) -> None:
        """Add turned bodies of (radius, height), one at each of the places (n, 3).

        Parameters
        ----------
        flutes, rings
            Grooves along the body; rows into which the profile is cut, 0: as it is.
        """
        r, z = np.array(profile, np.float64).T
        if rings:
            at = np.linspace(0, len(r) - 1, rings)
            r, z = (np.interp(at, np.arange(len(r)), values) for values in (r, z))
        phi = np.linspace(0.0, 2.0 * np.pi, around + 1)
        depth = 1.0 - 0.07 * np.abs(np.sin(0.5 * flutes * phi)) if flutes else 1.0 + 0 * phi
        x, y = (r[:, None] * depth * wave for wave in (np.cos(phi), np.sin(phi)))
        body = np.stack(np.broadcast_arrays(x, y, z[:, None]), axis=-1)
        uv = np.stack(np.broadcast_arrays(phi, z[:, None]), axis=-1).reshape(-1, 2)
        place = np.arange(body.size // 3).reshape(len(r), around + 1)
        a, b, c, d = place[:-1, :-1], place[:-1, 1:], place[1:, 1:], place[1:, :-1]
        quads = np.stack((a, b, c, d), axis=-1).reshape(-1, 4)
        for one in np.atleast_2d(places):
            self._add(material, body.reshape(-1, 3) + one, quads, uv)

    def _add(
        self, material: str, vertices: Floats, quads: NDArray[np.int64], uv: Floats
    ) -> None:
        faces = np.concatenate((quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]))
        self.meshes.setdefault(material, []).append((vertices, faces, uv))

    def lamp(
        self, centre: Any, direction: Vector, size: tuple[float, float], radiance: str
    ) -> None:
        """Add rectangular lamps at places (n, 3)."""
        for place in np.atleast_2d(np.asarray(centre, np.float64)).tolist():
            self.lamps.append((tuple(place), direction, size, radiance))


def grid(*axes: Any) -> Floats:
    """Return all combinations of values (n, len(axes))."""
    each = np.meshgrid(*(np.atleast_1d(axis) for axis in axes), indexing="ij")
    return np.stack([values.ravel() for values in each], axis=1).astype(np.float64)


def hall() -> Model:
    """Return a hall of two rows of fluted columns under a coffered ceiling."""
    model = Model(
        (0.6, -1.0, 1.7),
        (-0.4, 20.0, 3.4),
        74.0,
        {
            "marble": "marble",
            "stone": "0.72, 0.69, 0.62",
            "wall": "plaster",
            "gold": "0.75, 0.55, 0.25",
        },
    )
    model.boxes("marble", (-8, -2, -0.2), (8, 40, 0), 2.0)
    low = [(-8.4, -2, 0), (8, -2, 0), (-8, 40, 0), (-8, -2.4, 0)]
    high = [(-8, 40, 9), (8.4, 40, 9), (8, 40.4, 9), (8, -2, 9)]
    model.boxes("wall", low, high, 3.0)
    columns = grid((-4.2, 4.2), np.arange(0.5, 39.0, 3.5), 0.4)
    shaft = [(0.62, 0), (0.5, 0.12), (0.52, 0.3), (0.46, 3), (0.4, 6), (0.4, 6.1)]
    model.lathe("stone", shaft, columns, 144, 24, 40)
    model.boxes("stone", columns - (0.7, 0.7, 0.4), columns + (0.7, 0.7, 0))
    capital = [(0.42, 6.1), (0.55, 6.2), (0.5, 6.3), (0.72, 6.6), (0.72, 6.7)]
    model.lathe("gold", capital, columns, 48, 12, 12)
    model.boxes("stone", grid((-4.95, 3.45), -2, 7.1), grid((-3.45, 4.95), 40, 7.9))
    x, y = np.arange(-8, 8, 1.6), np.arange(-2, 40, 1.75)
    for step in range(5):  # frames that step up into each coffer
        edge, z = 0.14 + 0.1 * step, 9.0 + 0.12 * step
        for side in range(2):
            corner, opposite = grid(x, y, z), grid(x + 1.6, y + 1.75, z + 0.12)
            first, last = opposite.copy(), corner.copy()
            first[:, side] = corner[:, side] + edge
            last[:, side] = opposite[:, side] - edge
            model.boxes("stone", corner, first)
            model.boxes("stone", last, opposite)
    model.boxes("gold", (-8, -2, 9.6), (8, 40, 9.7))
    for sign in (-1.0, 1.0):  # windows high in the walls
        places = grid(sign * 7.95, np.arange(1.5, 39.0, 3.5), 6.2)
        model.lamp(places, (-sign, 0.0, 0.0), (0.6, 1.6), "9, 10, 12")
    lanterns = grid((-2.0, 2.0), np.arange(2.25, 39.0, 3.5), 5.6)
    model.lamp(lanterns, (0.0, 0.0, -1.0), (0.2, 0.2), "60, 42, 22")
    model.lathe(
        "gold",
        [(0.3, 0.05), (0.34, 0.2), (0.1, 0.5), (0.02, 0.7), (0.02, 3.4)],
        lanterns,
        32,
    )
    return model


def street() -> Model:
    """Return a street of houses at night, with lit windows and street lamps."""
    model = Model(
        (1.2, -9.0, 2.2),
        (-0.8, 12.0, 5.0),
        70.0,
        {
            "brick": "brick",
            "paving": "paving",
            "plaster": "plaster",
            "frame": "0.8, 0.78, 0.72",
            "iron": "0.08, 0.08, 0.1",
            "glass": "0.05, 0.06, 0.08",
        },
        sky="0.02, 0.03, 0.07",
    )
    rng = np.random.default_rng(7)
    model.boxes("paving", (-30, -20, -0.2), (30, 90, 0), 1.5)
    for sign in (-1.0, 1.0):
        low, high = sorted((sign * 4.2, sign * 7.0))
        model.boxes("plaster", (low, -20, 0), (high, 90, 0.15), 1.5)  # pavement
        for house in range(12):
            y, floors = -16.0 + 8.0 * house, int(rng.integers(3, 6))
            low, high = sorted((sign * 7.0, sign * 17.0))
            top = 1.0 + 3.2 * floors
            wall = ("brick", "plaster")[house % 2]
            model.boxes(wall, (low, y, 0), (high, y + 8, top), 1.0)
            low, high = sorted((sign * 6.6, sign * 7.0))
            for z in (1.0, top - 0.3, top):  # cornices
                model.boxes("frame", (low + 0.1, y, z - 0.2), (high, y + 8, z))
            windows = grid(
                sign * 7.0,
                y + np.array([1.2, 3.1, 5.0, 6.9]),
                1.7 + 3.2 * np.arange(floors),
            )
            _windows(model, windows, sign, rng)
            model.boxes(
                "iron",
                windows[::2] + (-0.6, -0.75, -0.75),
                windows[::2] + (0.6, 0.75, -0.68),
            )
            rails = grid(sign * 6.45, np.linspace(-0.7, 0.7, 9), 0.0)
            baluster = [
                (0.015, -0.7),
                (0.03, -0.5),
                (0.015, -0.3),
                (0.035, -0.1),
                (0.015, 0.15),
            ]
            ends = windows[::2] * (0, 1, 1)
            model.lathe(
                "iron", baluster, (ends[:, None] + rails).reshape(-1, 3), 16, rings=14
            )
            model.boxes(
                "iron",
                ends + (sign * 6.45 - 0.03, -0.75, 0.15),
                ends + (sign * 6.45 + 0.03, 0.75, 0.2),
            )
        posts = grid(sign * 4.7, np.arange(-12.0, 90.0, 9.0), 0.15)
        model.lathe(
            "iron",
            [(0.16, 0), (0.1, 0.4), (0.06, 1), (0.05, 4), (0.2, 4.1), (0.05, 4.5)],
            posts,
            24,
            rings=30,
        )
        model.lamp(posts + (0, 0, 4.05), (0.0, 0.0, -1.0), (0.16, 0.16), "260, 170, 80")
    return model


def _windows(model: Model, places: Floats, sign: float, rng: np.random.Generator) -> None:
    """Add panes, lit or dark, with frames and sills; a place is the middle."""
    lit = rng.random(len(places)) < 0.4
    model.lamp(
        places[lit] - (0.02 * sign, 0, 0), (-sign, 0.0, 0.0), (0.5, 0.7), "3, 2.1, 1.1"
    )
    dark = places[~lit]
    model.boxes("glass", dark - (0.02, 0.5, 0.7), dark + (0.02, 0.5, 0.7))
    for y in (-0.55, 0.0, 0.5):
        model.boxes("frame", places + (-0.12, y, -0.7), places + (0.12, y + 0.05, 0.7))
    for z in (-0.75, -0.2, 0.25, 0.7):
        model.boxes("frame", places + (-0.12, -0.55, z), places + (0.12, 0.55, z + 0.05))
    model.boxes("frame", places + (-0.3, -0.65, -0.85), places + (0.3, 0.65, -0.75))


def library() -> Model:
    """Return a reading room: shelves of books, tables, chairs and hundreds of lamps."""
    books = {
        f"book{k}": colour
        for k, colour in enumerate(
            (
                "0.35, 0.08, 0.06",
                "0.08, 0.18, 0.3",
                "0.1, 0.26, 0.13",
                "0.45, 0.36, 0.2",
                "0.16, 0.1, 0.07",
            )
        )
    }
    model = Model(
        (0.3, -0.6, 1.75),
        (-0.4, 16.0, 1.3),
        72.0,
        {
            "wood": "planks",
            "dark": "0.22, 0.11, 0.06",
            "wall": "plaster",
            "brass": "0.7, 0.5, 0.2",
            **books,
        },
    )
    rng = np.random.default_rng(11)
    model.boxes("wood", (-7, -1, -0.1), (7, 30, 0), 1.2)
    walls = [(-7.2, -1, 0), (7, -1, 0), (-7, 30, 0), (-7, -1.2, 0), (-7, -1, 5)]
    ends = [(-7, 30, 5), (7.2, 30, 5), (7, 30.2, 5), (7, -1, 5), (7, 30, 5.2)]
    model.boxes("wall", walls, ends, 3.0)
    heights = 0.1 + 0.42 * np.arange(9)
    for sign in (-1.0, 1.0):
        low, high = sorted((sign * 6.6, sign * 7.0))
        model.boxes(
            "dark",
            grid(low, np.arange(0, 29.1, 1.45), 0),
            grid(high, np.arange(0.06, 29.2, 1.45), 4.0),
        )
        model.boxes("dark", grid(low, 0, heights - 0.04), grid(high, 29.06, heights))
        for z in heights[:-1]:
            edges = np.cumsum(rng.uniform(0.025, 0.065, 650))
            edges = edges[(edges < 28.9) & (np.mod(edges, 1.45) > 0.13)]
            widths = rng.uniform(0.018, 0.024, len(edges))
            tall, deep = (
                rng.uniform(0.22, 0.36, len(edges)),
                rng.uniform(0.02, 0.12, len(edges)),
            )
            near = np.where(sign < 0, low, low + deep)
            far = np.where(sign < 0, high - deep, high)
            colours = rng.integers(0, len(books), len(edges))
            for k in range(len(books)):
                at = colours == k
                first = np.stack((near, edges, np.full_like(edges, z)), axis=1)[at]
                last = np.stack((far, edges + widths, z + tall), axis=1)[at]
                model.boxes(f"book{k}", first, last)
    tables = grid((-2.6, 2.6), np.arange(2.0, 29.0, 3.0), 0.0)
    model.boxes("wood", tables + (-1.5, -0.5, 0.74), tables + (1.5, 0.5, 0.8), 0.8)
    leg = [(0.04, 0), (0.06, 0.1), (0.03, 0.2), (0.06, 0.45), (0.035, 0.6), (0.07, 0.74)]
    legs = (tables[:, None] + grid((-1.35, 1.35), (-0.4, 0.4), 0.0)).reshape(-1, 3)
    model.lathe("dark", leg, legs, 32, rings=40)
    chairs = (tables[:, None] + grid((-0.9, 0.0, 0.9), (-0.85, 0.85), 0.0)).reshape(-1, 3)
    model.boxes("dark", chairs + (-0.22, -0.22, 0.42), chairs + (0.22, 0.22, 0.47))
    feet = (chairs[:, None] + grid((-0.18, 0.18), (-0.18, 0.18), 0.0)).reshape(-1, 3)
    model.lathe(
        "dark", [(0.02, 0), (0.03, 0.15), (0.018, 0.25), (0.028, 0.42)], feet, 20, rings=24
    )
    model.boxes("dark", chairs + (-0.22, 0.18, 0.5), chairs + (0.22, 0.22, 0.95))
    lamps = (tables[:, None] + grid((-0.9, 0.0, 0.9), 0.0, 1.2)).reshape(-1, 3)
    pendants = grid(np.linspace(-5.6, 5.6, 8), np.arange(0.8, 29.5, 1.5), 3.7)
    shade = [(0.16, -0.06), (0.14, 0.0), (0.04, 0.1), (0.01, 0.12)]
    model.lathe("brass", shade, np.concatenate((lamps, pendants)), 32, rings=12)
    model.lathe("brass", [(0.08, -0.4), (0.012, -0.38), (0.012, 0.1)], lamps, 16)
    model.lathe("dark", [(0.008, 0.1), (0.008, 1.3)], pendants, 8)
    model.lamp(
        np.concatenate((lamps, pendants)) - (0, 0, 0.03),
        (0.0, 0.0, -1.0),
        (0.08, 0.08),
        "46, 34, 20",
    )
    return model


ARCHITECTURE: dict[str, Callable[[], Model]] = {
    "hall": hall,
    "street": street,
    "library": library,
}


def texture(name: str) -> NDArray[np.uint8]:
    """Return a picture (TEXTURE, TEXTURE, 3) that repeats in both directions."""
    y, x = np.mgrid[0:TEXTURE, 0:TEXTURE] / TEXTURE
    noise = np.zeros_like(x)
    rng = np.random.default_rng(3)
    for octave in (2, 4, 8, 16, 32):  # sums of waves of random phase
        for _ in range(4):
            a, b = rng.integers(-octave, octave + 1, 2)
            noise += np.sin(2 * np.pi * (a * x + b * y + rng.random())) / octave
    if name == "planks":
        board = np.floor(6 * x)
        tone = 0.8 + 0.2 * np.sin(7.0 * board) + 0.08 * noise
        joint = np.mod(6 * x, 1) < 0.03
        colour = np.array([0.55, 0.36, 0.2])
    elif name in ("brick", "paving"):
        rows = 12 if name == "brick" else 6
        shift = 0.5 * np.mod(np.floor(rows * y), 2)
        column = np.mod(rows / 2 * x + shift, rows / 2)
        tone = 0.85 + 0.15 * np.sin(9.0 * np.floor(column) + 5.0 * np.floor(rows * y))
        tone += 0.08 * noise
        joint = (np.mod(column, 1) < 0.05) | (np.mod(rows * y, 1) < 0.1)
        colour = np.array([0.5, 0.24, 0.17] if name == "brick" else [0.3, 0.3, 0.32])
    elif name == "marble":
        tone = 0.75 + 0.25 * np.abs(np.sin(np.pi * (2 * x + 2 * y) + 1.5 * noise))
        tone *= np.where((np.floor(2 * x) + np.floor(2 * y)) % 2, 1.0, 0.45)
        joint, colour = np.mod(2 * x, 1) < 0.012, np.array([0.85, 0.8, 0.72])
    else:
        tone, joint, colour = 0.9 + 0.06 * noise, x < 0, np.array([0.78, 0.72, 0.6])
    tone = np.where(joint, 0.35, tone)
    return np.round(255.0 * np.clip(tone[..., None] * colour, 0.0, 1.0)).astype(np.uint8)


def architecture_scene(name: str) -> Path:
    """Return the scene file of one of `ARCHITECTURE`; write it to the cache if it lacks."""
    digest = hashlib.sha256(Path(__file__).read_bytes()).hexdigest()[:12]
    folder = cache_folder("architecture_scenes") / digest / name
    path = folder / "scene.xml"
    if path.is_file():
        return path
    folder.mkdir(parents=True, exist_ok=True)
    model = ARCHITECTURE[name]()
    for material, meshes in model.meshes.items():
        write_atomically(folder / f"{material}.ply", ply_bytes(meshes))
        colour = model.colours[material]
        if "," not in colour:
            Image.fromarray(texture(colour)).save(folder / f"{colour}.png")
    write_atomically(path, scene_text(model).encode())  # the last: then all is there
    return path


def ply_bytes(meshes: Sequence[Mesh]) -> bytes:
    """Return meshes as one binary PLY file with texture coordinates."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _, _ in meshes)])
    vertices = np.concatenate([np.hstack((v, uv)) for v, _, uv in meshes])
    corners = np.concatenate([f + s for (_, f, _), s in zip(meshes, starts, strict=False)])
    faces = np.empty(len(corners), [("corners", "u1"), ("vertices", "<i4", 3)])
    faces["corners"], faces["vertices"] = 3, corners
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property float {name}" for name in "xyzuv"]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    text = "\n".join([*header, "end_header\n"]).encode()
    return text + vertices.astype("<f4").tobytes() + faces.tobytes()


def scene_text(model: Model) -> str:
    """Return the scene file."""
    shapes = []
    for material in model.meshes:
        colour = model.colours[material]
        reflectance = (
            f'<rgb name="reflectance" value="{colour}"/>'
            if "," in colour
            else f'<texture name="reflectance" type="bitmap"><string name="filename" '
            f'value="{colour}.png"/></texture>'
        )
        shapes.append(
            f'<shape type="ply"><string name="filename" value="{material}.ply"/>'
            '<boolean name="face_normals" value="true"/>'
            f'<bsdf type="twosided"><bsdf type="diffuse">{reflectance}</bsdf></bsdf>'
            "</shape>"
        )
    for centre, direction, (width, height), radiance in model.lamps:
        place, target = (
            ", ".join(f"{value:.6g}" for value in point)
            for point in (centre, np.add(centre, direction))
        )
        up = "0, 1, 0" if direction[2] else "0, 0, 1"
        shapes.append(
            f'<shape type="rectangle"><transform name="to_world"><scale x="{width}" '
            f'y="{height}"/><lookat origin="{place}" target="{target}" up="{up}"/>'
            '</transform><emitter type="area"><rgb name="radiance" '
            f'value="{radiance}"/></emitter></shape>'
        )
    if model.sky:
        shapes.append(
            f'<emitter type="constant"><rgb name="radiance" value="{model.sky}"/></emitter>'
        )
    look_at = model.eye, model.target, (0, 0, 1)
    return f"""{scene_head(look_at, model.fov, 6, (320, 240))}
  {"".join(shapes)}
</scene>
"""
