"""A second truth: Embree, by other people, with another triangle test.

Without embreex this file fails, and is not skipped: it is part of the `dev` extra. Hits
differ only where rounding decides, and that is proved for each difference in double
precision: the other's primitive is met at the same distance within the tolerance.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
import pytest
from agreement import extents_for
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from kernel_probes import FIRST_ID, accelerator, closest, directions, float32, unit
from soups import FAMILIES, Soup, awkward_rays

# Both work in single precision: a few roundings of the coordinates, seen at an angle.
TOLERANCE = 1e-5
N = 400


def embree(surfaces, origin, direction):
    """Embree's nearest primitive (column, -1: none) and its t."""
    scene = EmbreeScene()
    corner, e1, e2 = (a.T for a in (surfaces.corner, surfaces.edge1, surfaces.edge2))
    vertices = float32(np.stack((corner, corner + e1, corner + e2), axis=1))
    TriangleMesh(scene, vertices)
    found = scene.run(float32(origin), float32(direction), output=True)
    return found["primID"], found["tfar"]


class Triangle(NamedTuple):
    """One triangle and one ray in double precision."""

    corner: np.ndarray
    edge1: np.ndarray
    edge2: np.ndarray
    origin: np.ndarray
    direction: np.ndarray

    @property
    def size(self) -> float:
        """Of the coordinates that are rounded."""
        return float(sum(np.abs(a).sum() for a in self[:4]))

    @property
    def slope(self) -> float:
        """Sine of the angle to the plane; rounding of t grows with its inverse."""
        normal = np.cross(self.edge1, self.edge2)
        return float(abs(normal @ self.direction) / np.linalg.norm(normal))

    @property
    def t(self) -> float:
        """Where the ray meets the plane."""
        normal = np.cross(self.edge1, self.edge2)
        return float(normal @ (self.corner - self.origin) / (normal @ self.direction))

    def distance_to_outline(self) -> float:
        """How far from the triangle's edges the ray's line passes."""
        c, d = self.corner, self.direction
        across = np.eye(3) - np.outer(d, d)  # seen along the ray, which is a point
        corners = np.array([c, c + self.edge1, c + self.edge2]) - self.origin
        distances = []
        for a, b in itertools.pairwise((corners @ across)[[0, 1, 2, 0]]):
            along = b - a
            s = np.clip(-(a @ along) / max(along @ along, 1e-300), 0, 1)
            distances.append(float(np.linalg.norm(a + s * along)))
        return min(distances)


def rounding_decides(triangle: Triangle, other_t: float) -> bool:
    """Whether rounding alone may lose this hit, or put it behind one at `other_t`."""
    small = TOLERANCE * triangle.size
    if triangle.slope < TOLERANCE or triangle.distance_to_outline() < small:
        return True
    return min(abs(triangle.t), abs(triangle.t - other_t)) < small / triangle.slope


def differences(surfaces, rays, ours, theirs):
    """Rays on which the two disagree; and those of them that rounding does not explain.

    What one of them found nearer, the other passed: so its triangle is the one to explain.
    """
    columns = (surfaces.corner, surfaces.edge1, surfaces.edge2)
    found = [], []
    prim, their_prim = ours[0], theirs[0]
    t, their_t = (np.where(p >= 0, s, np.inf) for p, s in (ours, theirs))
    off = ~np.isclose(t, their_t, rtol=TOLERANCE, atol=0)
    for i in np.flatnonzero((prim != their_prim) | off):
        first_is_ours = t[i] <= their_t[i]
        k = prim[i] if first_is_ours else their_prim[i]
        other_t = their_t[i] if first_is_ours else t[i]
        numbers = [a[:, k] for a in columns] + [rays[0][i], unit(rays[1][i])]
        triangle = Triangle(*(np.asarray(a, float) for a in numbers))
        found[0].append(i)
        if not rounding_decides(triangle, float(other_t)):
            found[1].append((int(i), int(prim[i]), float(t[i]), int(their_prim[i])))
    return found


def hits_of(accel, rays):
    """Our nearest primitive (column, -1: none) and its t."""
    found = closest(accel, *rays)
    return np.where(found.prim >= 0, found.prim - FIRST_ID, -1), found.t


@pytest.mark.parametrize("family", FAMILIES)
def test_brute_force_and_embree_find_the_same(family):
    """Random, grazing, axis-parallel and other awkward rays on each family of soups.

    Brute force alone: that the others return its hits is shown elsewhere, bit for bit.
    """
    for soup in (Soup(N, 7, 1.0, 0.0), Soup(N // 4, 8, 1e3, 0.0)):
        surfaces = soup.triangles(family)
        rng = np.random.default_rng(soup.seed)
        rays = awkward_rays(extents_for("triangles", surfaces), 100, rng)
        ours = hits_of(accelerator("triangles", surfaces, "brute"), rays)
        theirs = embree(surfaces, *rays)
        assert (theirs[0] >= 0).any()
        assert differences(surfaces, rays, ours, theirs)[1] == []


def test_a_wrong_primitive_would_be_seen():
    """The excuses must not cover a real fault: hits lost, and t off by 1 %."""
    surfaces = Soup(N, 9, 1.0, 0.0).triangles("scattered")
    rng = np.random.default_rng(10)
    rays = float32(rng.uniform(-1.5, 1.5, (500, 3))), float32(directions(500, rng))
    prim, t = embree(surfaces, *rays)
    hit = prim >= 0
    lost = np.where(np.arange(500) % 7 == 0, -1, prim)
    unexplained = differences(surfaces, rays, (lost, t), (prim, t))[1]
    assert len(unexplained) > 0.95 * (lost != prim).sum()
    unexplained = differences(surfaces, rays, (prim, t * np.float32(1.01)), (prim, t))[1]
    assert len(unexplained) > 0.95 * hit.sum()
