"""The comparison that every accelerator has to stand: brute force, bit for bit.

The names come from the registry, so a structure that is added later is tested without an
edit here. Each is tested for the nearest hit and for any hit, by packets too where it has
such a traversal, and proves its own structure before.
"""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np
import pytest
from kernel_probes import KINDS, Found, accelerator, blocked, closest

from renderer.accelerators.build import BUILDERS
from renderer.accelerators.dispatch import TRAVERSALS
from renderer.accelerators.validate import validate
from renderer.plugins.shapes.extents import Extents, extents_of

NAMES = tuple(BUILDERS)
# Grouped by name, so that the processes of a test run share out what is to be compiled.
every_name = pytest.mark.parametrize("name", NAMES, scope="module")
# What a leaf tests is compiled for each kind of primitive in each structure. The tree of
# usual scenes meets every kind; those with a loop of their own meet flat and curved ones,
# the rest, which share the loop `ray_by_ray`, flat ones; in the slow tests all meet all.
_FLAT = ("triangles", "rectangles")
QUICK_KINDS = (
    dict.fromkeys(NAMES, _FLAT)
    | dict.fromkeys(("bvh", "bvh-median", "bvh-middle", "kd-sah"), (*_FLAT, "spheres"))
    | dict.fromkeys(("brute", "wide"), KINDS)
)
_SLOW = {
    (name, kind): pytest.mark.slow
    for name in NAMES
    for kind in KINDS
    if kind not in QUICK_KINDS[name]
}
every_pair = pytest.mark.parametrize(
    ("name", "kind"),
    [
        pytest.param(name, kind, marks=_SLOW.get((name, kind), ()))
        for name in NAMES
        for kind in KINDS
    ],
    scope="module",
)
every_name_of_cylinders = pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=_SLOW.get((name, "cylinders"), ())) for name in NAMES],
    scope="module",
)
# Where a test compiles the renderer around a structure (4 s each), those that share their
# traversal with another are slow: the quick tests compare the hits of all of them.
_SHARED = {
    "grid-without-mailboxes",
    "grid-nested",
    "grid-clusters",
    "octree",
    "bsp",
    "kd-middle",
    "kd-median",
    "bvh-median",
}
one_of_each_family = pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=pytest.mark.slow if n in _SHARED else ()) for n in NAMES],
    scope="module",
)


def extents_for(kind: str, surfaces: Any, reach: float = 0.0) -> Extents:
    return extents_of(kind, surfaces, np.arange(surfaces.end - surfaces.first), reach)


def proved(name: str, kind: str, surfaces: Any, reach: float = 0.0) -> Any:
    """Build the structure over all primitives and let it prove itself."""
    accel = accelerator(kind, surfaces, name, reach)
    validate(accel, extents_for(kind, surfaces, reach))
    return accel


def ways_of(accel: Any) -> tuple[bool, ...]:
    """What to pass as `coherent`: both if the structure has its own way for packets."""
    ways = TRAVERSALS[type(accel)]
    own = ways.closest_hit_coherent is not ways.closest_hit
    return (False, True) if own or ways.any_hit_coherent is not ways.any_hit else (False,)


def reach_of(origin: Any) -> float:
    """How far from the world's origin these rays start, as a scene's camera would."""
    distance = np.abs(np.asarray(origin, np.float64)).sum(axis=-1)
    return float(distance[np.isfinite(distance)].max(initial=0.0))


_TRUTHS: dict[bytes, Found] = {}


def brute_force(
    kind: str, surfaces: Any, origin: Any, direction: Any, t_max: Any = np.inf
) -> Found:
    """Return the hits by brute force; the same question is answered once for all names."""
    digest = hashlib.blake2b(kind.encode())
    for part in (*surfaces, origin, direction, t_max):
        array = np.asarray(part)
        digest.update(f"{array.dtype} {array.shape}".encode())
        digest.update(array.tobytes())
    key = digest.digest()
    if key not in _TRUTHS:
        found = closest(
            accelerator(kind, surfaces, "brute"), origin, direction, t_max=t_max
        )
        for rows in found:
            rows.setflags(write=False)
        _TRUTHS[key] = found
    return _TRUTHS[key]


def assert_same(found: Found, truth: Found, label: str) -> None:
    """Compare hits bit for bit; u and v of a miss mean nothing."""
    np.testing.assert_array_equal(found.prim, truth.prim, f"prim, {label}")
    hit = truth.prim >= 0
    np.testing.assert_array_equal(found.t[~hit], truth.t[~hit], f"t of a miss, {label}")
    for field in ("t", "u", "v"):
        got, expected = (getattr(f, field)[hit].view(np.int32) for f in (found, truth))
        np.testing.assert_array_equal(got, expected, f"bits of {field}, {label}")


def assert_agrees(
    accel: Any, truth: Found, origin: Any, direction: Any, t_max: Any, label: str
) -> None:
    """Compare the hits of a structure that is already built with those of brute force."""
    for coherent in ways_of(accel):
        told = f"{label}, packets: {coherent}"
        found = closest(accel, origin, direction, t_max=t_max, coherent=coherent)
        assert_same(found, truth, told)
        any_hit = blocked(accel, origin, direction, t_max=t_max, coherent=coherent)
        np.testing.assert_array_equal(any_hit, truth.prim >= 0, f"any hit, {told}")


def assert_same_hits(
    name: str,
    kind: str,
    surfaces: Any,
    origin: Any,
    direction: Any,
    t_max: Any = np.inf,
    reach: float | None = None,
) -> Found:
    """Compare all traversals of a structure with brute force, whose hits are returned.

    By default it is built for rays from where these rays start.
    """
    truth = brute_force(kind, surfaces, origin, direction, t_max)
    accel = proved(name, kind, surfaces, reach_of(origin) if reach is None else reach)
    assert_agrees(accel, truth, origin, direction, t_max, f"{name}, {kind}")
    return truth


def some(truth: Found, least: float = 0.005) -> None:
    """Both hits and misses must be there, or the comparison shows nothing."""
    share = np.mean(truth.prim >= 0)
    assert least < share < 1, share
