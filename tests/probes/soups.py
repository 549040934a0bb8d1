"""Soups of triangles that break accelerators, and the rays that break them.

A soup is made from a few numbers (`Soup`), so that what Hypothesis prints of a failure
makes it again. The rays are made from boxes and hulls alone, so they serve every kind of
primitive.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st
from kernel_probes import directions, float32, triangles, unit

from renderer.plugins.shapes.extents import Extents
from renderer.scene_file.meshes.mesh import _degenerate

# The same examples in every run: a failure of one run is a failure of the next.
SAME_EXAMPLES = settings(
    deadline=None, derandomize=True, print_blob=False, database=None, max_examples=8
)


def axis_directions() -> np.ndarray:
    """The 26 neighbours of a cell as unit vectors, zeros with either sign: (56, 3)."""
    found = []
    for signs in itertools.product((-1.0, 0.0, -0.0, 1.0), repeat=3):
        if any(signs):
            found.append(np.array(signs) / np.sqrt(np.count_nonzero(signs)))
    return np.array(found)


# ------------------------------------------------------------------------------ soups


def _scattered(n: int, size: Any, rng: np.random.Generator) -> np.ndarray:
    """Triangles in random places of a cube of edge 2, edges about `size` long."""
    c = rng.uniform(-1, 1, (n, 3))
    a, b = (size * directions(n, rng) for _ in range(2))
    return np.stack((c, c + a, c + b), axis=1)


def _walls(n: int, rng: np.random.Generator) -> np.ndarray:
    """Rectangles of two triangles, on planes that halve and halve the cube again."""
    low = rng.integers(-4, 4, (n, 3))
    high = low + rng.integers(1, 5, (n, 3))
    across = rng.integers(0, 3, n)
    rows = np.arange(n)
    high[rows, across] = low[rows, across]
    first, second = low.copy(), low.copy()
    first[rows, (across + 1) % 3] = high[rows, (across + 1) % 3]
    second[rows, (across + 2) % 3] = high[rows, (across + 2) % 3]
    halves = np.stack((low, first, high), 1), np.stack((low, high, second), 1)
    return np.concatenate(halves) / 4


def _duplicates(n: int, rng: np.random.Generator) -> np.ndarray:
    """Few different triangles, many times each, some turned or seen from behind."""
    base = _scattered(1 + n // 20, 0.7, rng)[rng.integers(0, 1 + n // 20, n)]
    corners = np.array(list(itertools.permutations(range(3))))[rng.integers(0, 6, n)]
    return np.take_along_axis(base, corners[:, :, None], axis=1)


def _in_one_plane(n: int, rng: np.random.Generator) -> np.ndarray:
    """Overlapping triangles of equal t in different boxes."""
    points = _scattered(n, 0.5, rng)
    points[:, :, rng.integers(0, 3)] = 0.3
    return points


def _slivers(n: int, rng: np.random.Generator) -> np.ndarray:
    points = _scattered(n, 1.0, rng)
    points[:, 2] = points[:, :2].mean(axis=1) + 1e-5 * directions(n, rng)
    return points


def _one_huge_and_many_tiny(n: int, rng: np.random.Generator) -> np.ndarray:
    points = _scattered(n, 1e-3, rng)
    points[rng.integers(0, n)] = [[-1e3, -1e3, 0.1], [1e3, -1e3, 0.2], [0, 1e3, -0.4]]
    return points


def _all_sizes(n: int, rng: np.random.Generator) -> np.ndarray:
    """Sizes over a factor of 10^7."""
    return _scattered(n, 10.0 ** rng.uniform(-6, 1, (n, 1)), rng)


def _on_a_lattice(n: int, rng: np.random.Generator) -> np.ndarray:
    """Corners and edges that meet, planes that coincide."""
    return rng.integers(-2, 3, (n, 3, 3)).astype(float)


def _in_a_line(n: int, rng: np.random.Generator) -> np.ndarray:
    """All centres on a diagonal, or along an axis."""
    points = np.tile(_scattered(1, 0.01, rng), (n, 1, 1))
    along = [[1, 0, 0], [1, 1, 1], [0, -1, 1]][rng.integers(0, 3)]
    return points + np.linspace(-1, 1, n)[:, None, None] * np.array(along)


FAMILIES: dict[str, Callable[[int, np.random.Generator], np.ndarray]] = {
    "scattered": lambda n, rng: _scattered(n, 0.4, rng),
    "walls": _walls,
    "duplicates": _duplicates,
    "in one plane": _in_one_plane,
    "slivers": _slivers,
    "one huge and many tiny": _one_huge_and_many_tiny,
    "all sizes": _all_sizes,
    "on a lattice": _on_a_lattice,
    "in a line": _in_a_line,
}


class Soup(NamedTuple):
    """What a soup is made from; `shift` is how many times its size it lies off."""

    n: int
    seed: int
    scale: float
    shift: float

    def triangles(self, family: str) -> Any:
        """The triangles that a scene would keep of it; at least one."""
        points = FAMILIES[family](self.n, np.random.default_rng(self.seed))
        spare = np.array([[[0, 0, 0], [1, 0.25, 0], [0.5, 1, 0.5]]])
        placed = float32(self.scale * (np.concatenate((points, spare)) + self.shift))
        corners = np.arange(3 * len(placed), dtype=np.int32).reshape(-1, 3)
        kept = placed[~_degenerate(placed.reshape(-1, 3), corners)]
        return triangles(kept[:-1] if len(kept) > 1 else kept)


made_soups = st.builds(
    Soup,
    st.integers(1, 150),
    st.integers(0, 2**32 - 1),
    st.sampled_from([1.0, 1e-4, 1e4]),
    st.sampled_from([0.0, 0.0, 10.0, 1e3]),
)

# ------------------------------------------------------------------------------- rays


class Targets(NamedTuple):
    """n random primitives of some extents, and where rays may aim at them."""

    points: np.ndarray  # (n, 4, 3) corners of the hull
    radius: np.ndarray  # (n, 1) of a curved one, else 0
    normal: np.ndarray  # (n, 3) of a flat one; else random

    def at(self, weights: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Points of the surface: the corners in these proportions, (n, 4)."""
        inside = np.einsum("nk,nkx->nx", weights, self.points)
        return inside + self.radius * self.normal


def targets(extents: Extents, n: int, rng: np.random.Generator) -> Targets:
    k = rng.integers(0, extents.lower.shape[1], n)
    normal = extents.normal.T[k].astype(float)
    curved = ~normal.any(axis=1, keepdims=True)
    return Targets(
        extents.points.T[k].astype(float).reshape(n, 4, 3),
        np.where(curved, extents.radius[k, None], 0.0),
        np.where(curved, directions(n, rng), normal),
    )


def awkward_rays(
    extents: Extents, n: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """n rays of each of nine ways to be awkward; origins and directions, (9 n, 3) each."""
    low, high = extents.lower.min(axis=1), extents.upper.max(axis=1)
    size = float((high - low).max())
    one_corner = np.eye(4)[rng.integers(0, 4, n)]
    other_corner = np.eye(4)[rng.integers(0, 4, n)]
    share = rng.random((n, 1))
    edge = share * one_corner + (1 - share) * other_corner
    inside = rng.dirichlet(np.ones(4), n)
    anywhere = rng.uniform(low - size / 2, high + size / 2, (n, 3))
    rays = [(anywhere, directions(n, rng))]

    def aimed(target: np.ndarray, direction: np.ndarray, near: float, far: float) -> None:
        distance = size * 10.0 ** rng.uniform(near, far, (n, 1))
        rays.append((target - distance * direction, direction))

    for weights in (edge, one_corner):
        aimed(targets(extents, n, rng).at(weights, rng), directions(n, rng), -2, 1)
    aimed(targets(extents, n, rng).at(inside, rng), directions(n, rng), 2, 4)

    grazed = targets(extents, n, rng)
    tilt = 10.0 ** rng.uniform(-7, -2, (n, 1))
    in_plane = unit(np.cross(grazed.normal, directions(n, rng)))
    aimed(grazed.at(edge, rng), unit(in_plane + tilt * grazed.normal), -1, 1)

    axes = axis_directions()[rng.integers(0, 56, (2, n))]
    planes = np.stack([targets(extents, n, rng).at(one_corner, rng) for _ in range(3)])
    on_planes = np.stack([planes[axis, :, axis] for axis in range(3)], axis=1)
    rays.append((on_planes, axes[0]))
    outside = on_planes - size * np.round(2 * axes[1])
    rays.append((np.where(axes[1] == 0, on_planes, outside), axes[1]))

    rays.append((targets(extents, n, rng).at(inside, rng), directions(n, rng)))  # from it
    k = rng.integers(0, extents.lower.shape[1], n)
    corner = np.where(rng.random((n, 3)) < 0.5, extents.lower.T[k], extents.upper.T[k])
    rays.append((corner, unit(grazed.at(inside, rng) - corner + 1e-30)))  # from its box
    origin, direction = (float32(np.concatenate(part)) for part in zip(*rays, strict=True))
    return origin, direction


def ends_of(t: np.ndarray) -> dict[str, np.ndarray]:
    """Ends of rays whose hit is at t: just before it, at it, just after it."""
    return {
        "before": np.nextafter(t, np.float32(0)),
        "at": t,
        "after": np.nextafter(t, np.float32(np.inf)),
    }
