"""The record of a replay of `volpath` or `volpathmis`, and its draws of random numbers.

The number of draws of a path depends on its collisions. So numbers are drawn when a path
needs them, not at the start of a bounce.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import as_i32, lane, lowest_bit, mask_bits
from renderer.kernels.lanes.memory import load_row
from renderer.kernels.lanes.vectors import column3, vec3
from renderer.kernels.records.batch import sample_key, slot_pixel
from renderer.replay.arithmetic import fused_affine, fused_multiply_add, fused_sum
from renderer.replay.sequences import (
    BSDF,
    BSDF_CHOICE,
    LIGHT,
    Replay,
    next_1d,
    next_2d,
    skip_1d,
)
from renderer.scene.light_order import light_order
from renderer.scene.media_tables import media_of
from renderer.scene_file.description import (
    DirectionalLight,
    PointLight,
    Rectangle,
    SceneDescription,
    Sphere,
    SpotLight,
)
from renderer.scene_file.transforms import place_normals

# rows of `Replay.numbers` after those of a bounce
CHANNEL = 10  # colour channel that determines distances: 0, 1 or 2
PASSED = 11  # RGB transmittance of a shadow ray; before it is traced, red is `TO_DO`
ROWS_IN_MEDIA = 14
TO_DO = np.float32(-1.0)

_UP = np.array([[0, 0, 1]])


class InOrder(NamedTuple):
    """A scene traced in Mitsuba's order; columns by medium id."""

    scene: Any  # KernelScene
    replay: Replay
    majorant: NDArray[np.float32]  # (n,) of heterogeneous media, with Mitsuba's rounding
    spectral: NDArray[np.int32]  # (n,) 1: has_spectral_extinction
    lit: NDArray[np.int32]  # (n,) 1: sample_emitters
    # (lights,) 1: position or direction is a delta; Mitsuba always traces a shadow ray
    delta: NDArray[np.int32]
    # (15, lights) of a rectangle light: its 3 x 4 matrix by rows, and its unit normal
    rectangles: NDArray[np.float32]
    spheres: NDArray[np.float32]  # (4, lights) of a sphere light: center and radius
    mis: int  # 1: in the order of `volpathmis`
    carry: Any  # record of the state that its paths carry (`replay.media.carried`)


def in_order(
    scene: Any, replay: Replay, description: SceneDescription, mis: bool, carry: Any
) -> InOrder:
    """Return the record for `trace_in_order`."""
    media, order = media_of(description), light_order(description)
    count = len(description.shapes) + len(description.emitters) + 1
    delta, rectangles = np.zeros(count, np.int32), np.zeros((15, count), np.float32)
    spheres = np.zeros((4, count), np.float32)
    for light, emitter in zip(order.of_emitters, description.emitters, strict=True):
        delta[light] = isinstance(emitter, PointLight | SpotLight | DirectionalLight)
    for light, shape in zip(order.of_shapes, description.shapes, strict=True):
        if light >= 0 and isinstance(shape, Rectangle):
            rectangles[:12, light] = shape.to_world[:3].ravel()
            rectangles[12:, light] = place_normals(shape.to_world, _UP)[0]
        if light >= 0 and isinstance(shape, Sphere) and not shape.flip_normals:
            spheres[:3, light] = shape.to_world[:3, 3]
            spheres[3, light] = np.linalg.norm(shape.to_world[:3, 0])
    majorants = [np.float32(m.scale) * np.float32(m.sigma_t.maximum) for m in media]
    return InOrder(
        scene,
        replay,
        np.array([*majorants, 0.0], np.float32),
        np.array([*(m.has_spectral_extinction for m in media), 1], np.int32),
        np.array([*(m.sample_emitters for m in media), 1], np.int32),
        delta,
        rectangles,
        spheres,
        int(mis),
        carry,
    )


@kernel
def sees_own_plane(order, light, position, u, v):
    """Return whether Mitsuba's density at (u, v) is 0, for a point on the rectangle light.

    The direction lies in the rectangle's plane, so rounding decides.
    """
    m = order.rectangles
    n = column3(m, 12, light)
    if n.x == np.float32(0.0) and n.y == np.float32(0.0) and n.z == np.float32(0.0):
        return False  # not a rectangle
    x = fused_multiply_add(u, np.float32(2.0), np.float32(-1.0))
    y = fused_multiply_add(v, np.float32(2.0), np.float32(-1.0))
    place = vec3(x, y, np.float32(0.0))
    p = vec3(
        fused_affine(column3(m, 0, light), m[3, light], place),
        fused_affine(column3(m, 4, light), m[7, light], place),
        fused_affine(column3(m, 8, light), m[11, light], place),
    )
    d = p - position
    d = d * (np.float32(1.0) / np.sqrt((d.x * d.x + d.z * d.z) + d.y * d.y))
    return (d.x * n.x + d.y * n.y) + d.z * n.z == np.float32(0.0)


@kernel
def own_sphere_sample(order, light, p, u):
    """Return whether Mitsuba samples a point of the sphere light at that point itself.

    Also return the vector from there to the sampled point, which is rounding alone. In 60 %
    of the samples it is 0, and with it the density; its side decides which medium the
    shadow ray is in. `u` is the part of the cone. With these operations the lengths of
    11,948 of 11,948 samples were Mitsuba's in all bits.
    """
    one, zero = np.float32(1.0), np.float32(0.0)
    center, radius = column3(order.spheres, 0, light), order.spheres[3, light]
    if radius == zero:
        return False, p  # not a sphere, or it shines inwards
    away = p - center
    inverse = one / np.sqrt((away.x * away.x + away.z * away.z) + away.y * away.y)
    sine = radius * inverse
    whole = np.sqrt(max(one - sine * sine, zero))  # cosine of half the cone
    cosine = fused_multiply_add(whole - one, u, one)
    sine2 = fused_multiply_add(-cosine, cosine, one)
    sine = one / sine
    rest = np.sqrt(max(fused_multiply_add(-sine2, sine * sine, one), zero))
    cosine = np.sqrt(max(one - sine2, zero))
    # at the centre, between p and the sampled point
    cosine = fused_multiply_add(cosine, rest, sine2 * sine)
    sampled = fused_sum(away * inverse * cosine, radius, center)
    return fused_multiply_add(-cosine, cosine, one) <= zero, sampled - p


@kernel
def pixel_of(tile, slot):
    """Return the index of a slot's pixel in the full film."""
    x, y = slot_pixel(slot, 0)
    return (y + tile.y) * tile.film_width + x + tile.x


@kernel
def pixels_of(tile, slot):
    """Return the indices of the pixels of 16 slots."""
    return as_i32(sample_key(tile, slot).pixel)


@kernel
def draw_each(replay, tile, sample, slots, i, mask, numbers):
    """Return the next number of each masked slot i to i + 15; overwrites `numbers`."""
    bits = mask_bits(mask)
    slot = load_row(slots, 0, i)
    while bits != 0:
        j = lowest_bit(bits)
        bits &= bits - 1
        pixel = pixel_of(tile, lane(slot, j))
        numbers[0, i + j] = next_1d(replay.sequence, pixel, sample)
    return load_row(numbers, 0, i)


@kernel
def draw_depths(replay, tile, sample, slots, i, mask, numbers):
    """Return -ln(1 - u) of the next numbers u, rounded once as by the C library."""
    u = draw_each(replay, tile, sample, slots, i, mask, numbers)
    bits = mask_bits(mask)
    while bits != 0:
        j = lowest_bit(bits)
        bits &= bits - 1
        left = np.float32(1.0) - lane(u, j)
        numbers[0, i + j] = np.float32(-math.log(np.float64(left)))
    return load_row(numbers, 0, i)


@kernel
def skip_each(replay, tile, slots, i, mask):
    """Advance the masked slots i to i + 15 as Mitsuba does in a masked-out draw."""
    bits = mask_bits(mask)
    slot = load_row(slots, 0, i)
    while bits != 0:
        j = lowest_bit(bits)
        bits &= bits - 1
        skip_1d(replay.sequence, pixel_of(tile, lane(slot, j)))


@kernel
def draw_channel(replay, tile, sample, slot):
    """Draw the colour channel of a path."""
    pixel = pixel_of(tile, slot)
    u = next_1d(replay.sequence, pixel, sample)
    channel = min(np.int32(u * np.float32(3.0)), np.int32(2))
    replay.numbers[CHANNEL, pixel] = np.float32(channel)


@kernel
def draw_light(replay, tile, sample, slot):
    """Draw the two numbers of a light sample, and mark its shadow ray as untraced."""
    pixel, numbers = pixel_of(tile, slot), replay.numbers
    x, y = next_2d(replay.sequence, pixel, sample)
    numbers[LIGHT, pixel], numbers[LIGHT + 1, pixel] = x, y
    numbers[PASSED, pixel] = TO_DO


@kernel
def nothing_passes(replay, pixel):
    """Set the transmittance of a pixel's shadow ray to 0."""
    for c in range(3):
        replay.numbers[PASSED + c, pixel] = np.float32(0.0)


@kernel
def draw_direction(replay, tile, sample, slot):
    """Draw the numbers of a BSDF or a phase function, the pair first.

    They are arguments of one call, which the wheel's compiler evaluates from right to left.
    """
    pixel, numbers = pixel_of(tile, slot), replay.numbers
    x, y = next_2d(replay.sequence, pixel, sample)
    numbers[BSDF, pixel], numbers[BSDF + 1, pixel] = x, y
    numbers[BSDF_CHOICE, pixel] = next_1d(replay.sequence, pixel, sample)
