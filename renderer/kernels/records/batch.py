"""Records that stages pass on: rays, hits, surface points, shadow rays, tiles, tallies."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import as_u32

# --------------------------------------------------------------------------------- tile
# Tiles of the film, and their slots: one slot for each sample of each pixel.
#
# 4^level samples per pixel are traced together. They are arranged on a fine grid, 2^level
# times the film's resolution, where the samples of a pixel are adjacent. A batch is a
# square of 32 x 32 places of that grid. So the rays of a batch, and the 16 rays of a
# packet, are as coherent as on a film of 4^level times as many pixels. No result depends
# on this order.


class Tile(NamedTuple):
    """A rectangle of at most 32 x 32 pixels, in coordinates of the full film."""

    x: int
    y: int
    width: int
    height: int
    film_width: int  # of the full film
    level: int = 0  # 4 ** level samples per pixel are traced together
    square: int = 0  # index of the first square that is traced
    squares: int = 1  # number of squares that are traced together


class SampleKey(NamedTuple):
    """The keys of samples' random numbers."""

    pixel: Any  # (16,) uint32 pixel index in the full film
    later: Any  # (16,) uint32 sample index minus that of the group's first sample


TILE_SIZE = 32  # CAPACITY = TILE_SIZE ** 2
_SIDE_BITS = 5  # bits of x, and of y, within a square
_SQUARE_BITS = 10  # bits of a slot within its square; the square's index is above


@kernel
def _place(slot, level):
    """Return the (x, y) of slots on the fine grid; 16 slots in order are 4 x 4 places."""
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
    """Return the slot of sample `later` of the group at the pixel (x, y)."""
    inside = (1 << level) - 1
    x = (x << level) | (later & inside)
    y = (y << level) | (later >> level)
    square = (x >> _SIDE_BITS) | ((y >> _SIDE_BITS) << level)
    x, y = x & (TILE_SIZE - 1), y & (TILE_SIZE - 1)
    slot = (x & 3) | ((y & 3) << 2) | ((x >> 2) << 4) | ((y >> 2) << 7)
    return slot | (square << _SQUARE_BITS)


@kernel
def sample_key(tile, slot):
    """Return the keys of the random numbers of slots."""
    x, y = _place(slot, tile.level)
    inside = (1 << tile.level) - 1
    later = (x & inside) | ((y & inside) << tile.level)
    row = (y >> tile.level) + tile.y
    pixel = row * tile.film_width + (x >> tile.level) + tile.x
    return SampleKey(as_u32(pixel), as_u32(later))


@kernel
def square_of(tile, square):
    """Return the tile restricted to one square."""
    return Tile(
        tile.x, tile.y, tile.width, tile.height, tile.film_width, tile.level, square, 1
    )


@kernel
def has_places(tile):
    """Return whether the tile's square has a pixel; at the film's edge it may have none."""
    x, y = slot_pixel(tile.square << _SQUARE_BITS, tile.level)
    return x < tile.width and y < tile.height


# -------------------------------------------------------------------------------- tally
# Traversal counters per ray; without a tally they cost nothing.
#
# Every traversal has a parameter `tally`. If it is None, Numba compiles no counting; for an
# array it compiles a second version that counts.

# rows of the array
NODES = 0  # tree nodes, cells or voxels visited
BOXES = 1  # tests of the ray against a box or a splitting plane
PRIMITIVES = 2  # tests of the ray against a primitive
SAVED = 3  # primitive tests that mailboxing saved
STACK = 4  # largest stack depth
ROWS = 5
NAMES = ("nodes", "box tests", "primitive tests", "mailbox saves", "stack depth")


def make_tally(rays: int) -> NDArray[np.int32]:
    """Return counters (ROWS, rays) set to zero, padded by 16 rays."""
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
    """Update the largest stack depth of ray i."""
    if tally is None:
        return
    tally[STACK, i] = max(tally[STACK, i], depth)


@kernel
def note_packet_stack(tally, i, count, depth):
    """Update the largest stack depth of the first `count` of 16 rays from i on."""
    if tally is None:
        return
    for j in range(i, i + min(count, 16)):
        tally[STACK, j] = max(tally[STACK, j], depth)


# -------------------------------------------------------------------------------- batch
# A batch of paths as structure of arrays: the records that the stages pass on.
#
# All arrays are float32 or int32 with one row per component. A row has room for
# `CAPACITY` paths and a padding that is no multiple of a power of two. Rows 4 or 8 KB apart
# would map to the same cache sets, which halved the speed in a trial.

CAPACITY = 1024  # camera rays of a batch: one square of a tile
PADDING = 48

# bits of a path's history
HOLES_ALONE = np.int32(1)  # it has only passed straight through surfaces
ROUGH = np.int32(2)  # it has scattered at a smooth lobe
CAUSTIC = np.int32(4)  # it has met a delta lobe after a smooth one


class Rays(NamedTuple):
    """Rays to be traced, each with the state of its path."""

    origin: NDArray[np.float32]  # (3, n) world
    direction: NDArray[np.float32]  # (3, n) unit
    throughput: NDArray[np.float32]  # (3, n) product of BSDF * cos / pdf so far
    pdf: NDArray[np.float32]  # (n,) [1/sr] of the direction; 0: delta lobe or camera ray
    eta: NDArray[np.float32]  # (n,) product of relative indices of refraction
    lobe: NDArray[np.int32]  # (n,) lobe that was sampled, see `bsdfs.kind`
    slot: NDArray[np.int32]  # (n,) sample slot of the path
    point: NDArray[np.int32]  # (n,) column of the surface point that the ray starts from
    # (3, n) position of that point, without the offset of `origin`; (3, 0): not kept
    previous: NDArray[np.float32]
    met: NDArray[np.int32]  # (slots,) history bits of each path, if stages need them


class Hits(NamedTuple):
    """The nearest hit of each ray."""

    t: NDArray[np.float32]  # (n,) in: the ray's end; out: the hit's distance
    prim: NDArray[np.int32]  # (n,) in: t_max; out: the hit's t
    u: NDArray[np.float32]  # (n,) coordinates on the primitive
    v: NDArray[np.float32]  # (n,)
    instance: NDArray[np.int32]  # (n,) id, -1: none; valid in scenes that have instances


class ShadowRays(NamedTuple):
    """Segments between surface points and lights, with their unoccluded contribution."""

    origin: NDArray[np.float32]  # (3, n) world
    direction: NDArray[np.float32]  # (3, n) unit
    t_max: NDArray[np.float32]  # (n,)
    radiance: NDArray[np.float32]  # (3, n) contribution to the pixel
    slot: NDArray[np.int32]  # (n,)
    # (n,) 1 if occluded; later the indices of the unoccluded rays
    blocked: NDArray[np.int32]


class SurfacePoints(NamedTuple):
    """Hits grouped by their next stage, with all that shading needs."""

    position: NDArray[np.float32]  # (3, n) world
    wo: NDArray[np.float32]  # (3, n) unit, back along the ray
    normal: NDArray[np.float32]  # (3, n) geometric, unit
    shading_normal: NDArray[np.float32]  # (3, n) unit
    offset: NDArray[np.float32]  # (n,) distance of new ray origins from the surface
    uv: NDArray[np.float32]  # (2, n)
    tangent: NDArray[np.float32]  # (3, n) dp/du in world, not unit; if `with_tangents`
    shape: NDArray[np.int32]  # (n,)
    prim: NDArray[np.int32]  # (n,)
    t: NDArray[np.float32]  # (n,)
    throughput: NDArray[np.float32]  # (3, n)
    pdf: NDArray[np.float32]  # (n,)
    eta: NDArray[np.float32]  # (n,)
    slot: NDArray[np.int32]  # (n,)
    bsdf: NDArray[np.int32]  # (n,) on the side of wo; -1: of another kind than the group's
    parameters: NDArray[np.float32]  # (rows, n) of that BSDF, with textures evaluated
    previous: NDArray[np.float32]  # (3, n) as in `Rays`
    met: NDArray[np.int32]  # (slots,) shared with `Rays`


class LightSamples(NamedTuple):
    """One light sample per surface point."""

    light: NDArray[np.int32]  # (n,)
    wi: NDArray[np.float32]  # (3, n) unit, towards the light
    distance: NDArray[np.float32]  # (n,)
    radiance: NDArray[np.float32]  # (3, n) incident radiance / pdf
    # (n,) [1/sr] conditional on the light; includes the light's probability if that is not
    # the same for all lights. 0: a delta light
    pdf: NDArray[np.float32]


class MediaWork(NamedTuple):
    """Additional arrays for participating media; empty for other integrators."""

    medium: NDArray[np.int32]  # (slots,) medium id of each path
    depth: NDArray[np.int32]  # (slots,) number of earlier segments of each path
    # (slots,) shape of each path's surface point, and (3, slots) its normal
    shape: NDArray[np.int32]
    normal: NDArray[np.float32]
    collisions: SurfacePoints  # scattering events in media; `bsdf` is the medium id
    # shadow rays that are being traced: `point` is the shadow ray's index
    rays: Rays
    hits: Hits
    points: SurfacePoints
    order: NDArray[np.int32]
    ends: NDArray[np.int64]
    # (n,) by shadow ray: its medium id, and the remaining distance
    inside: NDArray[np.int32]
    rest: NDArray[np.float32]
    # (n,) by ray: integral of the light of nearby lamps (`plugins.media.equiangular`)
    lit: NDArray[np.float32]


class PaneWork(NamedTuple):
    """Arrays for light samples through panes; empty if there are none."""

    # (slots,) first light ahead of each path, if only panes have refracted it since its
    # last smooth lobe; or `NO_AIM`, `SKY_AIM`. And the MIS weight of that light
    aim: NDArray[np.int32]
    share: NDArray[np.float32]
    # (slots,) light of each light sample that crosses a pane; `SKY_AIM`: the environment
    sampled: NDArray[np.int32]
    crosses: NDArray[np.int32]  # (n,) by surface point: 1 if its light sample does
    # the rays of these light samples
    rays: Rays
    hits: Hits
    points: SurfacePoints
    order: NDArray[np.int32]
    ends: NDArray[np.int64]
    density: NDArray[np.float32]  # (2, n) [1/sr] of light samples, by ray and by point


NO_AIM = np.int32(-1)
SKY_AIM = np.int32(-2)


class Workspace(NamedTuple):
    """All arrays that one thread works in."""

    rays: Rays
    hits: Hits
    shadow_rays: ShadowRays
    points: SurfacePoints
    light_samples: LightSamples
    # (4, slots) position of each sample on the film [pixels], and in [0, 1) on the lens
    film: NDArray[np.float32]
    numbers: NDArray[np.float32]  # (4, n) random numbers per surface point
    order: NDArray[np.int32]  # (n,) ray indices of the hits, grouped by next stage
    ends: NDArray[np.int64]  # (kinds + 1,) limits of each kind of BSDF in `order`
    radiance: NDArray[np.float32]  # (channels, slots) of the samples of a tile
    splats: NDArray[np.float64]  # a tile's sums, pixel by pixel, and a row of weights
    waiting: NDArray[np.int64]  # (depths,) waiting rays at each depth of `whitted`
    tally: NDArray[np.int32] | None  # (ROWS, n) counters of each ray; None: not counted
    media: MediaWork
    panes: PaneWork


def _rows(count: int, capacity: int) -> NDArray[np.float32]:
    return np.zeros((count, capacity + PADDING), np.float32)


def _row(capacity: int) -> NDArray[np.float32]:
    return np.zeros(capacity + PADDING, np.float32)


def _numbers(capacity: int) -> NDArray[np.int32]:
    return np.zeros(capacity + PADDING, np.int32)


def _aligned(count: int) -> NDArray[np.float64]:
    """Return an array aligned so that eight, and so four, numbers share a cache line."""
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
        _rows(-(-parameters // 4) * 4, n),  # loaded four at a time
        _rows(3, n) if previous_points else np.zeros((3, 0), np.float32),
        met,
    )


def _media_work(capacity: int, slots: int, kinds: int, parameters: int) -> MediaWork:
    """Return arrays for batches of `capacity` paths; 0 allocates none."""
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
    """Return arrays for batches of `capacity` paths; 0 allocates none."""
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
        Rays that can be stored: `CAPACITY` for a path, more for `whitted`.
    channels : int
        Channels per pixel: 3, or those of the AOVs.
    depths : int
        Depths of the ray tree, for `whitted`; otherwise 1.
    kinds : int
        Kinds of BSDF in the scene.
    parameters : int
        Largest number of parameter rows of a BSDF.
    counted : bool
        Whether traversal counters are kept.
    previous_points : bool
        Whether each ray keeps the exact position that it started from.
    capacity : int
        Paths per batch.
    splat_size : int
        Side of a tile with the filter's border [pixels]; 0 for the box, which needs no
        splats.
    slots : int
        Samples of a tile that are added to its sums together: at least one batch.
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
    # a two-sided shape with two kinds of BSDF puts a hit into two groups
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
    """Return the workspace with other rays, hits and points for the stages."""
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
