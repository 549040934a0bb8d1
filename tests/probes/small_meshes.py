"""Mesh files of a bumpy patch."""

from __future__ import annotations

import numpy as np
from kernel_probes import unit


def write_meshes(folder):
    """A bumpy patch of 5 x 5 points, with normals and uv, and without."""
    grid = np.linspace(-1, 1, 5)
    rng = np.random.default_rng(30)
    points = [(x, y, 0.3 * rng.random()) for y in grid for x in grid]
    lines = ["v {:.6f} {:.6f} {:.6f}".format(*p) for p in points]
    uvs = ["vt {:.6f} {:.6f}".format(*rng.random(2)) for _ in points]
    tilt = unit(np.column_stack((rng.uniform(-0.3, 0.3, (25, 2)), np.ones(25))))
    normals = ["vn {:.6f} {:.6f} {:.6f}".format(*n) for n in tilt]
    smooth, plain = [], []
    for j in range(4):
        for i in range(4):
            a = 5 * j + i + 1
            for face in ((a, a + 1, a + 6), (a, a + 6, a + 5)):
                smooth.append("f " + " ".join(f"{v}/{v}/{v}" for v in face))
                plain.append("f " + " ".join(map(str, face)))
    (folder / "smooth.obj").write_text("\n".join(lines + uvs + normals + smooth) + "\n")
    (folder / "plain.obj").write_text("\n".join(lines + plain) + "\n")
