"""Fresnel equations: the reflectance of a smooth interface."""

from __future__ import annotations

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import fabs, maximum, select, splat_f32, sqrt


@kernel
def fresnel_dielectric(cos_i, eta):
    """Return (reflectance, cosine of the refracted direction, eta of the crossing).

    Parameters are lanes: the cosine between the normal and wi (negative: from inside) and
    the index of refraction, inside over outside. The refracted cosine has the sign opposite
    to cos_i. The eta of the crossing is the index of the far side over that of the near
    side. Beyond the critical angle the reflectance is exactly 1.
    """
    outside = cos_i >= 0.0
    crossing = select(outside, eta, 1.0 / eta)
    near = fabs(cos_i)
    # Snell: sin_t = sin_i / eta
    cos2_t = 1.0 - (1.0 - near * near) / (crossing * crossing)
    total = cos2_t <= 0.0
    far = sqrt(maximum(cos2_t, splat_f32(0.0)))
    perpendicular = (near - crossing * far) / (near + crossing * far)
    parallel = (crossing * near - far) / (crossing * near + far)
    reflectance = 0.5 * (perpendicular * perpendicular + parallel * parallel)
    # equal indices do not reflect, not even at grazing incidence (0 / 0)
    reflectance = select(crossing == 1.0, splat_f32(0.0), reflectance)
    reflectance = select(total & (crossing != 1.0), splat_f32(1.0), reflectance)
    return reflectance, select(outside, -far, far), crossing


@kernel
def fresnel_conductor(cos_i, eta, k):
    """Return the reflectance of a conductor with index eta + i k for unpolarised light.

    The exact equations for a real outside index, in a form without complex numbers:
    a^2 + b^2 = |n^2 - sin^2|, per colour channel, `cos_i` in [0, 1].
    """
    cos2 = cos_i * cos_i
    sin2 = 1.0 - cos2
    difference = eta * eta - k * k - sin2
    a2_plus_b2 = sqrt(difference * difference + 4.0 * (eta * eta) * (k * k))
    a = sqrt(maximum(0.5 * (a2_plus_b2 + difference), splat_f32(0.0)))
    perpendicular = (a2_plus_b2 + cos2 - 2.0 * a * cos_i) / (
        a2_plus_b2 + cos2 + 2.0 * a * cos_i
    )
    factor = cos2 * a2_plus_b2 + sin2 * sin2
    parallel = (
        perpendicular
        * (factor - 2.0 * a * cos_i * sin2)
        / (factor + 2.0 * a * cos_i * sin2)
    )
    return 0.5 * (perpendicular + parallel)
