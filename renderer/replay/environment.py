"""Environment maps in a replay: Mitsuba's mapping between directions and texels.

Mitsuba's arc tangent is off by up to 6e-7, its position in the image is rounded three
times, and a number that chose one texel among 10^5 has few digits left. Where a map is
steep, light then differs by 1e-4. With the same operations, fused as in its wheels, (u, v)
of 20000 of 20000 samples agreed in all bits. Its last row's sine is that of a pi that is
8.7e-8 too large, so it and the densities there are negative. Without that, 98 of 100
samples of some maps differ.

Only positions and directions are replaced, and by no more than rounding. Radiance and
density at a position are the renderer's own, so a defect in them is not hidden.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.errors import NotReplayable
from renderer.kernels.jit import entry_kernel, kernel
from renderer.kernels.lanes.functions import (
    fabs,
    floor,
    maximum,
    minimum,
    select,
    splat_f32,
    splat_i32,
    sqrt,
    to_f32,
    to_i32,
)
from renderer.kernels.lanes.memory import gather_row, load_row, store_row
from renderer.kernels.lanes.vectors import column, select3, vec3
from renderer.plugins.lights.environment import distant_sample, environment_light
from renderer.plugins.lights.envmap import (
    INV_TWO_PI,
    EnvironmentMaps,
    by_solid_angle,
    half_texel,
    image_density,
    image_point,
    importance,
    latitudes,
    sphere_point,
    texel_place,
    texel_radiance,
)
from renderer.plugins.lights.kind import sample_light
from renderer.plugins.sampling.hierarchical_warp import (
    FLAT,
    Warp,
    choose_patch,
    corners,
    make_warp,
    sample_warp,
    warp_density,
)
from renderer.plugins.sampling.numbers_and_warps import INV_PI, TWO_PI
from renderer.replay.arithmetic import Floats, arccos_as_mitsuba, arctan2_as_mitsuba, fused
from renderer.replay.directions import sincos_as_mitsuba
from renderer.replay.light_rounding import rounded_luminance
from renderer.scene_file.description import EnvironmentMap

# Bounds of rounding errors in radians: of a direction chosen by random numbers (3.4e-5 for
# steep maps of 512 x 256 texels), of the position at which a direction is looked up, and
# of sines, cosines and sums of three products.
_CHOSEN = np.float32(1e-4)
_FOUND = np.float32(2e-6)
_TURNED = np.float32(1e-6)
_TEXELS = np.float32(2.0**-22)  # of the columns or rows: a position rounded four times
_NUMBER = 2.0**-22  # of a random number in [0, 1), rounded at each level of the pyramid
_SINE = 1.3e-7  # of row sines: 8.7e-8 in the last row, plus rounding
_PI = np.float32(np.pi)
_TWICE_PI = np.float32(2.0 * np.pi)


class RoundedEnvironment(NamedTuple):
    """An environment map with both our and Mitsuba's mapping."""

    own: EnvironmentMaps
    warp: Warp  # of luminance times sine, with Mitsuba's rounding
    share: float  # fraction of samples that sines off by `_SINE` send to other patches
    rows: NDArray[np.float32]  # (rows of patches,) fraction of all samples


def rounded_environment(own: EnvironmentMaps, sky: EnvironmentMap) -> RoundedEnvironment:
    """Return the additional tables of an environment map for a replay.

    Raises
    ------
    NotReplayable
        If Mitsuba cannot sample the map: it divides by the sum of its weights, which is 0,
        or negative because of the last row's sine.
    """
    luminance = rounded_luminance(*np.moveaxis(sky.pixels, -1, 0))
    compensated = sky.mis_compensation
    sine = _sines(latitudes(len(sky.pixels)))
    density = importance(luminance, sine, compensated=compensated)
    flat = importance(luminance, np.ones_like(sine), compensated=compensated)
    total = float(density.sum(dtype=np.float64))
    if total <= 0.0 or not density[1:-1].any():
        raise NotReplayable(
            "sampler 'mitsuba': the envmap is black, or shines in its first and last row "
            "alone (with mis_compensation: more than its mean), so that Mitsuba has no "
            "densities but what rounding leaves; possible is one that shines elsewhere"
        )
    warp = make_warp(density)
    share = _SINE * float(flat.sum(dtype=np.float64)) / total
    patches = density[:-1] + density[1:]
    rows = (patches[:, :-1] + patches[:, 1:]).sum(axis=1, dtype=np.float64)
    rows = np.maximum(rows / rows.sum(), 0.0).astype(np.float32)
    return RoundedEnvironment(own, own.warp if warp is None else warp, share, rows)


def _sines(angle: Floats) -> Floats:
    padded = np.pad(angle, (0, -len(angle) % 16))
    _fill_sines(padded, padded)
    return padded[: len(angle)]


@entry_kernel
def _fill_sines(angle, sine):
    for i in range(0, angle.size, 16):
        value, _ = sincos_as_mitsuba(load_row(angle, 0, i))
        store_row(sine, 0, i, value)


@kernel
def _between(a, b, t):
    return fused(b, t, fused(-a, t, a))


@kernel
def _linear(a, b, x):
    """Return the x-quantile of the area below a line from a to b."""
    steep = fabs(a - b) > FLAT * (a + b)
    below = sqrt(maximum(_between(a * a, b * b, x), splat_f32(0.0)))
    slope = select(steep, a - b, splat_f32(1.0))
    return select(steep, (a - below) / slope, x)


@kernel
def _sample_warp(warp, x, y, mask):
    """Return (u, v), the density there, and a bound of its rounding error.

    The bound is a fraction of the largest density at the patch's corners; negative corners
    count with their magnitude.
    """
    column, row, x, y = choose_patch(warp, x, y, mask)
    v00, v10, v01, v11 = corners(warp, column, row, mask)
    y = _linear(v00 + v10, v01 + v11, y)
    left, right = _between(v00, v01, y), _between(v10, v11, y)
    x = _linear(left, right, x)
    u = (to_f32(column) + x) * np.float32(1.0 / warp.columns)
    v = (to_f32(row) + y) * np.float32(1.0 / warp.rows)
    largest = maximum(maximum(v00, v10), maximum(v01, v11))
    least = minimum(minimum(v00, v10), minimum(v01, v11))
    moved = largest * (_TEXELS * np.float32(warp.columns))
    moved = moved + maximum(-least, splat_f32(0.0))
    return u, v, _between(left, right, x), moved


@kernel
def _image_point(own, direction):
    local = _rotated(own.to_local, direction)
    u = arctan2_as_mitsuba(local.x, -local.z) * INV_TWO_PI
    return u, arccos_as_mitsuba(local.y) * INV_PI


@kernel
def _sphere_point(own, u, v):
    sine, cosine = sincos_as_mitsuba(v * _PI)
    across, along = sincos_as_mitsuba(u * TWO_PI)
    return _rotated(own.to_world, vec3(across * sine, cosine, -(along * sine))), sine


@kernel
def _rotated(matrix, d):
    a, b, c = column(matrix, 0), column(matrix, 1), column(matrix, 2)
    return vec3(
        fused(c.x, d.z, fused(b.x, d.y, a.x * d.x)),
        fused(c.y, d.z, fused(b.y, d.y, a.y * d.x)),
        fused(c.z, d.z, fused(b.z, d.y, a.z * d.x)),
    )


@kernel
def _texel_place(own, u, v):
    """Return the position in an image of W + 2 columns, as Mitsuba computes it."""
    across, down = np.float32(own.width + 2), np.float32(own.height)
    v = minimum(maximum(v, splat_f32(0.0)), splat_f32(1.0))
    x = fused(u - floor(u), np.float32(own.width), splat_f32(1.0)) / across
    y = fused(v, np.float32(own.height - 1), splat_f32(0.5)) / down
    x, y = fused(x, across, splat_f32(-0.5)), fused(y, down, splat_f32(-0.5))
    return maximum(x, splat_f32(0.0)), maximum(y, splat_f32(0.0))


# ------------------------------------------ our positions, corrected by Mitsuba's rounding


@kernel
def _nearby(u, v, own_u, own_v, sine, angle):
    """Return (u, v), or our own if they are more than `angle` apart, in radians.

    Near a pole a last bit changes the arc cosine and tangent a lot, the direction little.
    """
    turned = u - own_u
    turned = turned - floor(turned + 0.5)
    away = maximum(fabs(turned) * _TWICE_PI, fabs(v - own_v) * _PI) * sine
    same = away <= angle
    return select(same, u, own_u), select(same, v, own_v)


@kernel
def _is_reached(sky, x, y, u, v, mask):
    """Return the mask of (u, v) that our warp reaches from random numbers within rounding.

    Where a density begins at 0, the position is the square root of the random number's
    remainder. Where nearly all of a map is 0, the sign of the last row's sine matters.
    """
    step = np.float32(_NUMBER + sky.share)
    row = minimum(to_i32(v * np.float32(sky.warp.rows)), splat_i32(sky.warp.rows - 1))
    # a number that chooses within a row has only the row's share of the digits
    along = step / maximum(gather_row(sky.rows, 0, row, mask), splat_f32(step))
    least_u, least_v = splat_f32(1.0), splat_f32(1.0)
    most_u, most_v = splat_f32(0.0), splat_f32(0.0)
    for corner in range(4):
        dx = along if corner & 1 else -along
        dy = step if corner & 2 else -step
        near_u, near_v, _ = sample_warp(sky.own.warp, x + dx, y + dy, mask)
        least_u, most_u = minimum(least_u, near_u), maximum(most_u, near_u)
        least_v, most_v = minimum(least_v, near_v), maximum(most_v, near_v)
    return (u >= least_u) & (u <= most_u) & (v >= least_v) & (v <= most_v)


@kernel
def _radiance(own, u, v, mask):
    own_x, own_y = texel_place(own, u, v)
    x, y = _texel_place(own, u, v)
    across = fabs(x - own_x) <= _TEXELS * np.float32(own.width + 2)
    down = fabs(y - own_y) <= _TEXELS * np.float32(own.height)
    return texel_radiance(own, select(across, x, own_x), select(down, y, own_y), mask)


@sample_light.by(RoundedEnvironment)
@kernel
def _sample(sky, kind, light, mask, position, x, y, z):
    own = sky.own
    own_u, own_v, own_density = sample_warp(own.warp, x, y, mask)
    u, v, density, within = _sample_warp(sky.warp, x, y, mask)
    _, own_sine = sphere_point(own, own_u, own_v)
    near_u, near_v = _nearby(u, v, own_u, own_v, own_sine, _CHOSEN)
    reached = _is_reached(sky, x, y, u, v, mask)
    u, v = select(reached, u, near_u), select(reached, v, near_v)
    # the density of our own sample, moved to Mitsuba's position
    before = warp_density(own.warp, own_u, own_v, mask)
    moved = warp_density(own.warp, u, v, mask)
    moved = own_density * select(before > 0.0, moved / before, splat_f32(1.0))
    same = fabs(density - moved) <= within + moved * np.float32(sky.share)
    density = select(same, density, moved)
    u = u + half_texel(own)
    own_wi, own_sine = sphere_point(own, u, v)
    wi, sine = _sphere_point(own, u, v)
    apart = wi - own_wi
    turned = maximum(fabs(apart.x), maximum(fabs(apart.y), fabs(apart.z)))
    wi = select3(turned <= _TURNED, wi, own_wi)
    sine = select(fabs(sine - own_sine) <= _TURNED, sine, own_sine)
    pdf = by_solid_angle(density, sine)
    return distant_sample(own, position, wi, _radiance(own, u, v, mask), pdf)


@environment_light.by(RoundedEnvironment)
@kernel
def _light(sky, position, direction, mask):
    own = sky.own
    own_u, own_v, sine = image_point(own, direction)
    u, v = _image_point(own, direction)
    u, v = _nearby(u, v, own_u, own_v, sine, _FOUND)
    density = image_density(own, u, v, mask)
    return _radiance(own, u, v, mask), by_solid_angle(density, sine)
