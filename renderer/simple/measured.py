"""A measured BRDF: f looked up in a table of the MERL database [Matusik2003].

A pair of directions is described by its half vector, and by wi relative to the half vector
[Rusinkiewicz1998]. These angles follow a highlight, so a coarse table suffices.
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
    """A table over theta_h, theta_d and phi_d, interpolated between cell centres.

    theta_h is spaced by its square, so cells near a highlight are small. Directions are
    sampled by the cosine, or by a half vector. The scene reader computes the probability of
    each cell of theta_h.
    """

    def __init__(self, bsdf: Any, hit: Hit) -> None:
        self.shape = tuple(int(n) for n in (bsdf.theta_h, bsdf.theta_d, bsdf.phi_d))
        self.table = np.reshape(bsdf.f, (3, *self.shape))
        self.cumulated = np.asarray(bsdf.cumulated, np.float64)
        self.share_of_cosine = bsdf.share_of_cosine

    def eval_pdf(self, wo: Vector, wi: Vector) -> tuple[Vector, float]:
        """Return f cos, and the combined density of both ways of sampling wi."""
        if wo[2] <= 0.0 or wi[2] <= 0.0:
            return BLACK, 0.0
        h = normalize(wo + wi)
        by_half = self._half_vector_pdf(_angle(h)) / (4.0 * float(wo @ h))
        by_cosine = wi[2] / math.pi
        share = self.share_of_cosine
        return self._look_up(h, wi) * wi[2], share * by_cosine + (1.0 - share) * by_half

    def sample(self, wo: Vector, numbers: tuple[float, float, float]) -> BsdfSample:
        """Sample wi by the cosine, or mirror wo at a sampled half vector."""
        if wo[2] <= 0.0:
            return NOTHING
        x, y, choice = numbers
        if choice < self.share_of_cosine:
            return self.chosen(wo, square_to_cosine_hemisphere(x, y))
        return self.chosen(wo, reflect(wo, self._sample_half_vector(x, y)))

    def _look_up(self, h: Vector, wi: Vector) -> Vector:
        """Return f, interpolated trilinearly from eight cells."""
        theta, phi = _angle(h), math.atan2(h[1], h[0])
        # rotate so that h becomes the z axis: about z, then about y
        x = math.cos(phi) * wi[0] + math.sin(phi) * wi[1]
        y = math.cos(phi) * wi[1] - math.sin(phi) * wi[0]
        x, z = (
            math.cos(theta) * x - math.sin(theta) * wi[2],
            math.sin(theta) * x + math.cos(theta) * wi[2],
        )
        spaced = (
            math.sqrt(theta / (math.pi / 2)),
            _angle(np.array([x, y, z])) / (math.pi / 2),
            math.atan2(y, x) / math.pi % 1.0,  # reciprocal: f repeats after half a turn
        )
        places = np.array(spaced) * self.shape - 0.5
        # theta_h and theta_d are clamped, phi_d wraps
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
        """Return the cosines of the limits of a theta_h cell, the larger one first."""
        begin, end = (math.pi / 2 * ((cell + i) / self.shape[0]) ** 2 for i in (0, 1))
        return math.cos(begin), math.cos(end)

    def _half_vector_pdf(self, theta: float) -> float:
        """Return the density [1/sr] of half vectors, which is constant in a cell."""
        spaced = math.sqrt(theta / (math.pi / 2)) * self.shape[0]
        cell = int(min(spaced, self.shape[0] - 1))
        near, far = self._edges(cell)
        share = self.cumulated[cell + 1] - self.cumulated[cell]
        return float(share / (2.0 * math.pi * (near - far)))

    def _sample_half_vector(self, x: float, y: float) -> Vector:
        """Sample a cell of theta_h by its probability, and a direction in it uniformly."""
        cell = int(np.searchsorted(self.cumulated[1:-1], x, side="right"))
        begin, end = self.cumulated[cell : cell + 2]
        near, far = self._edges(cell)
        cosine = near + (far - near) * min((x - begin) / (end - begin), 1.0)
        sine, phi = math.sqrt(max(1.0 - cosine**2, 0.0)), 2.0 * math.pi * y
        return np.array([sine * math.cos(phi), sine * math.sin(phi), cosine])


def _angle(v: Vector) -> float:
    """Return the angle between a unit vector and z; an arc cosine would lose digits."""
    return math.atan2(math.hypot(v[0], v[1]), v[2])
