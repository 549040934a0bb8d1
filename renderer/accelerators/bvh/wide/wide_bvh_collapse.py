"""Choose the nodes of a binary tree that become nodes of eight, at least expected cost.

A ray that hits the root's box hits another with a probability of the ratio of their
surface areas. So making node n a wide node costs

    C(n) = A_n / A_root + C(n, 8),

where C(n, k) is the cost below n if up to k of its descendants become children of n's wide
ancestor in its place:

    C(n, k) = min over j of C'(left, j) + C'(right, k - j)

Here C'(m, k) is the lesser of C(m) and C(m, k), and 0 for a leaf, which exists in any case
[Ylitie2017]. The costs are computed bottom-up. The usual rule replaces the child with the
largest surface area, again and again [Wald2008]. It leaves most nodes above the leaves
with two children: 1.8 times as many nodes on a mesh of 327,680 triangles.
"""

from __future__ import annotations

import numpy as np

from renderer.accelerators.surface_area import half_area
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.vectors import local_i32

CHILDREN = 8
ROOMS = CHILDREN - 1  # most children that can replace a node which is not the top one
_LEAST_SHARE = 1e-9  # area ratio of a box without area: a node costs something there too


@kernel
def write_costs(bounds, child, count, costs):
    """Write C'(n, k) to costs[n, k - 1] for k from 1 to 7.

    Children have larger indices than parents, so nodes are taken in reverse order.
    """
    root = half_area(bounds[0])
    for node in range(len(count) - 1, -1, -1):
        if count[node] > 0:
            for k in range(ROOMS):
                costs[node, k] = 0.0
            continue
        # if the root has no area (points on a line), every box counts as hit
        share = half_area(bounds[node]) / root if root > 0.0 else 1.0
        share = np.float32(max(share, _LEAST_SHARE))
        first = child[node]
        least = share + _best_division(first, np.int64(CHILDREN), costs)[0]
        costs[node, 0] = least
        for k in range(2, ROOMS + 1):
            least = min(least, _best_division(first, k, costs)[0])
            costs[node, k - 1] = least


@kernel
def _best_division(first, rooms, costs):
    """Return the least cost of two siblings with `rooms` children, and the first's share.

    `rooms` is an int64; any other type, also a constant's, would be compiled separately.
    """
    least, best = costs[first, 0] + costs[first + 1, rooms - 2], 1
    for j in range(2, rooms):
        cost = costs[first, j - 1] + costs[first + 1, rooms - j - 1]
        if cost < least:
            least, best = cost, j
    return least, best


@kernel
def choose_children(child, count, node, costs, members):
    """Write the up to eight descendants that become a node's children; return how many."""
    rooms = local_i32(CHILDREN)
    members[0], rooms[0] = node, CHILDREN
    size = 1
    k = 0
    while k < size:
        m, room = members[k], rooms[k]
        if count[m] > 0 or (m != node and costs[m, 0] <= costs[m, room - 1]):
            k += 1  # a leaf, or cheaper as a wide node
            continue
        first = child[m]
        mine = _best_division(first, np.int64(room), costs)[1]
        members[k], rooms[k] = first, mine
        members[size], rooms[size] = first + 1, room - mine
        size += 1
    return size
