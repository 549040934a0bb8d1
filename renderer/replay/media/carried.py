"""The state that a path or shadow ray carries through media; `volpath`: its throughput.

`volpathmis` carries more (`replay.media.spectral_mis`). This file declares the operations
that the loops of a replay need of either state, and implements them for `volpath`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.integrators.stages.emission import add_emitted_light
from renderer.integrators.stages.media_shadows import cast_from_collisions
from renderer.kernels.jit import interface, kernel
from renderer.kernels.lanes.functions import select, splat_f32, to_i32
from renderer.kernels.lanes.memory import gather_row, scatter_row
from renderer.kernels.lanes.vectors import gather_rows3, select3, vec3
from renderer.plugins.media.free_flight import mean
from renderer.replay.media.record import CHANNEL, PASSED

# 1 / x of a smaller x may be infinite. Mitsuba's threads flush such numbers to 0.
_LEAST = np.float32(2.0**-126)


class Collision(NamedTuple):
    """The medium at 16 tentative collisions, and which of them are null collisions."""

    null: Any  # mask
    share: Any  # probability of a null collision
    majorant: Any  # RGB [1/length], as all coefficients here
    sigma_n: Any  # of null collisions: majorant - sigma_t
    sigma_s: Any
    sigma_t: Any
    spectral: Any  # mask of media with `has_spectral_extinction`


# ----------------------------------------------- operations on the carried state, in lanes


@interface
def worth(carried: Any) -> Any:
    """Return the throughput, RGB, for Russian roulette; a path ends at black."""


@interface
def goes_on(carried: Any) -> Any:
    """Return the mask of shadow rays with a nonzero throughput."""


@interface
def raised(carried: Any, survival: Any, mask: Any) -> Any:
    """Return the state of survivors of the roulette."""


@interface
def after_flight(carried: Any, passed: Any, density: Any, mask: Any) -> Any:
    """Return the state after a flight with transmittance and densities per colour, RGB."""


@interface
def after_collision(carried: Any, collision: Collision, mask: Any) -> Any:
    """Return the state of a path after a null or a real collision."""


@interface
def after_ratio(carried: Any, collision: Collision, mask: Any) -> Any:
    """Return the state of a shadow ray after a collision, by ratio tracking."""


# ---------------------------------------------- operations on the record that stores states


@interface
def load_path(carry: Any, pixel: Any, throughput: Any, mask: Any) -> Any:
    """Return the states of paths, given their throughputs."""


@interface
def keep_path(carry: Any, carried: Any, pixel: Any, mask: Any) -> None:
    """Store a path's state except the throughput, which is stored with the ray."""


@interface
def load_shadow_ray(carry: Any, pixel: Any, throughput: Any, mask: Any) -> Any:
    """Return the states of shadow rays, given their throughputs."""


@interface
def keep_shadow_ray(carry: Any, carried: Any, pixel: Any, mask: Any, arrives: Any) -> None:
    """Store a shadow ray's state except the throughput, and what reaches the light."""


@interface
def own_throughput(carried: Any) -> Any:
    """Return the throughput that is stored with the ray."""


@interface
def begin_path(carry: Any, pixel: int) -> None:
    """Initialise the state of a path at the camera."""


@interface
def begin_shadow_ray(carry: Any, pixel: int) -> None:
    """Initialise the state of a shadow ray of a pixel's path."""


@interface
def throughput_to_light(carry: Any, throughput: Any) -> Any:
    """Return the initial throughput of shadow rays from points of this throughput."""


@interface
def add_found_light(carry: Any, scene: Any, tile: Any, work: Any, count: int) -> None:
    """Add the emitted light of hits and of the environment, for `count` rays."""


@interface
def note_scattered(carry: Any, tile: Any, rays: Any, first: int, end: int) -> None:
    """Update the state of rays `first` to `end` - 1 after scattering or going straight."""


@interface
def cast_collisions(carry: Any, scene: Any, work: Any, count: int) -> int:
    """Append the contributions of light samples at collisions to `work.shadow_rays`."""


@interface
def passed_to_light(carry: Any, pixel: Any, ratio: Any, mask: Any) -> Any:
    """Return the transmitted fraction, RGB, of the shadow rays' light.

    `ratio` is `ShadowRays.t_max`, which holds the ratio of densities here.
    """


@kernel
def channel_of(numbers, pixel, mask):
    """Return the colour channel that determines the paths' distances, 0 to 2."""
    return to_i32(gather_row(numbers, CHANNEL, pixel, mask))


@kernel
def of_channel(color, channel):
    """Return one of the three components of a colour."""
    return select(channel == 0, color.x, select(channel == 1, color.y, color.z))


@kernel
def any_of(color):
    """Return the mask of colours that are not black."""
    return (color.x != 0.0) | (color.y != 0.0) | (color.z != 0.0)


@kernel
def rcp(x, mask):
    """Return 1 / x; 1 outside of the mask."""
    return 1.0 / select(mask, x, splat_f32(1.0))


@kernel
def rcp_or_zero(x):
    """Return 1 / x for x >= 0; 0 if x is 0 or flushed to 0 by Mitsuba."""
    usable = x >= _LEAST
    return select(usable, rcp(x, usable), splat_f32(0.0))


@kernel
def grey(x):
    """Return the colour with three components x."""
    return vec3(x, x, x)


@kernel
def scatter3(numbers, row, pixel, color, mask):
    """Store a colour to rows row to row + 2 of the masked columns `pixel`."""
    scatter_row(numbers, row, pixel, color.x, mask)
    scatter_row(numbers, row + 1, pixel, color.y, mask)
    scatter_row(numbers, row + 2, pixel, color.z, mask)


# ------------------------------------------------------------------------------- volpath


class Throughput(NamedTuple):
    """The state of a path of `volpath`."""

    rgb: Any
    channel: Any  # colour channel that determines distances


class OfThroughput(NamedTuple):
    """The record of a replay of `volpath`."""

    numbers: NDArray[np.float32]  # those of the replay


@worth.by(Throughput)
@own_throughput.by(Throughput)
@kernel
def _rgb(carried):
    return carried.rgb


@goes_on.by(Throughput)
@kernel
def _not_black(carried):
    return any_of(carried.rgb)


@kernel
def _times(carried, factor, mask):
    return Throughput(select3(mask, carried.rgb * factor, carried.rgb), carried.channel)


@raised.by(Throughput)
@kernel
def _raised(carried, survival, mask):
    return _times(carried, grey(rcp(survival, mask)), mask)


@after_flight.by(Throughput)
@kernel
def _after_flight(carried, passed, density, mask):
    pdf = of_channel(density, carried.channel)
    return _times(carried, passed * rcp_or_zero(pdf), mask)


@after_collision.by(Throughput)
@kernel
def _after_collision(carried, collision, mask):
    spectral, sigma_s = collision.spectral, collision.sigma_s
    real = mean(collision.sigma_t / collision.majorant)
    inverse = rcp(select(collision.null, collision.share, real), mask)
    of_null = select3(spectral, collision.sigma_n * inverse, grey(splat_f32(1.0)))
    of_real = select3(spectral, sigma_s * inverse, sigma_s / collision.sigma_t)
    return _times(carried, select3(collision.null, of_null, of_real), mask)


@after_ratio.by(Throughput)
@kernel
def _after_ratio(carried, collision, mask):
    left = collision.sigma_n
    ratio = select3(collision.spectral, left, left / collision.majorant)
    return _times(carried, ratio, mask)


@load_path.by(OfThroughput)
@load_shadow_ray.by(OfThroughput)
@kernel
def _load(carry, pixel, throughput, mask):
    return Throughput(throughput, channel_of(carry.numbers, pixel, mask))


@keep_path.by(OfThroughput)
@kernel
def _keep_path(carry, carried, pixel, mask):
    return


@keep_shadow_ray.by(OfThroughput)
@kernel
def _keep_shadow_ray(carry, carried, pixel, mask, arrives):
    scatter3(carry.numbers, PASSED, pixel, carried.rgb, arrives)


@begin_path.by(OfThroughput)
@begin_shadow_ray.by(OfThroughput)
@kernel
def _begin(carry, pixel):
    return


@throughput_to_light.by(OfThroughput)
@kernel
def _throughput_to_light(carry, throughput):
    return grey(splat_f32(1.0))


@add_found_light.by(OfThroughput)
@kernel
def _add_found_light(carry, scene, tile, work, count):
    add_emitted_light(scene, work, np.int64(0), count, True)


@note_scattered.by(OfThroughput)
@kernel
def _note_scattered(carry, tile, rays, first, end):
    return


@cast_collisions.by(OfThroughput)
@kernel
def _cast_collisions(carry, scene, work, count):
    return cast_from_collisions(scene, work, count)


@passed_to_light.by(OfThroughput)
@kernel
def _passed_to_light(carry, pixel, ratio, mask):
    return gather_rows3(carry.numbers, PASSED, pixel, mask)
