"""Environment map: an equirectangular image of radiance, for all directions.

There are W columns around the local y axis, with texels at their centres. The H rows are
different: the first row is the pole +y itself, the last one -y. Mitsuba has the same
conventions.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import by_columns, kernel, table_columns
from renderer.kernels.lanes.functions import (
    floor,
    maximum,
    minimum,
    splat_f32,
    splat_i32,
    sqrt,
    to_f32,
    to_i32,
)
from renderer.kernels.lanes.mathematics import arccos, arctan2, sincos
from renderer.kernels.lanes.vectors import gather_vectors, vec3
from renderer.plugins.lights.environment import (
    distant_sample,
    environment_light,
    read_rotation,
    rotated,
)
from renderer.plugins.lights.kind import LightPlugin, SphereAround, sample_light
from renderer.plugins.lights.light_tree import LightBounds, from_everywhere
from renderer.plugins.lights.sky_by_place import (
    NOWHERE,
    Cells,
    Floats,
    SkyByPlace,
    density_by_place,
    in_world,
    sample_by_place,
    sky_by_place,
)
from renderer.plugins.sampling.hierarchical_warp import (
    Warp,
    make_warp,
    warp_density,
)
from renderer.plugins.sampling.numbers_and_warps import INV_PI, TWO_PI
from renderer.plugins.textures.kind import LUMINANCE
from renderer.scene_file.colors.colors import Use
from renderer.scene_file.description import EnvironmentMap
from renderer.scene_file.images.image import negative_pixels
from renderer.scene_file.objects.objects import location_of, read_picture

_PI = np.float32(np.pi)
INV_TWO_PI = np.float32(0.5 / np.pi)
# Jacobian of (u, v) in [0, 1]^2 by solid angle, without the sine: du dv = 2 pi^2 sin dw
_BY_SOLID_ANGLE = np.float32(0.5 / np.pi**2)
_SMALLEST_SINE = np.float32(2.0**-24)
_LUMINANCE = np.array(LUMINANCE, np.float32)
_FEWEST_COLUMNS, _FEWEST_ROWS = 2, 3  # smaller images are padded by the last column, row


@table_columns("texels")
class EnvironmentMaps(NamedTuple):
    """The environment; at most one."""

    # (4, H (W + 2)) texels by row from the top, each row padded by its periodic neighbours
    texels: NDArray[np.float32]
    width: int  # W
    height: int  # H
    scale: float
    to_world: NDArray[np.float32]  # (3, 3) a rotation
    to_local: NDArray[np.float32]  # (3, 3) its inverse; files round their rotations
    warp: Warp  # samples (u - half a texel, v)
    places: SkyByPlace  # visibility of the environment by position
    around: SphereAround

    @property
    def sun_direction(self) -> None:
        """None: the image contains the sun, if any, and the warp samples it."""

    def directions(self, u: Floats, v: Floats) -> Floats:
        """Return the world space directions (3, n) of points of the warp's square."""
        azimuth, angle = 2.0 * np.pi * (u + 0.5 / self.width), np.pi * v
        across = np.sin(angle)
        local = across * np.sin(azimuth), np.cos(angle), -across * np.cos(azimuth)
        return in_world(self.to_world, local)

    def with_places(self, cells: Cells, seen: Floats, sun: Floats) -> EnvironmentMaps:
        """Return a copy with the given visibility by position (`sky_by_place`)."""
        return self._replace(places=sky_by_place(self.warp, cells, seen, 0.0, 1.0))


def read(properties: Any) -> EnvironmentMap:
    """Read the properties of a file."""
    image, name, key = read_picture(properties, ("bitmap",))
    pixels = image.linear
    if negative := negative_pixels(pixels):
        properties.reading.warn(
            location_of(properties, key),
            f"{name}: {negative}; they are kept, but not sampled, as in Mitsuba",
        )
    scale = properties.number("scale", 1.0, at_least=0.0)
    if scale * float(np.abs(pixels).max()) > Use.EMISSION.limits[1]:
        properties.fail("scale", f"{scale:g}", "one that leaves all pixels at most 1e30")
    to_world = read_rotation(properties)
    compensated = properties.boolean("mis_compensation", False)
    return EnvironmentMap(_padded(pixels), scale, to_world, compensated)


def _padded(pixels: NDArray[np.float32]) -> NDArray[np.float32]:
    height, width = pixels.shape[:2]
    more = (0, max(0, _FEWEST_ROWS - height)), (0, max(0, _FEWEST_COLUMNS - width)), (0, 0)
    return np.pad(pixels, more, mode="edge")


def _importance(environment: EnvironmentMap) -> NDArray[np.float32]:
    # in float32 throughout, as in Mitsuba: the patch that is sampled depends on the last
    # bits
    r, g, b = np.moveaxis(environment.pixels, -1, 0) * _LUMINANCE[:, None, None]
    # pi in float32 is 8.7e-8 too large: the sine at the last row would be negative
    sine = np.maximum(np.sin(latitudes(len(environment.pixels))), np.float32(0.0))
    return importance(r + g + b, sine, compensated=environment.mis_compensation)


def latitudes(height: int) -> NDArray[np.float32]:
    """Return the angles [rad] between the pole and the rows of texels, (height,)."""
    step = np.float32(1.0 / (height - 1)) * np.float32(np.pi)
    return np.arange(height, dtype=np.float32) * step


def importance(
    luminance: NDArray[np.float32], sine: NDArray[np.float32], *, compensated: bool
) -> NDArray[np.float32]:
    """Return the unscaled density in (u, v) at the texels, (H, W + 1).

    Parameters
    ----------
    luminance : ndarray of shape (H, W)
    sine : ndarray of shape (H,)
        Sine of the angle from the pole, for each row.
    compensated
        Only luminance above the mean gets light samples; BSDF samples find the rest
        [Karlik2019].
    """
    if compensated:
        mean = np.float32(luminance.mean(dtype=np.float64))
        if mean - luminance.min() > np.float32(0.01) * mean:  # else nothing would remain
            luminance = luminance - mean
    luminance = np.maximum(luminance, np.float32(0.0))  # negative light is not sampled
    return np.append(luminance, luminance[:, :1], axis=1) * sine[:, None]


def table(
    count: int, lights: dict[int, EnvironmentMap], around: SphereAround
) -> EnvironmentMaps:
    """Return the environment as the kernels see it."""
    (sky,) = lights.values()
    texels = np.pad(sky.pixels, [(0, 0), (1, 1), (0, 0)], mode="wrap")
    to_world = sky.to_world[:3, :3]
    return EnvironmentMaps(
        by_columns(np.pad(texels.reshape(-1, 3), [(0, 0), (0, 1)]).T),
        sky.pixels.shape[1],
        sky.pixels.shape[0],
        sky.scale,
        np.ascontiguousarray(to_world, np.float32),
        np.ascontiguousarray(np.linalg.inv(to_world), np.float32),
        _warp_of(sky),
        NOWHERE,
        around,
    )


def _warp_of(sky: EnvironmentMap) -> Warp:
    """Return the sampling warp; uniform if the importance of all texels is 0.

    That is so for black images, and for images that emit only at the poles.
    """
    warp = make_warp(_importance(sky))
    if warp is None:
        even = np.ones_like(sky.pixels)
        warp = make_warp(_importance(replace(sky, pixels=even, mis_compensation=False)))
    assert warp is not None
    return warp


def bounds(sky: EnvironmentMap) -> LightBounds:
    """Return the bounds: the mean radiance over all directions."""
    rows = np.maximum(sky.pixels, 0.0).mean(axis=(1, 2), dtype=np.float64)
    sine = np.sin(np.linspace(0.0, np.pi, len(rows)))
    return from_everywhere(sky.scale * float(rows @ sine / sine.sum()))


@kernel
def half_texel(sky):
    """Return the offset in u between the warp's square and the image: half a texel.

    The warp's patches lie between the centres of texels.
    """
    return np.float32(0.5) / np.float32(sky.width)


@kernel
def image_point(sky, direction):
    """Return (u, v) of directions, and the sine of their angle from the pole."""
    local = rotated(sky.to_local, direction)
    u, v = arctan2(local.x, -local.z) * INV_TWO_PI, arccos(local.y) * INV_PI
    return u, v, sqrt(local.x * local.x + local.z * local.z)


@kernel
def sphere_point(sky, u, v):
    """Return the direction of points of the image, and the sine of its angle."""
    sine, cosine = sincos(v * _PI)
    across, along = sincos(u * TWO_PI)
    return rotated(sky.to_world, vec3(across * sine, cosine, -(along * sine))), sine


@kernel
def texel_place(sky, u, v):
    """Return positions in the image, in texels from the centre of the first stored texel.

    u is periodic: a copy of the last column is stored first. v is clamped.
    """
    x = (u - floor(u)) * np.float32(sky.width) + 0.5
    y = minimum(maximum(v, splat_f32(0.0)), splat_f32(1.0)) * np.float32(sky.height - 1)
    return x, y


@kernel
def texel_radiance(sky, x, y, mask):
    """Return the radiance, interpolated bilinearly between texels."""
    i = minimum(to_i32(x), splat_i32(np.int32(sky.width)))
    j = minimum(to_i32(y), splat_i32(np.int32(sky.height - 2)))
    a, b = x - to_f32(i), y - to_f32(j)
    first = j * np.int32(sky.width + 2) + i
    below = first + np.int32(sky.width + 2)
    upper = gather_vectors(sky.texels, first, mask) * (1.0 - a)
    upper = upper + gather_vectors(sky.texels, first + 1, mask) * a
    lower = gather_vectors(sky.texels, below, mask) * (1.0 - a)
    lower = lower + gather_vectors(sky.texels, below + 1, mask) * a
    return (upper * (1.0 - b) + lower * b) * np.float32(sky.scale)


@kernel
def by_solid_angle(density, sine):
    """Return pdfs [1/sr] for pdfs in (u, v)."""
    return density * (_BY_SOLID_ANGLE / maximum(sine, splat_f32(_SMALLEST_SINE)))


@kernel
def image_density(sky, u, v, mask):
    """Return the pdf in (u, v) at points of the image."""
    return warp_density(sky.warp, *_in_warp(sky, u, v), mask)


@kernel
def _in_warp(sky, u, v):
    """Return points of the warp's square for points of the image."""
    shifted = u - half_texel(sky)
    return shifted - floor(shifted), v


@sample_light.by(EnvironmentMaps)
@kernel
def _sample_envmap(sky, kind, light, mask, position, x, y, z):
    """Sample a direction by the luminance, times its visibility at the position."""
    u, v, density = sample_by_place(sky.places, sky.warp, position, x, y, mask)
    u = u + half_texel(sky)
    wi, sine = sphere_point(sky, u, v)
    across, down = texel_place(sky, u, v)
    radiance = texel_radiance(sky, across, down, mask)
    return distant_sample(sky, position, wi, radiance, by_solid_angle(density, sine))


@environment_light.by(EnvironmentMaps)
@kernel
def _envmap_light(sky, position, direction, mask):
    """Return the radiance and the pdf [1/sr] for directions."""
    u, v, sine = image_point(sky, direction)
    x, y = texel_place(sky, u, v)
    u, v = _in_warp(sky, u, v)
    density = density_by_place(sky.places, sky.warp, position, u, v, mask)
    return texel_radiance(sky, x, y, mask), by_solid_angle(density, sine)


ENVMAP = LightPlugin(
    "envmap", EnvironmentMap, read, table, bounds, at_infinity=True, environment=True
)
