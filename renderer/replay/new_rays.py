"""Stage 6 in a replay: the directions and origins of new rays as Mitsuba rounds them.

Mitsuba scatters in the frame (s, t, n) of the surface and turns the result into the world;
our kernels work in the world. Both are right, and differ by a rounding, which grows by the
distance over the radius at each curved surface. Found by trying all orders and fusings on
thousands of samples, and bit for bit Mitsuba's [run].
"""

from __future__ import annotations

import numpy as np

from renderer.jit import kernel
from renderer.kernel_scene import CONDUCTOR, DIFFUSE
from renderer.replay.fused import fused_multiply_add
from renderer.replay.hit_points import ROUNDING
from renderer.replay.numbers import BSDF
from renderer.replay.rounded_once import fused_cross, fused_sum, plain_dot, unit
from renderer.stages.tile import slot_pixel
from renderer.vectors import column, vec3

_ONE = np.float32(1.0)
_TWO = np.float32(2.0)
_HALF = np.float32(0.5)
_ZERO = np.float32(0.0)
_HALF_PI = np.float32(np.pi / 2.0)
_QUARTER_PI = np.float32(np.pi / 4.0)
_FOUR_OVER_PI = np.float32(4.0 / np.pi)
# pi / 4 in three parts, and the polynomials of sine and cosine on it [Moshier1989]
_PARTS = (
    np.float32(0.78515625),
    np.float32(2.4187564849853515625e-4),
    np.float32(3.77489497744594108e-8),
)
_SINE = (
    np.float32(-1.6666654611e-1),
    np.float32(8.3321608736e-3),
    np.float32(-1.9515295891e-4),
)
_COSINE = (
    np.float32(4.166664568298827e-2),
    np.float32(-1.388731625493765e-3),
    np.float32(2.443315711809948e-5),
)


@kernel
def _polynomial(z, c):
    inner = fused_multiply_add(z, c[1], c[0])
    return fused_multiply_add(z * z, c[2], inner)


@kernel
def rounded_sincos(x):
    """Return (sin x, cos x) of an angle below 2 pi, rounded as Dr.Jit does."""
    size = abs(x)
    octant = np.int32(size * _FOUR_OVER_PI)
    octant = (octant + 1) & ~1
    y = np.float32(octant)
    r = fused_multiply_add(-y, _PARTS[0], size)
    r = fused_multiply_add(-y, _PARTS[1], r)
    r = fused_multiply_add(-y, _PARTS[2], r)
    z = r * r
    sine = fused_multiply_add(_polynomial(z, _SINE) * z, r, r)
    cosine = fused_multiply_add(
        _polynomial(z, _COSINE) * z, z, fused_multiply_add(z, -_HALF, _ONE)
    )
    if octant & 2:
        sine, cosine = cosine, sine
    if ((octant & 4) != 0) != (x < _ZERO):
        sine = -sine
    if ((octant + 2) & 4) != 0:
        cosine = -cosine
    return sine, cosine


@kernel
def rounded_cosine_hemisphere(x, y):
    """Return `sampling.square_to_cosine_hemisphere` of one point, rounded as Mitsuba does."""
    a = fused_multiply_add(_TWO, x, -_ONE)
    b = fused_multiply_add(_TWO, y, -_ONE)
    steep = abs(a) < abs(b)
    radius, other = (b, a) if steep else (a, b)
    if radius == _ZERO:
        return vec3(_ZERO, _ZERO, _ONE)
    angle = _QUARTER_PI * other / radius
    sine, cosine = rounded_sincos(_HALF_PI - angle if steep else angle)
    p, q = radius * cosine, radius * sine
    z2 = max(_ONE - (p * p + q * q), _ZERO)
    return vec3(p, q, np.float32(np.sqrt(z2)))


@kernel
def _frame(points, i, normal):
    """Return s and t of the shading frame at a point."""
    along_u = column(points.tangent, i)
    s = unit(fused_sum(normal, -plain_dot(normal, along_u), along_u))
    return s, fused_cross(normal, s)


@kernel
def _refracted(wi, eta):
    """Return the refracted direction in the frame; eta is inside over outside."""
    inverse = _ONE / eta
    ratio = inverse if wi.z >= _ZERO else eta
    sine2 = fused_multiply_add(-wi.z, wi.z, _ONE)
    cosine = np.float32(
        np.sqrt(max(fused_multiply_add(-sine2, ratio * ratio, _ONE), _ZERO))
    )
    return vec3(-ratio * wi.x, -ratio * wi.y, -cosine if wi.z >= _ZERO else cosine)


@kernel
def _index_of(dielectric, bsdf):
    if dielectric is None:
        return _ONE
    return dielectric.eta[bsdf]


@kernel
def _scattered(scene, tile, points, i, direction):
    """Return `direction`, in which a path leaves point i, as Mitsuba computes it."""
    normal, view = column(points.shading_normal, i), column(points.wo, i)
    s, t = _frame(points, i, normal)
    wi = vec3(plain_dot(view, s), plain_dot(view, t), plain_dot(view, normal))
    shape = points.shape[i]
    front = scene.shapes.front[shape]
    bsdf = front if wi.z > _ZERO else scene.shapes.back[shape]
    kind = scene.bsdfs.kind[bsdf]
    if kind == DIFFUSE:
        x, y = slot_pixel(points.slot[i])
        pixel = (y + tile.y) * scene.camera.film_width + x + tile.x
        numbers = scene.sampler.numbers
        wo = rounded_cosine_hemisphere(numbers[BSDF, pixel], numbers[BSDF + 1, pixel])
        wo = vec3(wo.x, wo.y, wo.z if wi.z > _ZERO else -wo.z)
    elif kind == CONDUCTOR or plain_dot(direction, normal) * wi.z > _ZERO:
        wo = vec3(-wi.x, -wi.y, wi.z)
    else:
        wo = _refracted(wi, _index_of(scene.bsdfs.dielectric, bsdf))
    return fused_sum(normal, wo.z, fused_sum(t, wo.y, s * wo.x))


@kernel
def _far_apart(a, b):
    """Return whether two unit vectors differ by more than rounding explains."""
    return max(abs(a.x - b.x), max(abs(a.y - b.y), abs(a.z - b.z))) > ROUNDING


@kernel
def _off_surface(points, i, direction, fixed):
    """Return the origin of a ray in a direction, off the surface by Mitsuba's rule."""
    p, normal = column(points.position, i), column(points.normal, i)
    size = (_ONE + max(abs(p.x), max(abs(p.y), abs(p.z)))) * fixed
    if plain_dot(normal, direction) < _ZERO:
        size = -size
    return fused_sum(normal, size, p)


@kernel
def rays_as_mitsuba_rounds(replayed, scene, tile, rays, end, points):
    """Round the first `end` rays, which have just left `points`, if this is a replay.

    A direction that differs by more than rounding explains stays, so that a replay shows
    it; so does an origin, when another ray offset was asked for.
    """
    if replayed is None:
        return
    settings = scene.settings
    fixed = np.float32(settings.fixed_offset)
    for k in range(end):
        i = rays.point[k]
        old = column(rays.direction, k)
        new = _scattered(scene, tile, points, i, old)
        if _far_apart(new, old):
            continue
        rays.direction[0, k], rays.direction[1, k] = new.x, new.y
        rays.direction[2, k] = new.z
        if settings.rounding_offset == 0.0:
            origin = _off_surface(points, i, new, fixed)
            rays.origin[0, k], rays.origin[1, k] = origin.x, origin.y
            rays.origin[2, k] = origin.z
