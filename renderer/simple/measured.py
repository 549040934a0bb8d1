"""Measured BRDFs: f looked up in a table, of the MERL database [Matusik2003] or of RGL's.

A pair of directions is described by its half vector, and by wi relative to the half vector
[Rusinkiewicz1998]. These angles follow a highlight, so a coarse table suffices. The tables
of RGL follow it, too: for each wo, half vectors are warped to a square [Dupuy2018].
"""

from __future__ import annotations

import itertools
import math
from types import SimpleNamespace
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


class WarpedTables(Bsdf):
    """A table of the RGL database: colours by the numbers that half vectors come from.

    Half vectors follow the tabulated density of visible normals [Dupuy2018]. The colour is
    stored at the two numbers that are warped to a half vector, and so is its luminance,
    which is the density of these numbers.
    """

    oriented = True

    def __init__(self, bsdf: Any, hit: Hit) -> None:
        self.bsdf = bsdf

    def eval_pdf(self, wo: Vector, wi: Vector) -> tuple[Vector, float]:
        """Return f cos, and the density of wi."""
        if wo[2] <= 0.0 or wi[2] <= 0.0:
            return BLACK, 0.0
        turned = self._turn(wo)
        tables = self._tables(turned * wo)
        h = normalize(turned * (wo + wi))
        phi = math.atan2(h[1], h[0]) - tables.phi
        column = math.sqrt(_angle(h) / (math.pi / 2))
        row = (phi / (2.0 * math.pi) + 0.5) % 1.0
        place = tables.vndf.numbers_of(column, row)
        return self._f_cos(tables, place, column, row), self._pdf(
            tables, place, column, row, float(turned * wo @ h)
        )

    def sample(self, wo: Vector, numbers: tuple[float, float, float]) -> BsdfSample:
        """Mirror wo at a half vector: numbers by their luminance, warped to it."""
        if wo[2] <= 0.0:
            return NOTHING
        turned = self._turn(wo)
        tables = self._tables(turned * wo)
        place = tables.luminance.place_of(numbers[1], numbers[0])
        column, row = tables.vndf.place_of(*place)
        theta = column**2 * math.pi / 2
        phi = (2.0 * row - 1.0) * math.pi + tables.phi
        sine = math.sin(theta)
        h = np.array([sine * math.cos(phi), sine * math.sin(phi), math.cos(theta)])
        wi = turned * reflect(turned * wo, h)
        cosine = float(turned * wo @ h)
        if wi[2] <= 0.0 or cosine <= 0.0:
            return NOTHING
        pdf = self._pdf(tables, place, column, row, cosine)
        f_cos = self._f_cos(tables, place, column, row)
        return BsdfSample(wi, f_cos / pdf, pdf) if pdf > 0.0 else NOTHING

    def _turn(self, wo: Vector) -> Vector:
        """Return the signs of x and y that bring wo to the azimuths that are tabulated."""
        if not self.bsdf.half:
            return np.ones(3)
        back = -1.0 if wo[1] >= 0.0 else 1.0
        mirror = -1.0 if wo[0] >= 0.0 else 1.0
        return np.array([mirror if self.bsdf.quarter else back, back, 1.0])

    def _tables(self, wo: Vector) -> SimpleNamespace:
        """Return the tables for wo: means of those of the nearest tabulated directions."""
        theta, phi = _angle(wo), math.atan2(wo[1], wo[0])
        shape = tuple(int(getattr(self.bsdf, name)[1]) for name in ("phi_i", "theta_i"))
        weights = np.outer(
            _hat_weights(self.bsdf.phi_i[2:], phi),
            _hat_weights(self.bsdf.theta_i[2:], theta),
        )

        def mean(name: str, *planes: int) -> Any:
            numbers = getattr(self.bsdf, name)
            sizes = tuple(int(n) for n in numbers[:2])
            return np.tensordot(
                weights, numbers[2:].reshape(*shape, *planes, *sizes).astype(float), 2
            )

        column, row = math.sqrt(theta / (math.pi / 2)), phi / (2.0 * math.pi) + 0.5
        return SimpleNamespace(
            phi=phi if self.bsdf.isotropic else 0.0,
            area=_bilinear(_image(self.bsdf.sigma), column, row),
            vndf=BilinearDensity(mean("vndf")),
            luminance=BilinearDensity(mean("luminance")),
            rgb=mean("rgb", 3),
        )

    def _f_cos(self, tables: Any, place: Any, column: float, row: float) -> Vector:
        color = np.array([_bilinear(plane, *place) for plane in tables.rgb])
        if not self.bsdf.jacobian:
            return color
        ndf = _bilinear(_image(self.bsdf.ndf), column, row)
        return color * ndf / (4.0 * tables.area) if tables.area > 0.0 else BLACK

    def _pdf(
        self, tables: Any, place: Any, column: float, row: float, cosine: float
    ) -> float:
        """Return the density [1/sr] of the direction that a half vector mirrors wo to."""
        visible, bright = tables.vndf.at(column, row), tables.luminance.at(*place)
        sine = math.sin(column**2 * math.pi / 2)
        normals = max(2.0 * math.pi**2 * column * sine, 1e-6)
        return float(visible * bright / (normals * 4.0 * cosine))


class BilinearDensity:
    """A density on the unit square, bilinear between the numbers of a table."""

    def __init__(self, table: Any) -> None:
        self.table = table
        self.along = np.trapezoid(table, axis=1)  # by the row

    def at(self, x: float, y: float) -> float:
        """Return the density at a place."""
        return _bilinear(self.table, x, y)

    def numbers_of(self, x: float, y: float) -> tuple[float, float]:
        """Return the share of the square below y, and that of the row y left of x."""
        row = _line(self.table, y)
        return _share_below(row, x), _share_below(self.along, y)

    def place_of(self, x: float, y: float) -> tuple[float, float]:
        """Return the place whose shares are x and y."""
        row = _place_of_share(self.along, y)
        return _place_of_share(_line(self.table, row), x), row


def _image(numbers: Any) -> Any:
    """Return a table that begins with its sizes."""
    return numbers[2:].reshape(int(numbers[0]), -1).astype(float)


def _hat_weights(axis: Any, value: float) -> Vector:
    """Return the weights of tabulated values: linear between two, constant outside."""
    if len(axis) == 1:
        return np.ones(1)
    return np.array([np.interp(value, axis, unit) for unit in np.eye(len(axis))])


def _line(values: Any, place: float) -> Any:
    """Return what is at a place in [0, 1] along the first axis, linearly interpolated."""
    scaled = min(max(place, 0.0), 1.0) * (len(values) - 1)
    first = min(int(scaled), len(values) - 2)
    return values[first] + (values[first + 1] - values[first]) * (scaled - first)


def _bilinear(image: Any, x: float, y: float) -> float:
    return float(_line(_line(image, y), x))


def _share_below(values: Vector, place: float) -> float:
    """Return which share of the integral of a piecewise linear density is below a place."""
    knots = np.linspace(0.0, 1.0, len(values))
    below = np.append(knots[knots < place], place)
    part = np.trapezoid(np.interp(below, knots, values), below)
    return float(part / np.trapezoid(values, knots))


def _place_of_share(values: Vector, share: float) -> float:
    """Return the place below which a share of the integral is, by bisection."""
    low, high = 0.0, 1.0
    for _ in range(50):
        middle = (low + high) / 2
        below = _share_below(values, middle) < share
        low, high = (middle, high) if below else (low, middle)
    return (low + high) / 2
