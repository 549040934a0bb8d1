"""Stage 6 in a replay: mirrored and refracted directions, and origins, as Mitsuba rounds.

Mitsuba scatters in the frame (s, t, n) of the surface and turns the result into the world;
our kernels work in the world. Both are right, and differ by a rounding, which grows by the
distance over the radius at each curved surface. Found by trying all orders and fusings on
thousands of samples, and bit for bit Mitsuba's.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel, method_kernel
from renderer.kernels.lanes.vectors import column, dot, vec3
from renderer.plugins.bsdfs.registry import kind_of
from renderer.replay.rounding.arithmetic.fused import fused_multiply_add
from renderer.replay.rounding.arithmetic.rounded_once import fused_cross, fused_sum, unit
from renderer.replay.rounding.hits.hit_points import ROUNDING

_ONE = np.float32(1.0)
_ZERO = np.float32(0.0)
_ORIGIN_ROUNDING = np.float32(1e-6)  # a hundredth of how far off the surface rays start


@kernel
def _frame(points, i, normal):
    """Return s and t of the shading frame at a point."""
    along_u = column(points.tangent, i)
    s = unit(fused_sum(normal, -dot(normal, along_u), along_u))
    return s, fused_cross(normal, s)


@kernel
def _refracted(wi, eta):
    """Return the refracted direction in the frame; eta is inside over outside."""
    inverse = _ONE / eta
    ratio = inverse if wi.z >= _ZERO else eta
    sine2 = fused_multiply_add(-wi.z, wi.z, _ONE)
    cosine = np.float32(
        np.sqrt(max(fused_multiply_add(-sine2, ratio * ratio, _ONE), _ZERO))
    )
    return vec3(-ratio * wi.x, -ratio * wi.y, -cosine if wi.z >= _ZERO else cosine)


class ScatteringBsdfs(NamedTuple):
    """What of the BSDFs tells a delta direction; columns by BSDF id."""

    nested: NDArray[np.int32]  # (n,) 1: it works in the local frame throughout
    transmits: NDArray[np.int32]  # (n,)
    # (n,) index of refraction, inside over outside; 0: what is transmitted goes straight on
    eta: NDArray[np.float32]


def scattering_bsdfs(bsdfs: Sequence[Any]) -> ScatteringBsdfs:
    """Return it for the BSDFs of a scene."""
    rows = [(False, False, 1.0)] * (not bsdfs)
    for bsdf in bsdfs:
        kind = kind_of(bsdf)
        nested = bool(kind.inside)
        transmits = kind.transmits and kind.delta and not nested
        eta = 0.0 if kind.straight else bsdf.eta if transmits else 1.0
        rows.append((nested, transmits, eta))
    columns = zip(*rows, strict=True)
    types = (np.int32, np.int32, np.float32)
    return ScatteringBsdfs(*map(np.array, columns, types))


@kernel
def _scattered(bsdfs, points, i, direction):
    """Return `direction`, in which a path leaves point i, as Mitsuba computes it."""
    bsdf = points.bsdf[i]
    if bsdfs.nested[bsdf] != 0:
        return direction  # `directions.py` has done it
    normal, view = column(points.shading_normal, i), column(points.wo, i)
    s, t = _frame(points, i, normal)
    wi = vec3(dot(view, s), dot(view, t), dot(view, normal))
    if bsdfs.transmits[bsdf] == 0 or dot(direction, normal) * wi.z > _ZERO:
        wo = vec3(-wi.x, -wi.y, wi.z)
    elif bsdfs.eta[bsdf] == _ZERO:
        wo = -wi
    else:
        wo = _refracted(wi, bsdfs.eta[bsdf])
    return fused_sum(normal, wo.z, fused_sum(t, wo.y, s * wo.x))


@kernel
def _close(a, b, limit):
    """Return whether two vectors differ by rounding only; NaN is not close to anything."""
    return abs(a.x - b.x) <= limit and abs(a.y - b.y) <= limit and abs(a.z - b.z) <= limit


@kernel
def _size(p):
    return _ONE + max(abs(p.x), max(abs(p.y), abs(p.z)))


@kernel
def _off_surface(points, i, direction, fixed):
    """Return the origin of a ray in a direction, off the surface by Mitsuba's rule."""
    p, normal = column(points.position, i), column(points.normal, i)
    size = _size(p) * fixed
    if dot(normal, direction) < _ZERO:
        size = -size
    return fused_sum(normal, size, p)


@method_kernel
def round_rays(bsdfs, settings, rays, end, points):
    """Round the first `end` rays, which have just left `points`.

    A direction or an origin that differs by more than rounding explains stays, so that a
    replay shows it. Also keep the exact position that each ray leaves.
    """
    fixed = np.float32(settings.fixed_offset)
    for k in range(end):
        i = rays.point[k]
        for c in range(3):
            rays.previous[c, k] = points.position[c, i]
        old = column(rays.direction, k)
        new = old  # of a smooth lobe `directions.py` has done it
        if rays.pdf[k] <= _ZERO:
            new = _scattered(bsdfs, points, i, old)
        if not _close(new, old, ROUNDING):
            continue
        rays.direction[0, k], rays.direction[1, k] = new.x, new.y
        rays.direction[2, k] = new.z
        origin = _off_surface(points, i, new, fixed)
        if _close(origin, column(rays.origin, k), _ORIGIN_ROUNDING * _size(origin)):
            rays.origin[0, k], rays.origin[1, k] = origin.x, origin.y
            rays.origin[2, k] = origin.z
