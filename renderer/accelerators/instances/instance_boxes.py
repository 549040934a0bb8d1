"""Which rays of a list enter which of a node's children: 16 rays, or 8 boxes, at once.

Each ray has its own margin, and goes down an axis or up.
"""

from __future__ import annotations

import numpy as np

from renderer.accelerators.bvh.wide import wide_bvh_build
from renderer.accelerators.bvh.wide.octants import ENDED
from renderer.accelerators.bvh.wide.wide_bvh_build import (
    AXIS_BYTES,
    BOX_BYTES,
    SCALE,
    WIDE_BYTES,
    WIDE_WORDS,
)
from renderer.accelerators.instances.instance_rays import (
    INVERSE,
    MARGIN,
    START,
    T,
)
from renderer.accelerators.rays.box_entry import STRETCH
from renderer.kernels.jit import kernel
from renderer.kernels.lanes.affine import absolute
from renderer.kernels.lanes.functions import (
    fabs,
    first_lanes,
    lane_index_8,
    lower_half,
    mask_bits,
    maximum,
    minimum,
    popcount,
    select,
    splat_f32,
    upper_half,
)
from renderer.kernels.lanes.memory import (
    gather_row,
    load_bytes,
    load_eight,
    load_one,
    load_row,
    store_one,
    store_row,
)
from renderer.kernels.lanes.vectors import gather_rows3


@kernel
def write_planes(nodes, node, axis, planes):
    """Write the middles of the children's boxes along an axis, and half their sizes."""
    octet = node * WIDE_BYTES + BOX_BYTES + AXIS_BYTES * axis
    word = node * WIDE_WORDS + axis
    half = np.float32(0.5) * load_one(nodes.floats, 0, word + SCALE)
    plane = load_bytes(nodes.octets, 0, octet)
    lower, upper = lower_half(plane), upper_half(plane)
    origin = load_one(nodes.floats, 0, word + wide_bvh_build.ORIGIN)
    store_row(planes, axis, 0, (lower + upper) * half + origin)
    store_row(planes, axis, 8, (upper - lower) * half)


@kernel
def enter_children(stream, place, left, masks, size):
    """Test the next 16 rays of a list, or as many as are left, against all children.

    Where a ray passes the middle of a box, and half the box's size away from there. Its
    rounding error is that of moving the box by 3 * 2^-23 (|b| + |o|); boxes and origins are
    padded by five times that.

    Return how many of the rays go down the x, y and z axis.
    """
    floats, planes = stream.rows.floats, stream.planes
    live = first_lanes(left)
    ray = load_row(stream.lists, 0, place)
    inverse = gather_rows3(floats, INVERSE, ray, live)
    start = gather_rows3(floats, START, ray, live)
    t = select(live, gather_row(floats, T, ray, live), ENDED)
    along = absolute(inverse)
    more = along * gather_row(floats, MARGIN, ray, live)
    for k in range(size):
        x = inverse.x * load_one(planes, 0, k) - start.x
        y = inverse.y * load_one(planes, 1, k) - start.y
        z = inverse.z * load_one(planes, 2, k) - start.z
        half_x = along.x * load_one(planes, 0, k + 8) + more.x
        half_y = along.y * load_one(planes, 1, k + 8) + more.y
        half_z = along.z * load_one(planes, 2, k + 8) + more.z
        enter = maximum(
            maximum(x - half_x, y - half_y), maximum(z - half_z, splat_f32(0.0))
        )
        leave = minimum(minimum(x + half_x, y + half_y), z + half_z)
        bits = mask_bits(enter <= minimum(leave * STRETCH, t))
        store_one(stream.lists, 0, masks + k, bits)
        store_one(stream.entered, 0, k, load_one(stream.entered, 0, k) | bits)
    return (
        popcount(mask_bits(inverse.x < 0.0)),
        popcount(mask_bits(inverse.y < 0.0)),
        popcount(mask_bits(inverse.z < 0.0)),
    )


@kernel
def enter_ray_by_ray(stream, place, m, masks):
    """Test the rays of a short list against eight children; return the first's octant."""
    floats, planes = stream.rows.floats, stream.planes
    entered = lane_index_8() & 0
    octant = np.int64(0)
    for j in range(m - 1, -1, -1):  # so that the first one's octant stays
        ray = np.int64(load_one(stream.lists, 0, place + j))
        enter = lower_half(splat_f32(0.0))
        leave = enter + load_one(floats, T, ray)
        octant = np.int64(0)
        for axis in range(3):
            inverse = load_one(floats, INVERSE + axis, ray)
            middle = load_eight(planes, axis, 0) * inverse
            middle = middle - load_one(floats, START + axis, ray)
            half = load_eight(planes, axis, 8) + load_one(floats, MARGIN, ray)
            half = half * fabs(inverse)
            # what may not be a number comes first, so that the bound before it stays
            enter = maximum(middle - half, enter)
            leave = minimum((middle + half) * STRETCH, leave)
            octant |= np.int64(1 if inverse < 0.0 else 0) << axis
        entered = select(enter <= leave, entered | np.int32(1 << j), entered)
    store_row(stream.lists, 0, masks, entered)
    store_row(stream.entered, 0, 0, entered)
    return octant
