"""The smallest ball that encloses balls [Gaertner1999] [Fischer2003].

At most four balls touch the smallest one and determine it. Start with two that lie far
apart, as Ritter does [Ritter1990]; while some ball sticks out, add the one that does so
most and solve the small problem of at most five by trying every subset. The radius grows
in each round, so no set of four comes twice and it ends; it takes 5 to 15 rounds, each
one pass over the balls. (Welzl's recursion is right for points only, not for balls.)
"""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

MOST_ROUNDS = 200  # far above what was seen (15); what is found by then is enclosed too
# What rounding in double precision may do to a radius, as a share of the size.
TOLERANCE = 1e-12


def smallest_ball(
    centers: NDArray[np.float64], radii: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the centre (3,) of the smallest ball around balls (3, n), (n,), n >= 1."""
    middle = centers.mean(axis=1)
    balls = np.vstack((centers - middle[:, None], radii))  # (4, n)
    size = float(np.abs(balls).max())
    first = _farthest(balls, np.zeros(3))[0]
    members = [first, _farthest(balls, balls[:3, first])[0]]
    center, radius, members = _smallest_of_few(balls, members, size)
    for _ in range(MOST_ROUNDS):
        outside, reach = _farthest(balls, center)
        if reach <= radius + TOLERANCE * size:
            break
        found = _smallest_of_few(balls, [*members, outside], size)
        if found[1] <= radius:  # rounding: there is nothing to be gained any more
            break
        center, radius, members = found
    return center + middle


def _farthest(balls: NDArray[np.float64], center: NDArray[np.float64]) -> tuple[int, float]:
    """Return the ball that reaches farthest from a point, and how far."""
    reach = np.linalg.norm(balls[:3] - center[:, None], axis=0) + balls[3]
    index = int(reach.argmax())
    return index, float(reach[index])


def _smallest_of_few(balls: Any, members: list[int], size: float) -> Any:
    """Return (centre, radius, members that touch it) of the smallest ball around a few.

    It touches some subset from inside, with its centre in the subset's affine hull; of all
    such balls that enclose the rest it is the smallest.
    """
    few = balls[:, members]
    best: Any = (few[:3].mean(axis=1), np.inf, members)
    for count in range(1, min(4, len(members)) + 1):
        for chosen in combinations(range(len(members)), count):
            for center, radius in _touching(few[:, chosen]):
                _, reach = _farthest(few, center)
                if reach <= radius + TOLERANCE * size and radius < best[1]:
                    best = center, radius, [members[k] for k in chosen]
    return best


def _touching(balls: Any) -> list[tuple[Any, float]]:
    """Return the balls (at most two) that m balls touch from inside.

    With x the centre relative to ball 0 and q_i ball i relative to it, |x| = R - r_0 and
    |x - q_i| = R - r_i. The difference of their squares is linear in x and R,

        q_i . x = (|q_i|^2 + r_0^2 - r_i^2) / 2 + R (r_i - r_0),

    so x = u + R v; put into the first it leaves a quadratic equation for R.
    """
    p, r = balls[:3, 0], balls[3]
    if len(r) == 1:
        return [(p, float(r[0]))]
    q = (balls[:3, 1:] - p[:, None]).T
    given = (np.sum(q * q, axis=1) + r[0] ** 2 - r[1:] ** 2) / 2.0
    u, v = np.linalg.lstsq(q, np.column_stack((given, r[1:] - r[0])), rcond=None)[0].T
    a, b, c = v @ v - 1.0, u @ v + r[0], u @ u - r[0] ** 2
    root = np.sqrt(max(b * b - a * c, 0.0))
    s = -(b + root) if b > 0.0 else root - b
    radii = [top / below for top, below in ((s, a), (c, s)) if below != 0.0]
    return [(p + u + R * v, float(R)) for R in radii if r.max() <= R < np.inf]
