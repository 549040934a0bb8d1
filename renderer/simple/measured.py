"""A measured material: f looked up in a table of the MERL database [Matusik2003].

A pair of directions is described by its half vector, and by where wi is as seen from there
[Rusinkiewicz1998]: angles that follow a highlight, so that a table of them can be coarse.
"""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from renderer.simple.bsdfs import BLACK, NOTHING, Bsdf, BsdfSample, reflect
from renderer.simple.camera import Vector, normalize, square_to_cosine_hemisphere
from renderer.simple.shapes import Hit


class Measured(Bsdf):
    """A table over theta_h, theta_d and phi_d, linear between the centres of its cells.

    theta_h is spaced by its square: the cells near a highlight are small. Directions
    are chosen by their cosine, or by a half vector, of which the reader of the scene says
    how often theta_h is in each of its cells.
    """

    def __init__(self, bsdf: Any, hit: Hit) -> None:
        self.shape = tuple(int(n) for n in (bsdf.theta_h, bsdf.theta_d, bsdf.phi_d))
        self.table = np.reshape(bsdf.f, (3, *self.shape))
        self.cumulated = np.asarray(bsdf.cumulated, np.float64)
        self.share_of_cosine = bsdf.share_of_cosine

    def eval_pdf(self, wo: Vector, wi: Vector) -> tuple[Vector, float]:
        """Return f cos and density of both ways to choose wi."""
        if wo[2] <= 0.0 or wi[2] <= 0.0:
            return BLACK, 0.0
        h = normalize(wo + wi)
        by_half = self._half_vector_pdf(_angle(h)) / (4.0 * float(wo @ h))
        by_cosine = wi[2] / math.pi
        share = self.share_of_cosine
        return self._look_up(h, wi) * wi[2], share * by_cosine + (1.0 - share) * by_half

    def sample(self, wo: Vector, numbers: tuple[float, float, float]) -> BsdfSample:
        """Choose wi by its cosine, or mirror wo at a half vector."""
        if wo[2] <= 0.0:
            return NOTHING
        x, y, choice = numbers
        if choice < self.share_of_cosine:
            return self.chosen(wo, square_to_cosine_hemisphere(x, y))
        return self.chosen(wo, reflect(wo, self._sample_half_vector(x, y)))

    def _look_up(self, h: Vector, wi: Vector) -> Vector:
        """Return f: the mean of eight cells, by how near their centres are."""
        theta, phi = _angle(h), math.atan2(h[1], h[0])
        # turn everything so that h becomes the z axis: about z, then about y
        x = math.cos(phi) * wi[0] + math.sin(phi) * wi[1]
        y = math.cos(phi) * wi[1] - math.sin(phi) * wi[0]
        x, z = (
            math.cos(theta) * x - math.sin(theta) * wi[2],
            math.sin(theta) * x + math.cos(theta) * wi[2],
        )
        spaced = (
            math.sqrt(theta / (math.pi / 2)),
            _angle(np.array([x, y, z])) / (math.pi / 2),
            math.atan2(y, x) / math.pi % 1.0,  # light that goes back has the same f
        )
        places = np.array(spaced) * self.shape - 0.5
        # the first two end, phi_d goes round
        places[:2] = np.clip(places[:2], 0.0, np.array(self.shape[:2]) - 1.0)
        first = np.floor(places).astype(int)
        far = places - first
        f = np.zeros(3)
        for corner in itertools.product((0, 1), repeat=3):
            i, j, k = first + corner
            near = np.prod(np.where(corner, far, 1.0 - far))
            if near > 0.0:
                f += near * self.table[:, i, j, k % self.shape[2]]
        return f

    def _edges(self, cell: int) -> tuple[float, float]:
        """Return the cosines between which a cell of theta_h lies, the larger one first."""
        begin, end = (math.pi / 2 * ((cell + i) / self.shape[0]) ** 2 for i in (0, 1))
        return math.cos(begin), math.cos(end)

    def _half_vector_pdf(self, theta: float) -> float:
        """Return the density [1/sr] of half vectors: the same all over a cell."""
        spaced = math.sqrt(theta / (math.pi / 2)) * self.shape[0]
        cell = int(min(spaced, self.shape[0] - 1))
        near, far = self._edges(cell)
        share = self.cumulated[cell + 1] - self.cumulated[cell]
        return float(share / (2.0 * math.pi * (near - far)))

    def _sample_half_vector(self, x: float, y: float) -> Vector:
        """Choose a cell of theta_h by the shares, and a direction inside of it evenly."""
        cell = int(np.searchsorted(self.cumulated[1:-1], x, side="right"))
        begin, end = self.cumulated[cell : cell + 2]
        near, far = self._edges(cell)
        cosine = near + (far - near) * min((x - begin) / (end - begin), 1.0)
        sine, phi = math.sqrt(max(1.0 - cosine**2, 0.0)), 2.0 * math.pi * y
        return np.array([sine * math.cos(phi), sine * math.sin(phi), cosine])


def _angle(v: Vector) -> float:
    """Return the angle between a unit vector and z; an arc cosine would lose digits."""
    return math.atan2(math.hypot(v[0], v[1]), v[2])
