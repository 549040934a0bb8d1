"""Make every mesh in this folder, and the places of copies: `python scenes/make_meshes.py`.

The files are committed, so nobody has to run this; a test checks that it still makes the
same bytes. Coordinates are rounded to six decimals first, because the last bits of sine
and cosine differ between processors.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from make_textures import relief
from newell_teapot import teapot_mesh
from numpy.typing import NDArray

HERE = Path(__file__).parent
Points = NDArray[np.float64]
Faces = NDArray[np.int64]


# ------------------------------------------------------------------------ shapes


def grid_faces(rows: int, columns: int) -> Faces:
    """Return two triangles for each cell of a grid of vertices, (F, 3)."""
    corner = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    return np.stack((a, b, c, a, c, d), axis=-1).reshape(-1, 3)


def torus(
    major: float, minor: float, around: int, across: int
) -> tuple[Points, Points, Points, Faces]:
    """Return a torus around z: vertices, normals, uv, faces; the seams are doubled."""
    u = np.linspace(0.0, 1.0, around + 1)[None, :]
    v = np.linspace(0.0, 1.0, across + 1)[:, None]
    phi, theta = 2 * np.pi * u, 2 * np.pi * v
    normals = np.stack(
        np.broadcast_arrays(
            np.cos(theta) * np.cos(phi), np.cos(theta) * np.sin(phi), np.sin(theta)
        ),
        axis=-1,
    )
    ring = np.stack(np.broadcast_arrays(np.cos(phi), np.sin(phi), 0 * v), axis=-1)
    uv = np.stack(np.broadcast_arrays(u, v), axis=-1)
    return (
        (major * ring + minor * normals).reshape(-1, 3),
        normals.reshape(-1, 3),
        uv.reshape(-1, 2),
        grid_faces(across + 1, around + 1),
    )


def lathe(profile: Points, around: int) -> tuple[Points, Points, Points, Faces]:
    """Turn a profile (N, 2) of (radius, z), bottom to top, around z; uv runs along both."""
    phi = np.linspace(0.0, 2 * np.pi, around + 1)[None, :]
    r, z = profile[:, :1], profile[:, 1:]
    slope = np.gradient(profile, axis=0)
    dr, dz = slope[:, :1], slope[:, 1:]
    vertices = np.stack(np.broadcast_arrays(r * np.cos(phi), r * np.sin(phi), z), axis=-1)
    normals = np.stack(
        np.broadcast_arrays(dz * np.cos(phi), dz * np.sin(phi), -dr), axis=-1
    )
    normals = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    u = np.linspace(0.0, 1.0, around + 1)[None, :]
    v = np.linspace(0.0, 1.0, len(profile))[:, None]
    uv = np.stack(np.broadcast_arrays(u, v), axis=-1)
    faces = grid_faces(len(profile), around + 1)
    return vertices.reshape(-1, 3), normals.reshape(-1, 3), uv.reshape(-1, 2), faces


def icosphere(levels: int) -> tuple[Points, Faces]:
    """Return a unit sphere: an icosahedron, each triangle cut in four `levels` times."""
    golden = (1 + 5**0.5) / 2
    flat = [(-1.0, golden), (1.0, golden), (-1.0, -golden), (1.0, -golden)]
    points = [(a, b, 0.0) for a, b in flat]
    points += [(0.0, a, b) for a, b in flat]
    points += [(b, 0.0, a) for a, b in flat]
    vertices = np.array(points)
    distance = np.linalg.norm(vertices[:, None] - vertices[None], axis=-1)
    near = np.isclose(distance, 2.0)  # the edge length
    triples = [
        (i, j, k)
        for i in range(12)
        for j in range(i + 1, 12)
        for k in range(j + 1, 12)
        if near[i, j] and near[j, k] and near[i, k]
    ]
    faces = np.array(
        [t if np.linalg.det(vertices[list(t)]) > 0 else (t[0], t[2], t[1]) for t in triples]
    )
    for _ in range(levels):
        edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        unique, inverse = np.unique(edges, axis=0, return_inverse=True)
        middle = inverse.reshape(-1, 3) + len(vertices)
        vertices = np.concatenate((vertices, vertices[unique].mean(axis=1)))
        (a, b, c), (ab, bc, ca) = faces.T, middle.T
        faces = np.concatenate(
            [
                np.stack(t, axis=-1)
                for t in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))
            ]
        )
    return vertices / np.linalg.norm(vertices, axis=1, keepdims=True), faces


def pebble() -> tuple[Points, Faces]:
    """Return a sphere with waves on it: round enough for vertex normals to show."""
    vertices, faces = icosphere(3)
    x, y, z = vertices.T
    wave = np.sin(5 * x + 1) * np.sin(4 * y) * np.cos(6 * z) + 0.5 * np.sin(7 * y + 3 * z)
    return vertices * (1 + 0.12 * wave)[:, None], faces


def crystal() -> tuple[Points, Faces]:
    """Return a double pyramid over a hexagon, without shared vertices: flat sides."""
    angle = np.arange(6) * np.pi / 3
    ring = np.stack((np.cos(angle), np.sin(angle), 0 * angle), axis=-1)
    top, bottom = np.array([0, 0, 1.8]), np.array([0, 0, -1.2])
    triangles = [
        corners
        for k in range(6)
        for corners in (
            (ring[k], ring[(k + 1) % 6], top),
            (ring[(k + 1) % 6], ring[k], bottom),
        )
    ]
    return np.array(triangles).reshape(-1, 3), np.arange(36).reshape(-1, 3)


def shell(along: int, around: int) -> tuple[Points, Points, Faces]:
    """Return a snail's shell: a tube that turns around z and grows; right-handed.

    p(s, v) = g (q cos, q sin, sin v / 2) with g = e^s, q = 1 + cos(v) / 2, a turn for each
    0.75 of s, and the tip on top.
    """
    s = np.linspace(-2.4, 0.0, along + 1)[:, None]
    v = np.linspace(0.0, 2 * np.pi, around + 1)[None, :]
    turn = 2 * np.pi / 0.75
    growth, cos, sin = np.exp(s), np.cos(turn * s), np.sin(turn * s)
    q, dq = 1 + 0.5 * np.cos(v), -0.5 * np.sin(v)
    height = 0.5 * np.sin(v) - 1.9  # below the tip, which is at 0
    vertices = growth[..., None] * _stacked(q * cos, q * sin, height)
    along_s = vertices + growth[..., None] * turn * _stacked(-q * sin, q * cos, 0 * v)
    along_v = growth[..., None] * _stacked(dq * cos, dq * sin, 0.5 * np.cos(v))
    normals = np.cross(along_v, along_s).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    faces = grid_faces(along + 1, around + 1)[:, ::-1]
    return vertices.reshape(-1, 3) + np.array([0.0, 0.0, 2.4]), -normals, faces


def _stacked(x: Points, y: Points, z: Points) -> Points:
    return np.stack(np.broadcast_arrays(x, y, z), axis=-1)


def displaced_square(rows: int, height: float) -> tuple[Points, Points, Faces]:
    """Return the relief of `make_textures` as a mesh over [-1, 1]^2: points, normals."""
    v, u = np.mgrid[0 : rows + 1, 0 : rows + 1] / rows
    step = 1e-4
    along = (relief(u + step, v) - relief(u - step, v)) / (2 * step) * height / 2
    across = (relief(u, v + step) - relief(u, v - step)) / (2 * step) * height / 2
    normals = _stacked(-along, -across, np.ones_like(u)).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = _stacked(2 * u - 1, 2 * v - 1, height * relief(u, v)).reshape(-1, 3)
    return points, normals, grid_faces(rows + 1, rows + 1)


def vase_profile() -> Points:
    """Return (radius, z) of a vase of height 2, from the foot to the lip."""
    t = np.linspace(0.0, 1.0, 25)
    radius = 0.42 + 0.28 * np.sin(2 * np.pi * (t + 0.02)) * (1 - 0.25 * t) + 0.1 * t
    return np.stack((radius, 2.0 * t), axis=-1)


def studio_sweep() -> tuple[Points, Points, list[tuple[int, ...]]]:
    """Return a photographer's backdrop: floor, bend and wall in one, as wide quads.

    The floor is z = 0 towards -y, the wall y = 4; the bend between them has radius 3.
    """
    angle = np.linspace(0.0, np.pi / 2, 13)
    y = np.concatenate(([-30.0], 1 + 3 * np.sin(angle), [4.0]))
    z = np.concatenate(([0.0], 3 - 3 * np.cos(angle), [30.0]))
    turn = np.concatenate(([0.0], angle, [np.pi / 2]))
    points = np.stack([(x, b, c) for b, c in zip(y, z, strict=True) for x in (-40.0, 40.0)])
    normals = np.stack([(0.0, -np.sin(a), np.cos(a)) for a in turn])
    quads = [(2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2) for k in range(len(y) - 1)]
    return points, np.repeat(normals, 2, axis=0), quads


# ------------------------------------------------------------------------- files


def rounded(values: Points) -> Points:
    """Round to six decimals, and turn -0 into 0."""
    return np.round(values, 6) + 0.0


def write_ply(
    path: Path,
    vertices: Points,
    faces: Faces,
    normals: Points | None = None,
    uv: Points | None = None,
    form: str = "binary_little_endian",
) -> None:
    """Write a triangle mesh as PLY in one of the three forms."""
    names, columns = ["x", "y", "z"], [vertices]
    if normals is not None:
        names, columns = [*names, "nx", "ny", "nz"], [*columns, normals]
    if uv is not None:
        names, columns = [*names, "u", "v"], [*columns, uv]
    table = rounded(np.concatenate(columns, axis=1))
    header = ["ply", f"format {form} 1.0", "comment made by scenes/make_meshes.py"]
    header += [f"element vertex {len(table)}", *(f"property float {n}" for n in names)]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    header += ["end_header", ""]
    if form == "ascii":
        body = "".join(" ".join(f"{x:g}" for x in row) + "\n" for row in table)
        body += "".join(f"3 {a} {b} {c}\n" for a, b, c in faces)
        data = body.encode()
    else:
        order = "<" if form == "binary_little_endian" else ">"
        records = np.empty(len(faces), dtype=[("n", "u1"), ("index", order + "i4", 3)])
        records["n"], records["index"] = 3, faces
        data = table.astype(order + "f4").tobytes() + records.tobytes()
    write(path, "\n".join(header).encode() + data)


def write_obj(
    path: Path,
    vertices: Points,
    faces: Faces | list[tuple[int, ...]],
    normals: Points | None = None,
    uv: Points | None = None,
) -> None:
    """Write polygons as OBJ; normals and uv, if there, go with the vertices one to one."""
    lines = ["# made by scenes/make_meshes.py"]
    for keyword, table in (("v", vertices), ("vt", uv), ("vn", normals)):
        if table is not None:
            lines += [
                " ".join((keyword, *(f"{x:g}" for x in row))) for row in rounded(table)
            ]
    corner = {
        (False, False): "{0}",
        (False, True): "{0}/{0}",
        (True, False): "{0}//{0}",
        (True, True): "{0}/{0}/{0}",
    }[normals is not None, uv is not None]
    lines += [" ".join(("f", *(corner.format(i + 1) for i in face))) for face in faces]
    write(path, ("\n".join(lines) + "\n").encode())


def write_copies(path: Path, group: str, rows: int) -> None:
    """Write `rows` x `rows` instances, each turned, scaled, tilted and placed at random.

    Every third is mirrored, every fourth flattened.
    """
    rng = np.random.default_rng(1)
    lines = ['<scene version="3.0.0">', "    <!-- made by scenes/make_meshes.py -->"]
    for k in range(rows * rows):
        size = 0.26 * 1.8 ** rng.uniform(-1, 1)
        x = -size if k % 3 == 0 else size
        z = 0.6 * size if k % 4 == 0 else size
        tilt, spin = rng.uniform(-50, 50), rng.uniform(0, 360)
        place = np.array(divmod(k, rows)) - (rows - 1) / 2 + rng.uniform(-0.3, 0.3, 2)
        place *= 1.2
        lines.append(
            f'    <shape type="instance"><ref id="{group}"/><transform name="to_world">'
            f'<scale x="{x:.4f}" y="{size:.4f}" z="{z:.4f}"/>'
            f'<rotate x="1" angle="{tilt:.3f}"/><rotate z="1" angle="{spin:.3f}"/>'
            f'<translate x="{place[0]:.4f}" y="{place[1]:.4f}"/></transform></shape>'
        )
    write(path, "\n".join([*lines, "</scene>", ""]).encode())


def write(path: Path, data: bytes) -> None:
    """Write a file and the folder that it is in."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)


def main(folder: Path = HERE) -> None:
    """Write every mesh of every scene under `folder`."""
    vertices, normals, faces = teapot_mesh()
    assert len(faces) == 6320, "32 patches of 200 triangles less 80 at the poles"
    # A scene reads files in its own folder alone, so that each has a teapot of its own.
    for scene in ("appel-teapot", "many-lights", "metals"):
        write_ply(folder / scene / "meshes/teapot.ply", vertices, faces, normals)

    points, sweep_normals, quads = studio_sweep()
    write_obj(folder / "appel-teapot/meshes/sweep.obj", points, quads, sweep_normals)

    # No normals in this file: both renderers compute the same ones.
    write_obj(folder / "smooth-mesh/meshes/pebble.obj", *pebble())

    write_ply(folder / "emitters/meshes/crystal.ply", *crystal(), form="ascii")

    ring, ring_normals, ring_uv, ring_faces = torus(1.0, 0.4, 36, 18)
    for scene in ("white-furnace", "depth-and-normals"):
        path = folder / scene / "meshes/torus.ply"
        write_ply(path, ring, ring_faces, ring_normals, ring_uv, form="binary_big_endian")

    shell_points, shell_normals, shell_faces = shell(40, 9)
    write_ply(
        folder / "instances/meshes/shell.ply", shell_points, shell_faces, shell_normals
    )
    write_copies(folder / "instances/meshes/copies.xml", "shell", 20)

    points, slopes, faces = displaced_square(64, 0.16)
    write_ply(folder / "bumps/meshes/displaced.ply", points, faces, slopes)

    vase, vase_normals, vase_uv, vase_faces = lathe(vase_profile(), 32)
    path = folder / "textured-room/meshes/vase.obj"
    write_obj(path, vase, vase_faces, vase_normals, vase_uv)


if __name__ == "__main__":
    main()
