"""Selection of one light for each point, and the probability of each light there.

With a small probability the light is uniform; otherwise it follows bounds of the lights'
contributions. First an entry of a list is sampled, which is a light or a tree of lights. In
a tree the descent continues to a single light, at every node by the bounds of the children
[Estevez2018, section 4]. The probability of a light that a BSDF sample has hit is computed
by the same descent, without a random number.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel, method_kernel
from renderer.kernels.lanes.functions import (
    any_of,
    first_lanes,
    mask_bits,
    maximum,
    minimum,
    select,
    splat_f32,
    splat_i32,
    splat_mask,
    to_f32,
)
from renderer.kernels.lanes.memory import gather_row, load_row, store_row, store_where
from renderer.kernels.lanes.vectors import dot, gather3, load3, local_f32, select3
from renderer.plugins.lights.importance import (
    ANY_NORMAL,
    BOTH_SIDES,
    LightNodes,
    Receiver,
    importance_at,
    importance_from_infinity,
    importance_of,
)
from renderer.plugins.lights.sky_by_place import SkyByPlace, share_at
from renderer.plugins.sampling.numbers_and_warps import choose_one

# Fraction of uniform selections: each of n lights has a probability of at least this / n.
# So what the bounds ignore (a perturbed normal, shadows of all other lights) adds noise,
# but no bias. It costs at most a sixteenth of the samples.
UNIFORM = np.float32(1.0 / 16.0)
MOST_ENTRIES = 256  # the importances of 16 points for each are on the stack
_BELOW_ONE = np.float32(1.0 - 2.0**-24)
_LARGEST = np.float32(3.0e38)


class LightChoice(NamedTuple):
    """All lights; many finite lights are in trees, otherwise they are listed."""

    count: int  # lights that may be selected
    sampled: NDArray[np.int32]  # (count,) their ids
    nodes: LightNodes
    children: NDArray[np.int32]  # (m,) number of contiguous children; 0: a light
    child: NDArray[np.int32]  # (m,) the first child, or the light id
    stop: NDArray[np.int32]  # (m,) one past the rank of the last light
    width: int  # largest number of children
    entries: NDArray[np.int32]  # (e,) the nodes that are compared at each point
    at_infinity: NDArray[np.int32]  # (e,) 1: the entry is a light at infinity
    entry: NDArray[np.int32]  # (lights,) index in `entries` of the light or of its tree
    rank: NDArray[np.int32]  # (lights,) position of the light in its tree, from the left
    sides: NDArray[np.int32]  # (BSDFs,) IN_FRONT, BOTH_SIDES or ANY_NORMAL
    environment: int  # light id of the environment that escaped rays find, -1: none
    places: SkyByPlace  # visibility of the environment by position
    by_pair: int  # 1: the first random number of a sample selects the light, 0: the fourth
    # 1: select by position alone, in media and on surfaces. A ray that has passed through
    # surfaces without scattering still has the position of its last scattering event.
    by_place: int


class Chosen(NamedTuple):
    """A light for each of 16 points."""

    light: Any
    probability: Any
    rest: Any  # the random number, rescaled to [0, 1) after the selection


@kernel
def _unit(x):
    return minimum(maximum(x, splat_f32(0.0)), splat_f32(_BELOW_ONE))


@kernel
def _ask_entries(choice, receiver, given):
    """Store the importance of each entry in `given`; return the sum."""
    total, places = splat_f32(0.0), choice.places
    sky = np.int32(-1)
    if places.levels != 0 and choice.environment >= 0:
        sky = choice.entry[choice.environment]
    for k in range(choice.entries.size):
        node = choice.entries[k]
        if choice.at_infinity[k] != 0:
            part = importance_from_infinity(choice.nodes, node, receiver)
            if k == sky:
                part = part * share_at(places, receiver.position, splat_mask(True))
        else:
            part = importance_of(choice.nodes, node, receiver)
        store_row(given, 0, 16 * k, part)
        total = total + part
    return total


@kernel
def _choose_entry(choice, given, total, wanted, entry, number):
    """Return a node, its probability and the rescaled random number, from the entries.

    Where `wanted` is set, the node is that of the given `entry`.
    """
    node, share, left = splat_i32(0), splat_f32(0.0), splat_f32(0.0)
    target = number * total
    open_ = splat_mask(True)
    for k in range(choice.entries.size):
        part = load_row(given, 0, 16 * k)
        # rounding may leave a number beyond all entries: the last with importance is taken
        take = select(wanted, entry == np.int32(k), open_ & (part > 0.0))
        node = select(take, splat_i32(choice.entries[k]), node)
        share = select(take, part, share)
        left = select(take, target, left)
        open_ = open_ & ~(target < part)
        target = target - part
    return node, share / total, _unit(left / share)


@kernel
def _ask_children(choice, receiver, first, count, inner, given):
    """Store the importance of each child in `given`; return the sum.

    If all children have importance 0 (their bounds are tighter than the parent's), they
    are equally likely.
    """
    total = splat_f32(0.0)
    for k in range(choice.width):
        there = inner & (count > np.int32(k))
        part = importance_at(choice.nodes, first + np.int32(k), there, receiver)
        part = select(there, part, splat_f32(0.0))
        store_row(given, 0, 16 * k, part)
        total = total + part
    known = (total > 0.0) & (total < _LARGEST)
    if any_of(inner & ~known):
        for k in range(choice.width):
            one = select(count > np.int32(k), splat_f32(1.0), splat_f32(0.0))
            store_row(given, 0, 16 * k, select(known, load_row(given, 0, 16 * k), one))
    return select(known, total, to_f32(count))


@kernel
def _descend(choice, receiver, given, found, wanted, rank, valid):
    """Descend from nodes to lights; where `wanted`, to the light with the given rank."""
    node, probability, rest = found
    count = gather_row(choice.children, 0, node, valid)
    inner = valid & (count > 0)
    while any_of(inner):
        first = gather_row(choice.child, 0, node, inner)
        total = _ask_children(choice, receiver, first, count, inner, given)
        open_, target = inner, rest * total
        share, left = splat_f32(1.0), splat_f32(0.0)
        for k in range(choice.width):
            child, part = first + np.int32(k), load_row(given, 0, 16 * k)
            there = open_ & (count > np.int32(k))
            before = rank < gather_row(choice.stop, 0, child, there)
            take = there & select(wanted, before, part > 0.0)
            node = select(take, child, node)
            share = select(take, part, share)
            left = select(take, target, left)
            open_ = open_ & ~(take & (wanted | (target < part)))
            target = target - part
        rest = select(inner, _unit(left / share), rest)
        probability = select(inner, probability * (share / total), probability)
        count = gather_row(choice.children, 0, node, valid)
        inner = valid & (count > 0)
    return gather_row(choice.child, 0, node, valid), probability, rest


@kernel
def walk(choice, receiver, wanted, light, number, valid):
    """Sample a light for each of 16 points by a number in [0, 1).

    Where the mask `wanted` is set, return `light` and its probability.
    """
    given = local_f32(4096)
    total = _ask_entries(choice, receiver, given)
    known = (total > 0.0) & (total < _LARGEST)
    uniform = select(known, splat_f32(UNIFORM), splat_f32(1.0))
    by_chance = number < uniform
    any_light, any_rest = choose_one(_unit(number / uniform), choice.count)
    any_light = gather_row(choice.sampled, 0, any_light, valid)
    light = select(wanted, light, any_light)

    wanted = wanted | by_chance
    number = _unit((number - uniform) / (1.0 - uniform))
    entry = gather_row(choice.entry, 0, light, valid)
    found = _choose_entry(choice, given, total, wanted, entry, number)
    rank = gather_row(choice.rank, 0, light, valid)
    reached, probability, rest = _descend(
        choice, receiver, given, found, wanted, rank, valid & known
    )

    one_of_all = np.float32(1.0 / choice.count) * uniform
    probability = one_of_all + (1.0 - uniform) * select(known, probability, splat_f32(0.0))
    return Chosen(
        select(wanted, light, reached), probability, select(by_chance, any_rest, rest)
    )


@kernel
def _receiver(choice, position, normal, wo, bsdf, mask):
    if choice.by_place != 0:
        return Receiver(position, normal, splat_mask(False), splat_mask(True))
    front = dot(wo, normal) > 0.0
    sides = gather_row(choice.sides, 0, bsdf, mask & (bsdf >= 0))
    return Receiver(
        position,
        select3(front, normal, -normal),
        sides == np.int32(BOTH_SIDES),
        sides == np.int32(ANY_NORMAL),
    )


@method_kernel
def choose_by_importance(choice, points, count, numbers, light):
    """Sample a light for each point.

    Its probability is stored in place of the fourth random number, which is not needed.
    """
    by_pair = choice.by_pair != 0
    for i in range(0, count, 16):
        valid = first_lanes(count - i)
        receiver = _receiver(
            choice,
            load3(points.position, i),
            load3(points.shading_normal, i),
            load3(points.wo, i),
            load_row(points.bsdf, 0, i),
            valid,
        )
        number = load_row(numbers, 0 if by_pair else 3, i)
        free = splat_mask(False)
        chosen = walk(choice, receiver, free, splat_i32(0), number, valid)
        store_row(light, 0, i, chosen.light)
        store_row(numbers, 3, i, chosen.probability)
        if by_pair:
            store_row(numbers, 0, i, chosen.rest)


@method_kernel
def weigh_found_lights(choice, shapes, shape_of, points, rays, hits, first, count):
    """Divide the pdf of BSDF samples that hit a light by the light's probability.

    In the MIS weight this equals multiplying the light sample's pdf. `points` are still
    the points where the rays start.
    """
    for i in range(first, first + count, 16):
        prim, density = load_row(hits.prim, 0, i), load_row(rays.pdf, 0, i)
        # pdf 0: camera rays and delta lobes, which take no light samples
        valid = first_lanes(first + count - i) & (density > 0.0)
        met = valid & (prim >= 0)
        shape = gather_row(shape_of, 0, prim, met)
        light = gather_row(shapes.light, 0, shape, met)
        light = select(met, light, splat_i32(np.int32(choice.environment)))
        found = valid & (light >= 0)
        if mask_bits(found) == 0:
            continue
        point = load_row(rays.point, 0, i)
        position = gather3(points.position, point, found)
        if choice.by_place != 0:
            position = load3(rays.previous, i)
        receiver = _receiver(
            choice,
            position,
            gather3(points.shading_normal, point, found),
            gather3(points.wo, point, found),
            gather_row(points.bsdf, 0, point, found),
            found,
        )
        chosen = walk(choice, receiver, found, light, splat_f32(0.5), found)
        store_where(rays.pdf, 0, i, density / chosen.probability, found)


@kernel
def divide_by_probability(samples, numbers, count):
    """Divide light samples by the light's probability; multiply their pdfs by it."""
    for i in range(0, count, 16):
        probability = load_row(numbers, 3, i)
        store_row(samples.pdf, 0, i, load_row(samples.pdf, 0, i) * probability)
        inverse = 1.0 / probability
        for c in range(3):
            store_row(samples.radiance, c, i, load_row(samples.radiance, c, i) * inverse)
