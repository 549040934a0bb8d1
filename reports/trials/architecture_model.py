"""Models of architecture size: meshes by material, lamps, a camera; and their files.

Lengths are metres, z is up.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from mitsuba_ref.records.json_files import write_atomically
from reports.trials.large_meshes import ply_bytes, scene_head
from reports.trials.meshes import CORNERS, SIDES

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]
Mesh = tuple[Floats, NDArray[np.int64], Floats]  # vertices (V, 3), faces (F, 3), uv (V, 2)

TEXTURE = 256  # [pixels] a side


@dataclass
class Model:
    """Meshes by material, lamps, and a camera."""

    eye: Vector
    target: Vector
    fov: float  # [degrees] across the width
    # of a material: its rgb, the name of a texture, or a <bsdf>
    colours: dict[str, str]
    meshes: dict[str, list[Mesh]] = field(default_factory=dict)
    lamps: list[tuple[Vector, Vector, tuple[float, float], str]] = field(
        default_factory=list
    )  # centre, direction, half sizes, radiance
    sky: str = ""  # radiance, or "image": `sky_image`
    depth: int = 6
    smooth: bool = False  # whether normals are interpolated where faces share vertices

    def boxes(self, material: str, low: Any, high: Any, tile: float = 1.0) -> None:
        """Add boxes between corners (n, 3); a texture repeats every `tile` metres."""
        a, b = np.broadcast_arrays(np.atleast_2d(low), np.atleast_2d(high))
        corners = a[:, None] + CORNERS * (b - a)[:, None]  # (n, 8, 3)
        vertices = corners[:, SIDES]  # (n, 6, 4, 3)
        axes = np.array([[1, 2], [1, 2], [0, 2], [0, 2], [0, 1], [0, 1]])
        index = np.broadcast_to(axes[None, :, None], (*vertices.shape[:3], 2))
        uv = np.take_along_axis(vertices, index, axis=3) / tile
        quads = np.arange(vertices.size // 3).reshape(-1, 4)
        self.add(material, vertices.reshape(-1, 3), quads, uv.reshape(-1, 2))

    def sheets(self, material: str, corners: Any) -> None:
        """Add quadrilaterals (n, 4, 3), each with texture coordinates 0 to 1."""
        corners = np.asarray(corners, np.float64).reshape(-1, 4, 3)
        uv = np.tile([[0, 0], [1, 0], [1, 1], [0, 1]], (len(corners), 1))
        quads = np.arange(4 * len(corners)).reshape(-1, 4)
        self.add(material, corners.reshape(-1, 3), quads, uv.astype(np.float64))

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
            self.add(material, body.reshape(-1, 3) + one, quads, uv)

    def add(
        self, material: str, vertices: Floats, faces: NDArray[np.int64], uv: Floats
    ) -> None:
        """Add a mesh of triangles or quadrilaterals, (n, 3) or (n, 4)."""
        if faces.shape[1] == 4:
            faces = np.concatenate((faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]))
        # Mitsuba 3.9.1 computes NaN normals where a face has an edge of length zero
        a, b, c = (vertices[faces[:, k]] for k in range(3))
        faces = faces[(a != b).any(axis=1) & (b != c).any(axis=1) & (c != a).any(axis=1)]
        self.meshes.setdefault(material, []).append((vertices, faces, uv))

    def write(self, path: Path) -> None:
        """Write a scene file, and its meshes and images into the same folder."""
        for material, meshes in self.meshes.items():
            content = ply_bytes(*joined(meshes), "xyzuv")
            write_atomically(path.parent / f"{material}.ply", content)
        text = scene_text(self)
        for name in set(re.findall(r'value="(\w+)\.png"', text)):
            Image.fromarray(texture(name)).save(path.parent / f"{name}.png")
        if self.sky == "image":
            write_atomically(path.parent / "sky.pfm", sky_image())
        write_atomically(path, text.encode())  # the last: then all is there

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


def texture(name: str) -> NDArray[np.uint8]:
    """Return a picture (TEXTURE, TEXTURE, 3) that repeats in both directions.

    Opacities and heights have one channel, (TEXTURE, TEXTURE).
    """
    y, x = np.mgrid[0:TEXTURE, 0:TEXTURE] / TEXTURE
    noise = np.zeros_like(x)
    rng = np.random.default_rng(3)
    for octave in (2, 4, 8, 16, 32):  # sums of waves of random phase
        for _ in range(4):
            a, b = rng.integers(-octave, octave + 1, 2)
            noise += np.sin(2 * np.pi * (a * x + b * y + rng.random())) / octave
    if name == "leaf":  # its opacity
        width = 0.46 * np.sin(np.pi * np.clip(y, 0.0, 1.0)) ** 0.8
        veins = 0.04 * np.abs(np.sin(12.0 * np.pi * y))
        inside = np.abs(x - 0.5) < width - veins
        return np.where(inside, 255, 0).astype(np.uint8)
    if name == "bumps":  # heights
        return np.round(127.5 + 20.0 * np.clip(noise, -6.0, 6.0)).astype(np.uint8)
    if name == "planks":
        board = np.floor(6 * x)
        tone = 0.8 + 0.2 * np.sin(7.0 * board) + 0.08 * noise
        joint = np.mod(6 * x, 1) < 0.03
        colour = np.array([0.55, 0.36, 0.2])
    elif name == "tiles":
        tone = 0.9 + 0.05 * np.sin(8.0 * np.floor(8 * x) + 3.0 * np.floor(8 * y))
        joint = (np.mod(8 * x, 1) < 0.06) | (np.mod(8 * y, 1) < 0.06)
        colour = np.array([0.8, 0.82, 0.8])
    elif name == "foliage":
        tone = 0.7 + 0.3 * np.abs(np.sin(12.0 * np.pi * y)) + 0.06 * noise
        joint, colour = np.abs(x - 0.5) < 0.02, np.array([0.22, 0.42, 0.13])
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


def joined(meshes: Sequence[Mesh]) -> tuple[Floats, NDArray[np.int64]]:
    """Return the vertices with their texture coordinates (V, 5), and the faces."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _, _ in meshes)])
    vertices = np.concatenate([np.hstack((v, uv)) for v, _, uv in meshes])
    corners = [f + s for (_, f, _), s in zip(meshes, starts, strict=False)]
    return vertices, np.concatenate(corners)


def diffuse(colour: str) -> str:
    """Return the <bsdf> of a diffuse surface, of an rgb or of a texture."""
    value = reflectance("reflectance", colour)
    return f'<bsdf type="twosided"><bsdf type="diffuse">{value}</bsdf></bsdf>'


def reflectance(name: str, colour: str) -> str:
    """Return the element of a colour: an rgb, or the name of a texture."""
    if "," in colour:
        return f'<rgb name="{name}" value="{colour}"/>'
    return image(name, colour)


def image(name: str, texture: str, more: str = "") -> str:
    """Return the element of a texture."""
    file = f'<string name="filename" value="{texture}.png"/>'
    return f'<texture name="{name}" type="bitmap">{file}{more}</texture>'


def scene_text(model: Model) -> str:
    """Return the scene file."""
    shapes = []
    faces = "" if model.smooth else '<boolean name="face_normals" value="true"/>'
    for material in model.meshes:
        colour = model.colours[material]
        bsdf = colour if colour.startswith("<") else diffuse(colour)
        file = f'<string name="filename" value="{material}.ply"/>'
        shapes.append(f'<shape type="ply">{file}{faces}{bsdf}</shape>')
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
    if model.sky == "image":
        shapes.append(
            '<emitter type="envmap"><string name="filename" value="sky.pfm"/>'
            '<transform name="to_world"><rotate x="1" angle="90"/></transform></emitter>'
        )
    elif model.sky:
        shapes.append(
            f'<emitter type="constant"><rgb name="radiance" value="{model.sky}"/></emitter>'
        )
    look_at = model.eye, model.target, (0, 0, 1)
    newline = "\n  "
    return f"""{scene_head(look_at, model.fov, model.depth, (320, 240))}
  {newline.join(shapes)}
</scene>
"""


def sky_image() -> bytes:
    """Return an environment map: a sky with clouds and a sun, and ground below."""
    height, width = 256, 512
    v, u = np.mgrid[0:height, 0:width] / [[[height]], [[width]]]
    elevation, azimuth = np.pi * (0.5 - v), 2.0 * np.pi * u
    up = np.clip(np.sin(elevation), 0.0, 1.0)[..., None]
    pixels = (1.0 - up) * np.array([0.9, 1.0, 1.15]) + up * np.array([0.25, 0.45, 0.95])
    clouds = np.sin(3 * azimuth + 2 * np.sin(5 * elevation)) * np.sin(
        9 * elevation + azimuth
    )
    pixels += 0.7 * np.clip(clouds - 0.2, 0.0, 1.0)[..., None]
    pixels = np.where(elevation[..., None] < 0.0, np.array([0.16, 0.14, 0.1]), pixels)
    sun = np.cos(elevation) * np.cos(0.7) * np.cos(azimuth - 1.2)
    sun += np.sin(elevation) * np.sin(0.7)
    disc = 150.0 * np.exp((sun - 1.0) / 0.0012)
    pixels = pixels + disc[..., None] * np.array([1.0, 0.9, 0.7])
    header = f"PF\n{width} {height}\n-1.0\n".encode()
    return header + pixels[::-1].astype("<f4").tobytes()
