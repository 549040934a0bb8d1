"""Bounds of lights for importance sampling, and a tree over many lights.

The bounds of a light are its position, power and emitted directions.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import by_columns
from renderer.plugins.lights.choice import MOST_ENTRIES, UNIFORM, LightChoice
from renderer.plugins.lights.importance import LightNodes
from renderer.plugins.lights.sky_by_place import NOWHERE
from renderer.plugins.sampling.numbers_and_warps import MOST_BY_PAIR

_ANY_WAY = (0.0, 0.0, 1.0)
_CLOSED = 0.01  # relative length of the sum of area vectors that counts as a closed surface


class LightBounds(NamedTuple):
    """A ball that contains the light, and the cone of its emission.

    A finite light contributes about intensity / distance^2 to a surface that faces it; a
    light at infinity contributes `strength` itself.
    """

    center: Any  # (3,) world
    radius: float  # of the bounding ball
    strength: float  # [W/sr], mean of RGB; at infinity the irradiance [W/m^2]
    axis: Any  # (3,) unit: axis of the cone; at infinity towards the light
    # [rad] Half angles. Up to `spread` from the axis emission is full. Beyond, it falls as
    # the cosine of the angle to `spread`, and is 0 beyond spread + reach; reach <= pi / 2.
    spread: float
    reach: float
    at_infinity: bool = False


def all_around(center: Any, intensity: float) -> LightBounds:
    """Return the bounds of a point light that emits in all directions."""
    return LightBounds(center, 0.0, intensity, _ANY_WAY, math.pi, 0.0)


def in_cone(
    center: Any, intensity: float, axis: Any, spread: float, reach: float
) -> LightBounds:
    """Return the bounds of a point light that emits into a cone; `axis` has any length.

    The cosine falloff is negative for angles beyond 90 degrees from `spread`. So if `reach`
    exceeds 90 degrees, `spread` is increased by the rest.
    """
    rest = max(reach - 0.5 * math.pi, 0.0)
    return LightBounds(center, 0.0, intensity, _unit(axis), spread + rest, reach - rest)


def from_direction(irradiance: float, to_light: Any) -> LightBounds:
    """Return the bounds of a light at infinity in one direction."""
    return LightBounds(
        np.zeros(3), 0.0, irradiance, _unit(to_light), 0.0, 0.0, at_infinity=True
    )


def from_everywhere(radiance: float) -> LightBounds:
    """Return the bounds of an environment by its mean radiance [W/m^2/sr]."""
    irradiance = math.pi * radiance
    return LightBounds(
        np.zeros(3), 0.0, irradiance, _ANY_WAY, math.pi, 0.0, at_infinity=True
    )


def on_surface(
    points: NDArray[np.float64],
    margin: NDArray[np.float64],
    normals: NDArray[np.float64],
    areas: NDArray[np.float64],
    radiance: float,
) -> LightBounds:
    """Return the bounds of a surface that emits on the side of its normals.

    Parameters
    ----------
    points, margin
        (3, k, n) and (n,): primitive i is in the hull of its k points, grown by its
        margin.
    normals
        (3, n) on the emitting side; 0 where a primitive is not flat.
    areas
        (n,)
    radiance
        Mean radiance [W/m^2/sr].
    """
    corners = points.reshape(3, -1)
    grown = np.broadcast_to(margin, points.shape[1:]).ravel()
    center = 0.5 * ((corners - grown).min(axis=1) + (corners + grown).max(axis=1))
    away = np.linalg.norm(corners - center[:, None], axis=0)
    axis = normals @ areas
    facing = float(np.linalg.norm(axis))  # projected area along the axis, if flat
    spread = math.pi
    closed = facing < _CLOSED * areas.sum()
    if not closed and np.abs(normals).max(axis=0).all():
        spread = float(angles_from(axis / facing, normals.T).max())
    # the mean projected area of a convex surface is a fourth of its area (Cauchy)
    seen = max(facing, 0.25 * float(areas.sum()))
    return LightBounds(
        center,
        float((away + grown).max()),
        radiance * seen,
        _ANY_WAY if closed else _unit(axis),
        spread,
        0.5 * math.pi,
    )


def angles_from(axis: Any, others: Any) -> NDArray[np.float64]:
    """Return the angles [rad] between unit vectors (3,) and (n, 3).

    Computed from the distance of the vectors, since the arc cosine is inaccurate for small
    angles: it gives 0.0002 for two equal normals in single precision.
    """
    apart = 0.5 * np.linalg.norm(others - axis, axis=1)
    return np.asarray(2.0 * np.arcsin(np.minimum(apart, 1.0)))


def _unit(axis: Any) -> NDArray[np.float64]:
    given = np.asarray(axis, np.float64)
    return np.asarray(given / np.linalg.norm(given))


# --------------------------------------------------------------------------------- tree
# Builds the list and the trees of lights from their bounds.
#
# A node is split along the direction of the largest variance of its lights (in position
# and axis), weighted by their strength. The split minimises the variance within the
# halves: Ward's criterion [Ward1963] along one direction.

# Up to this many finite lights are listed; more lights form this many trees.
LISTED = 64
WIDTH = 8  # children of a node of these trees
# Distance of two perpendicular axes, in diagonals of the lights' bounding box
_TURN = 0.5
_LEAST_SHARE = 8  # each side of a split has at least 1 / 8 of the lights
# Smallest radius of a ball, in diagonals of the lights' bounding box: keeps the importance
# finite at the position of a light.
_SMALLEST_RADIUS = 1e-5
_LEAST_REACH = 0.01  # [rad] rounding at the edge of a cone


class _Tree(NamedTuple):
    """Binary tree; the two children of a node are adjacent, behind their parent."""

    start: NDArray[np.int64]  # (m,) rank of the node's first light
    stop: NDArray[np.int64]
    child: NDArray[np.int64]  # (m,) first of two children, -1: a leaf
    order: NDArray[np.int64]  # (n,) light id by rank

    def lights(self, node: int) -> NDArray[np.int64]:
        """Return the lights below a node."""
        return self.order[self.start[node] : self.stop[node]]


def light_choice(
    bounds: Sequence[LightBounds],
    sides: Any,
    environment: int,
    *,
    by_pair: bool,
    by_place: bool = False,
    sampled: NDArray[np.int32] | None = None,
) -> LightChoice | None:
    """Return the record for the selection of lights; None for too many at infinity.

    Parameters
    ----------
    bounds
        One for each light id.
    sides
        (BSDFs,) `importance.IN_FRONT`, `BOTH_SIDES` or `ANY_NORMAL`.
    environment
        The light that rays find which hit nothing. -1 if there is none, or if it has no
        light samples.
    by_pair
        Whether the first random number selects the light, and is rescaled. It is better
        stratified than the fourth.
    by_place
        Whether the selection ignores surface normals; points in media have none.
    sampled
        Ids of the lights that may be selected; None: all.
    """
    able = np.arange(len(bounds)) if sampled is None else sampled
    table = _Columns.of(bounds)
    finite, infinite = (able[table.at_infinity[able] == k] for k in (False, True))
    listed = min(LISTED, MOST_ENTRIES - len(infinite))
    if listed < 1:
        return None
    tree = _build(table, finite)
    # in the order of the file, where the roots are single lights
    roots = _opened(tree, table, 0, listed) if finite.size else []
    nodes = sorted(roots, key=lambda node: int(tree.lights(node).min()))
    below = [tree.lights(node) for node in nodes] + [np.array([k]) for k in infinite]
    entries = np.argsort([lights.min() for lights in below], kind="stable")
    entry = np.zeros(len(bounds), np.int64)
    for place, node in enumerate(entries):
        entry[below[node]] = place

    children, child = [], []
    stop = [int(tree.stop[node]) for node in nodes] + [0] * len(infinite)
    nodes += [-1] * len(infinite)
    for node, lights in zip(nodes, below, strict=False):  # the loop appends to both
        opened = [] if len(lights) == 1 else _opened(tree, table, node, WIDTH)
        children.append(len(opened))
        child.append(len(nodes) if opened else int(lights[0]))
        nodes += opened
        below += [tree.lights(k) for k in opened]
        stop += [int(tree.stop[k]) for k in opened]
    rank = np.zeros(len(bounds), np.int64)
    rank[tree.order] = np.arange(len(finite))
    children, child, stop, entries, far, entry, rank, sides = (
        np.ascontiguousarray(column, np.int32)
        for column in (
            children,
            child,
            stop,
            entries,
            table.at_infinity[[int(below[node][0]) for node in entries]],
            entry,
            rank,
            sides,
        )
    )
    return LightChoice(
        len(able),
        np.ascontiguousarray(able, np.int32),
        _nodes(table, below),
        children,
        child,
        stop,
        WIDTH,
        entries,
        far,
        entry,
        rank,
        sides,
        environment,
        NOWHERE,
        int(by_pair and len(able) <= MOST_BY_PAIR * UNIFORM),
        int(by_place),
    )


class _Columns(NamedTuple):
    """Bounds by light id."""

    center: NDArray[np.float64]  # (n, 3)
    axis: NDArray[np.float64]  # (n, 3)
    strength: NDArray[np.float64]  # (n,) relative to the largest
    radius: NDArray[np.float64]
    spread: NDArray[np.float64]
    reach: NDArray[np.float64]
    at_infinity: NDArray[np.bool_]
    diagonal: float  # of the bounding box of the finite lights

    @classmethod
    def of(cls, bounds: Sequence[LightBounds]) -> _Columns:
        center, radius, strength, axis, spread, reach, far = (
            np.array(column) for column in zip(*bounds, strict=True)
        )
        near = center[~far]
        diagonal = 0.0
        if near.size:
            grown = radius[~far, None]
            box = (near - grown).min(axis=0), (near + grown).max(axis=0)
            diagonal = float(np.linalg.norm(box[1] - box[0]))
        most = max(float(strength.max()), np.finfo(np.float64).tiny)
        return cls(center, axis, strength / most, radius, spread, reach, far, diagonal)


def _build(table: _Columns, finite: NDArray[np.int64]) -> _Tree:
    """Split until each node is one light; without lights there are no nodes."""
    scale = 1.0 / max(table.diagonal, 1e-30) if table.diagonal > 0.0 else 0.0
    features = np.hstack([table.center * scale, table.axis * _TURN])
    weight = table.strength + 1e-3 * max(float(table.strength.mean()), 1e-30)
    order = finite.copy()
    starts, stops, children = ([0], [len(finite)], [-1]) if finite.size else ([], [], [])
    node = 0
    while node < len(starts):
        start, stop = starts[node], stops[node]
        if stop - start > 1:
            order[start:stop], first = _split(order[start:stop], features, weight)
            children[node] = len(starts)
            starts += [start, start + first]
            stops += [start + first, stop]
            children += [-1, -1]
        node += 1
    return _Tree(*(np.array(x, np.int64) for x in (starts, stops, children, order)))


def _split(
    lights: NDArray[np.int64], features: NDArray[np.float64], weight: NDArray[np.float64]
) -> tuple[NDArray[np.int64], int]:
    """Return the lights sorted, and how many of them are on the first side."""
    w, f = weight[lights], features[lights]
    mean = w @ f / w.sum()
    dimension = int(np.argmax(w @ (f - mean) ** 2))
    by_place = np.argsort(f[:, dimension], kind="stable")
    w, x = w[by_place], f[by_place, dimension] - mean[dimension]
    # variance between the halves, for each number of lights on the first side
    left, moment = np.cumsum(w)[:-1], np.cumsum(w * x)[:-1]
    between = moment**2 / left + (moment - (w @ x)) ** 2 / (w.sum() - left)
    least = len(lights) // _LEAST_SHARE
    allowed = slice(max(least - 1, 0), len(between) - max(least - 1, 0))
    return lights[by_place], allowed.start + 1 + int(np.argmax(between[allowed]))


def _opened(tree: _Tree, table: _Columns, node: int, count: int) -> list[int]:
    """Open large nodes; return up to `count` nodes that contain all lights of a node."""

    def vague(k: int) -> float:
        lights = tree.lights(k)
        if len(lights) == 1:
            return -1.0
        return float(table.strength[lights].sum()) * _radius(table, lights) ** 2

    found = [(vague(node), node)]
    while len(found) < count:
        worst = max(found)
        if worst[0] < 0.0:
            break
        found.remove(worst)
        first = int(tree.child[worst[1]])
        found += [(vague(k), k) for k in (first, first + 1)]
    return [k for _, k in sorted(found, key=lambda each: int(tree.start[each[1]]))]


def _center(table: _Columns, lights: Any) -> NDArray[np.float64]:
    center, radius = table.center[lights], table.radius[lights, None]
    return np.asarray(0.5 * ((center - radius).min(axis=0) + (center + radius).max(axis=0)))


def _radius(table: _Columns, lights: Any) -> float:
    away = np.linalg.norm(table.center[lights] - _center(table, lights), axis=1)
    return float((away + table.radius[lights]).max())


def _nodes(table: _Columns, lights: Sequence[Any]) -> LightNodes:
    """Return the bounds of sets of lights as arrays for the kernels."""
    least = max(_SMALLEST_RADIUS * table.diagonal, 1e-18)
    rows = []
    for each in lights:
        center, radius = _center(table, each), max(_radius(table, each), least)
        strength = table.strength[each]
        axis = strength @ table.axis[each]
        length = float(np.linalg.norm(axis))
        axis, spread = (
            (axis / length, 0.0) if length > 0.0 else (table.axis[each[0]], math.pi)
        )
        off = angles_from(axis, table.axis[each])
        spread = min(max(spread, float((off + table.spread[each]).max())), math.pi)
        reach = max(float(table.reach[each].max()), _LEAST_REACH)
        angles = math.cos(spread), math.sin(spread), math.cos(reach)
        rows.append([*center, radius, *axis, strength.sum(), *angles, 0.0])
    return LightNodes(by_columns(np.array(rows, np.float32).reshape(-1, 12).T))
