"""Meshes, images, grids and curves of random content, as the bytes of their files."""

from __future__ import annotations

import struct
import tempfile
import zlib
from pathlib import Path
from random import Random
from typing import NamedTuple

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from renderer.plugins.bsdfs.tensor_file import tensor_file

Floats = NDArray[np.float64]


class MeshContent(NamedTuple):
    """A triangle mesh."""

    vertices: Floats  # (n, 3)
    faces: NDArray[np.int64]  # (m, 3)
    uvs: Floats | None  # (n, 2)
    normals: Floats | None  # (n, 3)


def numbers_of(rng: Random, *shape: int) -> Floats:
    """Return numbers in [0, 1) with a few digits."""
    return np.array([round(rng.random(), 4) for _ in range(int(np.prod(shape)))]).reshape(
        shape
    )


# ------------------------------------------------------------------------------- meshes


def draw_patch(rng: Random) -> MeshContent:
    """Return a bent sheet whose faces share no (u, v): a lamp can have a texture there."""
    columns, rows = rng.randint(1, 4), rng.randint(1, 3)
    v, u = np.mgrid[0 : rows + 1, 0 : columns + 1].reshape(2, -1)
    uvs = np.stack([u / columns, v / rows], axis=1)
    heights = 0.4 * numbers_of(rng, len(uvs)) if rng.random() < 0.8 else 0.0 * u
    vertices = np.column_stack([2.0 * uvs - 1.0, heights])
    at = np.arange(len(uvs)).reshape(rows + 1, columns + 1)
    a, b, c, d = at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]
    corners = np.concatenate([[a, b, c], [a, c, d]], axis=1)
    faces = corners.reshape(3, -1).T
    return MeshContent(
        vertices, faces, uvs, _bent(rng, vertices * [0.3, 0.3, 0.0] + [0, 0, 1])
    )


def draw_ball(rng: Random) -> MeshContent:
    """Return a closed, uneven octahedron, or a finer one."""
    vertices = np.concatenate([np.eye(3), -np.eye(3)])
    faces = np.array([[a, b, c] for a in (0, 3) for b in (1, 4) for c in (2, 5)], np.int64)
    inwards = np.linalg.det(vertices[faces]) < 0.0
    faces[inwards] = faces[inwards][:, ::-1]
    if rng.random() < 0.5:
        middles = vertices[faces].sum(axis=1)
        new = np.arange(len(faces)) + len(vertices)
        vertices = np.concatenate([vertices, middles / 3.0**0.5])
        faces = np.concatenate(
            [np.column_stack([faces[:, k], faces[:, (k + 1) % 3], new]) for k in range(3)]
        )
    normals = _bent(rng, vertices)
    vertices = vertices * (0.7 + 0.3 * numbers_of(rng, len(vertices), 1))
    return MeshContent(
        vertices, faces, _some(rng, numbers_of(rng, len(vertices), 2)), normals
    )


def draw_soup(rng: Random) -> MeshContent:
    """Return triangles that have nothing in common: needles, points and twins too."""
    count = rng.randint(2, 8)
    vertices = 2.0 * numbers_of(rng, 3 * count, 3) - 1.0
    faces = np.arange(3 * count).reshape(-1, 3)
    kind = rng.randrange(5)
    if kind == 0:  # no area: a corner twice
        faces[0, 1] = faces[0, 0]
    elif kind == 1:  # no area: corners on a line
        vertices[2] = 2.0 * vertices[1] - vertices[0]
    elif kind == 2:  # a needle
        vertices[2] = vertices[1] + 1e-5
    elif kind == 3:  # the same triangle twice, turned over
        vertices[3:6] = vertices[2::-1]
    return MeshContent(vertices, faces, _some(rng, numbers_of(rng, 3 * count, 2)), None)


def _some(rng: Random, values: Floats) -> Floats | None:
    return values if rng.random() < 0.6 else None


def _bent(rng: Random, normals: Floats) -> Floats | None:
    """Return unit normals near those given, or none."""
    if rng.random() < 0.5:
        return None
    bent = normals + 0.4 * numbers_of(rng, len(normals), 3) - 0.2
    return np.asarray(bent / np.linalg.norm(bent, axis=1, keepdims=True))


def ply_bytes(rng: Random, mesh: MeshContent, attributes: bool) -> bytes:
    """Return a text file, with colours and numbers of vertices and faces if so wanted."""
    columns, names = [mesh.vertices], ["x", "y", "z"]
    for given, its in ((mesh.normals, ("nx", "ny", "nz")), (mesh.uvs, ("u", "v"))):
        if given is not None:
            columns.append(given)
            names += its
    extra = numbers_of(rng, len(mesh.faces), 4)
    of_faces = ["tint_r", "tint_g", "tint_b", "age_0"] if attributes else []
    if attributes:
        columns.append(numbers_of(rng, len(mesh.vertices), 4))
        names += ["r", "g", "b", "heat_x"]
    lines = ["ply", "format ascii 1.0", f"element vertex {len(mesh.vertices)}"]
    lines += [f"property float {name}" for name in names]
    lines += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices"]
    lines += [*(f"property float {name}" for name in of_faces), "end_header"]
    lines += [_row(row) for row in np.concatenate(columns, axis=1)]
    for face, values in zip(mesh.faces, extra, strict=True):
        more = " " + _row(values) if attributes else ""
        lines.append("3 " + " ".join(map(str, face)) + more)
    return ("\n".join(lines) + "\n").encode()


def obj_bytes(mesh: MeshContent) -> bytes:
    """Return a file with one line for each number of a vertex."""
    lines = ["v " + _row(row) for row in mesh.vertices]
    uvs, normals = mesh.uvs, mesh.normals
    lines += ["vt " + _row(row) for row in (uvs if uvs is not None else ())]
    lines += ["vn " + _row(row) for row in (normals if normals is not None else ())]
    for face in mesh.faces + 1:
        uv, normal = uvs is not None, normals is not None
        form = {(0, 0): "{0}", (1, 0): "{0}/{0}", (0, 1): "{0}//{0}"}
        corner = form.get((uv, normal), "{0}/{0}/{0}")
        lines.append("f " + " ".join(corner.format(k) for k in face))
    return ("\n".join(lines) + "\n").encode()


def serialized_bytes(mesh: MeshContent, version: int) -> bytes:
    """Return a file of Mitsuba's own format with one mesh."""
    given = [x for x in (mesh.normals, mesh.uvs) if x is not None]
    flags = 0x1000 | 1 * (mesh.normals is not None) | 2 * (mesh.uvs is not None)
    content = struct.pack("<I", flags) + (b"mesh\0" if version == 4 else b"")
    content += struct.pack("<QQ", len(mesh.vertices), len(mesh.faces))
    for values in (mesh.vertices, *given):
        content += values.astype("<f4").tobytes()
    content += mesh.faces.astype("<u4").tobytes()
    offsets = struct.pack("<Q" if version == 4 else "<I", 0) + struct.pack("<I", 1)
    return struct.pack("<HH", 0x041C, version) + zlib.compress(content) + offsets


def _row(numbers: Floats) -> str:
    return " ".join(f"{x:.6g}" for x in numbers)


# ------------------------------------------------------------------------------- images


def png_bytes(pixels: Floats, bits: int) -> bytes:
    """Return a PNG of 8 or 16 bits: (height, width, 1 to 4) in [0, 1]."""
    height, width, channels = pixels.shape
    values = np.round(pixels * (2**bits - 1)).astype(">u2" if bits == 16 else "u1")
    rows = b"".join(b"\0" + row.tobytes() for row in values)
    kind = (0, 4, 2, 6)[channels - 1]
    header = struct.pack(">IIBBBBB", width, height, bits, kind, 0, 0, 0)
    content = b"\x89PNG\r\n\x1a\n"
    for tag, data in ((b"IHDR", header), (b"IDAT", zlib.compress(rows)), (b"IEND", b"")):
        content += struct.pack(">I", len(data)) + tag + data
        content += struct.pack(">I", zlib.crc32(tag + data))
    return content


def pfm_bytes(pixels: Floats) -> bytes:
    """Return a float image, (height, width, 3), whose rows go upwards."""
    height, width, _ = pixels.shape
    return f"PF\n{width} {height}\n-1.0\n".encode() + pixels[::-1].astype("<f4").tobytes()


def exr_bytes(pixels: Floats, half: bool) -> bytes:
    """Return a float image, (height, width, 3)."""
    kind = np.float16 if half else np.float32
    channels = {
        name: np.ascontiguousarray(pixels[..., k], kind) for k, name in enumerate("RGB")
    }
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "image.exr"
        OpenEXR.File(header, channels).write(str(path))
        return path.read_bytes()


# --------------------------------------------------------------- grids, curves, measured


def grid_bytes(values: Floats) -> bytes:
    """Return a grid of Mitsuba's, (z, y, x, channels)."""
    nz, ny, nx, channels = values.shape
    box = (0.0, 0.0, 0.0, 1.0, 1.0, 1.0)
    header = struct.pack("<3sB5i6f", b"VOL", 3, 1, nx, ny, nz, channels, *box)
    return header + values.astype("<f4").tobytes()


def draw_distances(rng: Random) -> Floats:
    """Return distances to a bent ball inside of a grid, (z, y, x, 1)."""
    n, m = rng.randint(3, 6), rng.randint(3, 6)
    z, y, x = (a - 0.5 for a in np.mgrid[0 : 1 : n * 1j, 0 : 1 : m * 1j, 0 : 1 : n * 1j])
    ball = np.sqrt(x * x + y * y + z * z) - 0.4
    return np.asarray((ball + 0.1 * numbers_of(rng, n, m, n) - 0.05)[..., None])


def curve_bytes(rng: Random, unit: float) -> bytes:
    """Return one or two curves of control points, each with its radius.

    `to_world` places points and leaves radii as they are: those are in units of the scene.
    """
    curves = []
    for _ in range(rng.randint(1, 2)):
        at = 2.0 * numbers_of(rng, rng.randint(4, 6), 3) - 1.0
        at[:, 0] = np.sort(at[:, 0])  # no turn that is tighter than the curve is thick
        radii = unit * (0.03 + 0.08 * numbers_of(rng, len(at), 1))
        curves.append("\n".join(map(_row, np.column_stack([at, radii]))))
    return ("\n\n".join(curves) + "\n").encode()


def merl_bytes(rng: Random) -> bytes:
    """Return a small table in the format of the MERL database."""
    counts = np.array([6, 5, 8], "<i4")
    values = (
        1500.0
        * numbers_of(rng, 3, *counts)
        * np.array([0.3, 0.25, 0.2])[:, None, None, None]
    )
    return counts.tobytes() + values.astype("<f8").tobytes()


def rgl_bytes(rng: Random) -> bytes:
    """Return small tables in the format of the RGL database, of any symmetry.

    Densities stay away from 0, where a sample's weight is large. Of isotropic files Mitsuba
    mirrors directions by a number that it never sets, so these are symmetric and have one
    azimuth.
    """
    sectors, jacobian = rng.choice((0, 1, 2, 4)), rng.random() < 0.5
    azimuths = np.zeros(1)
    if sectors:
        azimuths = np.linspace(-np.pi, 2.0 * np.pi / sectors - np.pi, rng.randint(3, 4))
    elevations = np.linspace(0.0, np.pi / 2, rng.randint(1, 3))
    angles, size = (len(azimuths), len(elevations)), rng.randint(2, 4)

    def values(*shape: int) -> Floats:
        table = 0.3 + 0.7 * numbers_of(rng, *shape)
        table[..., -1, :] = table[..., 0, :]  # a full turn later
        return table if sectors else 0.5 * (table + table[..., ::-1, :])

    colors = (0.3 if jacobian else 0.1) * values(*angles, 3, size, size)
    images = {
        "theta_i": elevations,
        "phi_i": azimuths,
        "ndf": values(3, 4),
        "sigma": values(2, 3),
        "vndf": values(*angles, rng.randint(2, 5), rng.randint(2, 5)),
        "luminance": values(*angles, size, size),
        "rgb": colors,
    }
    flags = {"description": np.zeros(1, np.uint8), "jacobian": np.array([jacobian], "u1")}
    return tensor_file({k: a.astype(np.float32) for k, a in images.items()} | flags)
