"""Records that stages hand on: rays, hits, surface points, shadow rays, tiles, tallies."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import as_u32

# --------------------------------------------------------------------------------- tile
# Tiles of the film, and the slots of a tile: one for each sample of each of its pixels.
#
# 4^level samples of a pixel are traced together. Each has a place on a grid that is
# 2^level times as fine as the film, where the samples of a pixel lie side by side. A
# batch is a square of the tile, of 32 x 32 places. So the rays of a batch, and the 16 of
# a packet, lie as close to each other as those of a film of 4^level times as many pixels.
# No number depends on it.


class Tile(NamedTuple):
    """A rectangle of at most 32 x 32 pixels, in coordinates of the full film."""

    x: int
    y: int
    width: int
    height: int
    film_width: int  # of the full film
    level: int = 0  # 4 ** level samples of each pixel are traced together
    square: int = 0  # of as many, the first that is traced
    squares: int = 1  # and how many are traced together


class SampleKey(NamedTuple):
    """What the random numbers of samples depend on, with the first of their numbers."""

    pixel: Any  # (16,) uint32 number in the full film
    later: Any  # (16,) uint32 by how much a sample's number is larger than the first one


TILE_SIZE = 32  # CAPACITY = TILE_SIZE ** 2
_SIDE_BITS = 5  # of a place's x, and y, in its square
_SQUARE_BITS = 10  # of a slot, below the number of its square


@kernel
def _place(slot, level):
    """Return the (x, y) of slots on the fine grid; 16 neighbours are 4 x 4 places."""
    square = slot >> _SQUARE_BITS
    across, down = square & ((1 << level) - 1), square >> level
    x = (slot & 3) | (((slot >> 4) & 7) << 2) | (across << _SIDE_BITS)
    y = ((slot >> 2) & 3) | (((slot >> 7) & 7) << 2) | (down << _SIDE_BITS)
    return x, y


@kernel
def slot_pixel(slot, level):
    """Return the (x, y) of slots in a tile."""
    x, y = _place(slot, level)
    return x >> level, y >> level


@kernel
def pixel_slot(x, y, later, level):
    """Return the slot of sample `later`, of those together, of the pixel (x, y)."""
    inside = (1 << level) - 1
    x = (x << level) | (later & inside)
    y = (y << level) | (later >> level)
    square = (x >> _SIDE_BITS) | ((y >> _SIDE_BITS) << level)
    x, y = x & (TILE_SIZE - 1), y & (TILE_SIZE - 1)
    slot = (x & 3) | ((y & 3) << 2) | ((x >> 2) << 4) | ((y >> 2) << 7)
    return slot | (square << _SQUARE_BITS)


@kernel
def sample_key(tile, slot):
    """Return the key of the random numbers of slots."""
    x, y = _place(slot, tile.level)
    inside = (1 << tile.level) - 1
    later = (x & inside) | ((y & inside) << tile.level)
    row = (y >> tile.level) + tile.y
    pixel = row * tile.film_width + (x >> tile.level) + tile.x
    return SampleKey(as_u32(pixel), as_u32(later))


@kernel
def square_of(tile, square):
    """Return the tile with one square alone."""
    return Tile(
        tile.x, tile.y, tile.width, tile.height, tile.film_width, tile.level, square, 1
    )


@kernel
def has_places(tile):
    """Return whether the tile's square has a pixel: at an edge of the film it may not."""
    x, y = slot_pixel(tile.square << _SQUARE_BITS, tile.level)
    return x < tile.width and y < tile.height


# -------------------------------------------------------------------------------- tally
# Counting what an accelerator does for each ray; costs nothing without a tally.
#
# Every traversal has a parameter `tally`. Given None, Numba compiles it without the
# counting; given an array, it compiles a twin that counts.

# rows of the array
NODES = 0  # tree nodes, cells or voxels visited
BOXES = 1  # tests of the ray against a box or a splitting plane
PRIMITIVES = 2  # tests of the ray against a primitive
SAVED = 3  # primitive tests that mailboxing saved
STACK = 4  # largest number of nodes that waited on the stack
ROWS = 5
NAMES = ("nodes", "box tests", "primitive tests", "mailbox saves", "stack depth")


def make_tally(rays: int) -> NDArray[np.int32]:
    """Return counters at zero, (ROWS, rays), with room for 16 rays more."""
    return np.zeros((ROWS, rays + 16), np.int32)


@kernel
def add_to(tally, row, i, amount):
    """Add to a counter of ray i."""
    if tally is None:
        return
    tally[row, i] += amount


@kernel
def add_to_packet(tally, row, i, count, amount):
    """Add to a counter of each of the first `count` of the 16 rays from i on."""
    if tally is None:
        return
    for j in range(i, i + min(count, 16)):
        tally[row, j] += amount


@kernel
def note_stack(tally, i, depth):
    """Note how many nodes wait for ray i."""
    if tally is None:
        return
    tally[STACK, i] = max(tally[STACK, i], depth)


@kernel
def note_packet_stack(tally, i, count, depth):
    """Note how many nodes wait for the first `count` of the 16 rays from i on."""
    if tally is None:
        return
    for j in range(i, i + min(count, 16)):
        tally[STACK, j] = max(tally[STACK, j], depth)


# -------------------------------------------------------------------------------- batch
# A batch of paths as structure of arrays: the records that the stages hand on.
#
# All arrays are float32 or int32 with one row for each component. A row has room for
# `CAPACITY` paths and a padding that is no multiple of a power of two: rows that lie 4 or
# 8 KB apart fall into the same cache sets, which halved the speed in a trial.

CAPACITY = 1024  # camera rays of a batch: a part of a tile (`Tile`)
PADDING = 48

# bits of what a path has met
HOLES_ALONE = np.int32(1)  # nothing yet but what rays go straight through
ROUGH = np.int32(2)  # a smooth lobe
CAUSTIC = np.int32(4)  # a mirror or glass after that


class Rays(NamedTuple):
    """Rays to be traced, each with the state of its path."""

    origin: NDArray[np.float32]  # (3, n) world
    direction: NDArray[np.float32]  # (3, n) unit
    throughput: NDArray[np.float32]  # (3, n) product of BSDF * cos / pdf so far
    pdf: NDArray[np.float32]  # (n,) [1/sr] of the direction; 0: a mirror or the camera
    eta: NDArray[np.float32]  # (n,) product of relative indices of refraction
    lobe: NDArray[np.int32]  # (n,) of the BSDF that was left, see `bsdfs.kind`
    slot: NDArray[np.int32]  # (n,) sample of a pixel of the tile: whose path it is
    point: NDArray[np.int32]  # (n,) column of the surface point that it has just left
    # (3, n) position of that point, which the origin is offset from; (3, 0): not kept
    previous: NDArray[np.float32]
    met: NDArray[np.int32]  # (slots,) bits of what each path has met, if stages need it


class Hits(NamedTuple):
    """The nearest hit of each ray."""

    t: NDArray[np.float32]  # (n,) in: the ray's end; out: the hit's distance
    prim: NDArray[np.int32]  # (n,) primitive id, -1 for a miss
    u: NDArray[np.float32]  # (n,) the primitive's own coordinates
    v: NDArray[np.float32]  # (n,)
    instance: NDArray[np.int32]  # (n,) -1: none; valid in scenes that have instances


class ShadowRays(NamedTuple):
    """Segments between surface points and lights, with what they carry if unblocked."""

    origin: NDArray[np.float32]  # (3, n) world
    direction: NDArray[np.float32]  # (3, n) unit
    t_max: NDArray[np.float32]  # (n,)
    radiance: NDArray[np.float32]  # (3, n) contribution to the pixel
    slot: NDArray[np.int32]  # (n,)
    # (n,) 1 where something is in between; then the places of those where nothing is
    blocked: NDArray[np.int32]


class SurfacePoints(NamedTuple):
    """Hits that have something to do next, grouped by it, with all that shading needs."""

    position: NDArray[np.float32]  # (3, n) world
    wo: NDArray[np.float32]  # (3, n) unit, back along the ray
    normal: NDArray[np.float32]  # (3, n) geometric, unit
    shading_normal: NDArray[np.float32]  # (3, n) unit
    offset: NDArray[np.float32]  # (n,) how far off the surface new rays start
    uv: NDArray[np.float32]  # (2, n)
    tangent: NDArray[np.float32]  # (3, n) dp/du in world, not unit; if `Settings` say so
    shape: NDArray[np.int32]  # (n,)
    prim: NDArray[np.int32]  # (n,)
    t: NDArray[np.float32]  # (n,)
    throughput: NDArray[np.float32]  # (3, n)
    pdf: NDArray[np.float32]  # (n,)
    eta: NDArray[np.float32]  # (n,)
    slot: NDArray[np.int32]  # (n,)
    bsdf: NDArray[np.int32]  # (n,) seen from wo; -1: of another kind than the group's
    parameters: NDArray[np.float32]  # (rows, n) of that BSDF, textures looked up
    previous: NDArray[np.float32]  # (3, n) as in `Rays`
    met: NDArray[np.int32]  # (slots,) that of `Rays`


class LightSamples(NamedTuple):
    """One direction to a light for each surface point."""

    light: NDArray[np.int32]  # (n,)
    wi: NDArray[np.float32]  # (3, n) unit, towards the light
    distance: NDArray[np.float32]  # (n,)
    radiance: NDArray[np.float32]  # (3, n) arriving, over the density
    # (n,) [1/sr] given the light, or with its probability if that differs by light; 0: a
    # point or a direction
    pdf: NDArray[np.float32]


class MediaWork(NamedTuple):
    """What integrators of participating media need in addition; empty for the others."""

    medium: NDArray[np.int32]  # (slots,) that each path is in
    depth: NDArray[np.int32]  # (slots,) segments of each path before this one
    # (slots,) shape of the surface point of each path, and (3, slots) its normal
    shape: NDArray[np.int32]
    normal: NDArray[np.float32]
    collisions: SurfacePoints  # points in media; `bsdf` is the medium
    # shadow rays on their way: `point` is the number of the shadow ray
    rays: Rays
    hits: Hits
    points: SurfacePoints
    order: NDArray[np.int32]
    ends: NDArray[np.int64]
    # by the number of the shadow ray: (n,) the medium it is in, and how far it has to go
    inside: NDArray[np.int32]
    rest: NDArray[np.float32]
    # (n,) by ray: the integral of the light of lamps nearby (`plugins.media.equiangular`)
    lit: NDArray[np.float32]


class PaneWork(NamedTuple):
    """What light samples through panes need; empty where there are none."""

    # (slots,) light ahead of each path that only panes have refracted since its last smooth
    # lobe, or `NO_AIM`, `SKY_AIM`; and the weight of that light
    aim: NDArray[np.int32]
    share: NDArray[np.float32]
    # (slots,) light of each light sample that crosses a pane; `SKY_AIM`: the environment
    sampled: NDArray[np.int32]
    crosses: NDArray[np.int32]  # (n,) by surface point: 1 where its light sample does
    # these samples on their way
    rays: Rays
    hits: Hits
    points: SurfacePoints
    order: NDArray[np.int32]
    ends: NDArray[np.int64]
    density: NDArray[np.float32]  # (2, n) [1/sr] by ray, and by point


NO_AIM = np.int32(-1)
SKY_AIM = np.int32(-2)


class Workspace(NamedTuple):
    """All arrays that one thread works in."""

    rays: Rays
    hits: Hits
    shadow_rays: ShadowRays
    points: SurfacePoints
    light_samples: LightSamples
    # (4, slots) place of each sample on the film [pixels], and in [0, 1) on the lens
    film: NDArray[np.float32]
    numbers: NDArray[np.float32]  # (4, n) random numbers for each surface point
    order: NDArray[np.int32]  # (n,) hits sorted by what they need next
    ends: NDArray[np.int64]  # (kinds + 1,) where each kind of BSDF begins and ends in it
    radiance: NDArray[np.float32]  # (channels, slots) of the samples of a tile
    splats: NDArray[np.float64]  # a tile's sums, pixel by pixel, and a row of weights
    waiting: NDArray[np.int64]  # (depths,) rays that wait at each depth of Whitted's tree
    tally: NDArray[np.int32] | None  # (ROWS, n) work of each ray; None: not counted
    media: MediaWork
    panes: PaneWork


def _rows(count: int, capacity: int) -> NDArray[np.float32]:
    return np.zeros((count, capacity + PADDING), np.float32)


def _row(capacity: int) -> NDArray[np.float32]:
    return np.zeros(capacity + PADDING, np.float32)


def _numbers(capacity: int) -> NDArray[np.int32]:
    return np.zeros(capacity + PADDING, np.int32)


def _aligned(count: int) -> NDArray[np.float64]:
    """Return numbers of which eight, and so four, share a cache line."""
    raw = np.zeros(count + 8)
    first = -(raw.ctypes.data // 8) % 8
    return raw[first : first + count]


def _rays(capacity: int, previous_points: bool, met: NDArray[np.int32]) -> Rays:
    return Rays(
        _rows(3, capacity),
        _rows(3, capacity),
        _rows(3, capacity),
        _row(capacity),
        _row(capacity),
        _numbers(capacity),
        _numbers(capacity),
        _numbers(capacity),
        _rows(3, capacity) if previous_points else np.zeros((3, 0), np.float32),
        met,
    )


def _hits(capacity: int) -> Hits:
    return Hits(
        _row(capacity),
        _numbers(capacity),
        _row(capacity),
        _row(capacity),
        _numbers(capacity),
    )


def _points(
    n: int, parameters: int, previous_points: bool, met: NDArray[np.int32]
) -> SurfacePoints:
    return SurfacePoints(
        _rows(3, n),
        _rows(3, n),
        _rows(3, n),
        _rows(3, n),
        _row(n),
        _rows(2, n),
        _rows(3, n),
        _numbers(n),
        _numbers(n),
        _row(n),
        _rows(3, n),
        _row(n),
        _row(n),
        _numbers(n),
        _numbers(n),
        _rows(-(-parameters // 4) * 4, n),  # they are loaded by fours
        _rows(3, n) if previous_points else np.zeros((3, 0), np.float32),
        met,
    )


def _media_work(capacity: int, slots: int, kinds: int, parameters: int) -> MediaWork:
    """Return the arrays for batches of `capacity` paths; 0 for none of them."""
    met, n = _numbers(slots), 2 * capacity
    return MediaWork(
        _numbers(slots),
        _numbers(slots),
        _numbers(slots),
        _rows(3, slots),
        _points(capacity, 1, True, met),
        _rays(capacity, True, met),
        _hits(capacity),
        _points(n, parameters, True, met),
        _numbers(n),
        np.zeros(kinds + 1, np.int64),
        _numbers(capacity),
        _row(capacity),
        _row(capacity),
    )


def _pane_work(capacity: int, slots: int, kinds: int, parameters: int) -> PaneWork:
    """Return the arrays for batches of `capacity` paths; 0 for none of them."""
    n, met = 2 * capacity, _numbers(0)
    return PaneWork(
        _numbers(slots),
        _row(slots),
        _numbers(slots),
        _numbers(n),
        _rays(capacity, False, met),
        _hits(capacity),
        _points(n, parameters, False, met),
        _numbers(n),
        np.zeros(kinds + 1, np.int64),
        _rows(2, n),
    )


def make_workspace(
    *,
    ray_capacity: int = CAPACITY,
    channels: int = 3,
    depths: int = 1,
    kinds: int = 1,
    parameters: int = 1,
    counted: bool = False,
    previous_points: bool = False,
    capacity: int = CAPACITY,
    splat_size: int = 0,
    slots: int = CAPACITY,
    media: bool = False,
    panes: bool = False,
) -> Workspace:
    """Allocate for one thread.

    Parameters
    ----------
    ray_capacity : int
        Rays that can wait: `CAPACITY` for a path, more for Whitted's tree.
    channels : int
        Numbers for each pixel: 3, and those of the AOVs.
    depths : int
        Generations of rays that can wait at the same time.
    kinds : int
        Kinds of BSDF in the scene.
    parameters : int
        Rows that the BSDF with the most parameters needs.
    counted : bool
        Whether the work of the rays is counted.
    previous_points : bool
        Whether each ray keeps the exact position that it comes from.
    capacity : int
        Paths of a batch.
    splat_size : int
        Pixels on a side of a tile with the filter's border; 0 for the box, which needs no
        room.
    slots : int
        Samples of a tile that are added to its sums together: of one batch or more.
    media : bool
        Whether paths go through participating media.
    panes : bool
        Whether light samples go through panes.
    """
    met = _numbers(slots)
    rays = _rays(ray_capacity, previous_points, met)
    hits = _hits(ray_capacity)
    shadow_rays = ShadowRays(
        _rows(3, capacity),
        _rows(3, capacity),
        _row(capacity),
        _rows(3, capacity),
        _numbers(capacity),
        _numbers(capacity),
    )
    # a two-sided shape with two kinds of BSDF puts its hits in two groups
    n = 2 * capacity
    points = _points(n, parameters, previous_points, met)
    light_samples = LightSamples(_numbers(n), _rows(3, n), _row(n), _rows(3, n), _row(n))
    return Workspace(
        rays,
        hits,
        shadow_rays,
        points,
        light_samples,
        _rows(4, slots),
        _rows(4, n),
        _numbers(n),
        np.zeros(kinds + 1, np.int64),
        _rows(channels, slots),
        _aligned((channels // 4 + 1) * 4 * splat_size**2 + splat_size),
        np.zeros(depths, np.int64),
        make_tally(ray_capacity) if counted else None,
        _media_work(capacity if media else 0, slots if media else 0, kinds, parameters),
        _pane_work(capacity if panes else 0, slots if panes else 0, kinds, parameters),
    )


@kernel
def with_rays_and_points(work, rays, hits, points, order, ends):
    """Return the same workspace, but stages read and write these rays and points."""
    return Workspace(
        rays,
        hits,
        work.shadow_rays,
        points,
        work.light_samples,
        work.film,
        work.numbers,
        order,
        ends,
        work.radiance,
        work.splats,
        work.waiting,
        work.tally,
        work.media,
        work.panes,
    )
