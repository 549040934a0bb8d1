"""Rough surfaces: microfacets, and the distribution of their normals m.

A facet reflects or refracts like a smooth surface. A rough surface is the mean over its
facets: D(m) is the density of facets with normal m, G the fraction that is not shadowed or
masked, and Fresnel gives the reflectance [Torrance1967; Walter2007].
"""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import Any

import numpy as np

from renderer.simple.bsdfs import (
    BLACK,
    NOTHING,
    Bsdf,
    BsdfSample,
    Coated,
    color,
    complex_index,
    fresnel,
    number,
    reflect,
    reflectance_of_glass,
    refract,
)
from renderer.simple.camera import (
    Vector,
    normalize,
    square_to_cosine_hemisphere,
    square_to_disk,
)
from renderer.simple.shapes import Hit

SMOOTHEST = 1e-4  # as in Mitsuba, smaller and negative roughnesses are clamped to this
_SLOPES = NormalDist(0.0, math.sqrt(0.5))  # density exp(-slope^2) / sqrt(pi)


class Microfacets:
    """A distribution of normals over the hemisphere around z.

    Parameters
    ----------
    alpha_u, alpha_v : float
        Roughness along x and y: the root mean square slope times sqrt(2).
    beckmann : bool
        Gaussian slopes; otherwise Trowbridge-Reitz (GGX).
    visible : bool
        Sample the normals visible from wo, instead of all normals.
    """

    def __init__(
        self, alpha_u: float, alpha_v: float, *, beckmann: bool, visible: bool = True
    ) -> None:
        self.alpha = np.maximum([alpha_u, alpha_v], SMOOTHEST)
        self.beckmann, self.visible = beckmann, visible

    def density(self, m: Vector) -> float:
        """Return D(m): the area of facets of this normal, per solid angle and area.

        The integral of D(m) m.z is 1: the projected facets cover the surface.
        """
        if m[2] <= 0.0:
            return 0.0
        slope2 = float(np.sum((m[:2] / self.alpha) ** 2)) / m[2] ** 2
        shape = math.exp(-slope2) if self.beckmann else 1.0 / (1.0 + slope2) ** 2
        density = shape / (math.pi * float(np.prod(self.alpha)) * m[2] ** 4)
        return density if density * m[2] > 1e-20 else 0.0

    def unshadowed(self, v: Vector, m: Vector) -> float:
        """Return G1: the fraction of facets with normal m that are visible from v.

        Smith's term, exact for GGX; for Beckmann the rational fit of [Walter2007, eq. 27].
        """
        if (v @ m) * v[2] <= 0.0:
            return 0.0  # seen from behind
        tangent = float(np.linalg.norm(self.alpha * v[:2])) / abs(v[2])  # times alpha
        if not self.beckmann:
            return 2.0 / (1.0 + math.sqrt(1.0 + tangent**2))
        if tangent == 0.0 or (a := 1.0 / tangent) >= 1.6:
            return 1.0
        return (3.535 * a + 2.181 * a**2) / (1.0 + 2.276 * a + 2.577 * a**2)

    def shadowing(self, wo: Vector, wi: Vector, m: Vector) -> float:
        """Return G: the fraction that is visible from both directions."""
        return self.unshadowed(wo, m) * self.unshadowed(wi, m)

    def pdf(self, wo: Vector, m: Vector) -> float:
        """Return the density [1/sr] with which `sample` chooses m; wo.z > 0."""
        if not self.visible:
            return float(self.density(m) * m[2])
        seen = self.unshadowed(wo, m) * abs(wo @ m) / wo[2]
        return float(self.density(m) * seen)

    def sample(self, wo: Vector, x: float, y: float) -> Vector:
        """Sample a normal with two numbers in [0, 1); wo.z > 0."""
        if self.visible:
            return self._sample_visible(wo, x, y)
        # first the azimuth on an ellipse, then the slope by inversion of its distribution
        # function [Walter2007, eqs. 28, 29, 35, 36]
        phi = 2.0 * math.pi * y
        along = self.alpha * (math.cos(phi), math.sin(phi))
        slope = math.sqrt(-math.log(1.0 - x) if self.beckmann else x / (1.0 - x))
        return normalize(np.array([*(slope * along), 1.0]))

    def _sample_visible(self, wo: Vector, x: float, y: float) -> Vector:
        """Sample a visible normal: stretch to alpha 1, sample there, and unstretch.

        [Heitz2014], for any distribution of slopes.
        """
        v = normalize(np.array([*(self.alpha * wo[:2]), wo[2]]))
        sine = math.hypot(v[0], v[1])
        cos_phi, sin_phi = v[:2] / sine if sine > 0.0 else (1.0, 0.0)
        if self.beckmann:
            a, b = _beckmann_slopes(sine, v[2], x, y)  # along v and across it
            m = np.array([sin_phi * b - cos_phi * a, -sin_phi * a - cos_phi * b, 1.0])
        else:
            # a point of the disk across v, with one half compressed to the visible part
            # of the hemisphere, then projected to the hemisphere [Heitz2018]
            t1 = np.array([sin_phi, -cos_phi, 0.0])
            t2 = np.cross(t1, v)
            a, b = square_to_disk(x, y)
            share = (1.0 + v[2]) / 2.0
            b = (1.0 - share) * math.sqrt(max(1.0 - a * a, 0.0)) + share * b
            m = a * t1 + b * t2 + math.sqrt(max(1.0 - a * a - b * b, 0.0)) * v
        return normalize(np.array([*(self.alpha * m[:2]), max(m[2], 0.0)]))

    def weight(self, wo: Vector, wi: Vector, m: Vector) -> float:
        """Return D G |wo.m| / (|wo.z| pdf), the remaining factor of f |cos| / pdf.

        Most terms cancel: for visible normals G1(wi) is left. wo.z > 0.
        """
        if self.visible:
            return self.unshadowed(wi, m)
        return float(self.shadowing(wo, wi, m) * abs(wo @ m) / (wo[2] * m[2]))


def _beckmann_slopes(sine: float, cosine: float, x: float, y: float) -> tuple[float, float]:
    """Sample the slopes visible from a direction of angle theta, along and across; alpha 1.

    Across they are Gaussian. Along, a slope s has visibility cos(theta) - s sin(theta). So
    the fraction of slopes below s is, up to a factor,

        1 + erf(s) + tan(theta) exp(-s^2) / sqrt(pi),    s <= cot(theta) [Jakob2014].

    It is inverted by bisection.
    """
    x, y = (min(max(u, 1e-6), 1.0 - 1e-6) for u in (x, y))
    across = _SLOPES.inv_cdf(y)
    if sine == 0.0:
        return _SLOPES.inv_cdf(x), across
    tangent = sine / cosine

    def below(slope: float) -> float:
        bump = tangent * math.exp(-slope * slope) / math.sqrt(math.pi)
        return 1.0 + math.erf(slope) + bump

    low, high = -6.0, min(cosine / sine, 6.0)
    target = x * below(high)
    while high - low > 1e-12:
        middle = (low + high) / 2.0
        low, high = (middle, high) if below(middle) < target else (low, middle)
    return low, across


def microfacets(bsdf: Any, hit: Hit) -> Microfacets:
    """Return the distribution from the parameters that all rough plugins share."""
    return Microfacets(
        number(bsdf.alpha_u, hit),
        number(bsdf.alpha_v, hit),
        beckmann=bsdf.beckmann != 0.0,
        visible=bsdf.every_normal == 0.0,
    )


class RoughConductor(Bsdf):
    """Rough metal: f = F D G / (4 cos_i cos_o) [Torrance1967]."""

    oriented = True

    def __init__(self, bsdf: Any, hit: Hit) -> None:
        self.facets = microfacets(bsdf, hit)
        self.index = complex_index(bsdf, hit)
        self.tint = color(bsdf.specular_reflectance, hit)

    def eval_pdf(self, wo: Vector, wi: Vector) -> tuple[Vector, float]:
        """Return f cos and the density of facets that reflect wo to wi."""
        if wo[2] <= 0.0 or wi[2] <= 0.0:
            return BLACK, 0.0
        h = normalize(wo + wi)  # the normal of reflection from wo to wi
        density, shown = self.facets.density(h), self.facets.shadowing(wo, wi, h)
        f_cos = self.tint * fresnel(float(wo @ h), self.index) * density * shown
        # dm / dwi: a rotation of the normal rotates the reflection by twice the angle
        return f_cos / (4.0 * wo[2]), self.facets.pdf(wo, h) / (4.0 * float(wi @ h))

    def sample(self, wo: Vector, numbers: tuple[float, float, float]) -> BsdfSample:
        """Sample a facet and reflect wo at it."""
        if wo[2] <= 0.0:
            return NOTHING
        m = self.facets.sample(wo, *numbers[:2])
        wi, pdf = reflect(wo, m), self.facets.pdf(wo, m)
        if wi[2] <= 0.0 or pdf == 0.0:
            return NOTHING
        reflected = self.tint * fresnel(float(wo @ m), self.index)
        weight = reflected * self.facets.weight(wo, wi, m)
        return BsdfSample(wi, weight, pdf / (4.0 * float(wi @ m)))


class RoughDielectric(Bsdf):
    """Rough glass: facets reflect and refract [Walter2007].

    If all normals are sampled instead of visible ones, they come from a rougher
    distribution, which keeps weights small [Walter2007, section 5.3]. As in Mitsuba, the
    weights are still those of the plain distribution, which is off by some per cent.
    """

    oriented = True

    def __init__(self, bsdf: Any, hit: Hit) -> None:
        self.facets = microfacets(bsdf, hit)
        self.eta = bsdf.eta
        self.tints = (
            color(bsdf.specular_reflectance, hit),
            color(bsdf.specular_transmittance, hit),
        )

    def _sampled(self, wo: Vector) -> Microfacets:
        """Return the distribution that normals are sampled from."""
        if self.facets.visible:
            return self.facets
        wider = self.facets.alpha * (1.2 - 0.2 * math.sqrt(abs(wo[2])))
        return Microfacets(*wider, beckmann=self.facets.beckmann, visible=False)

    def eval_pdf(self, wo: Vector, wi: Vector) -> tuple[Vector, float]:
        """Return f |cos| and the density of facets that reflect or refract to wi."""
        if wo[2] == 0.0 or wi[2] == 0.0:
            return BLACK, 0.0
        mirrors = wo[2] * wi[2] > 0.0
        eta = self.eta if wo[2] > 0.0 else 1.0 / self.eta  # of wi's side over wo's
        h = normalize(wo + wi if mirrors else wo + eta * wi)
        h = h if h[2] > 0.0 else -h
        cos_o, cos_i = float(wo @ h), float(wi @ h)
        reflected = reflectance_of_glass(cos_o, self.eta)
        shown = self.facets.density(h) * self.facets.shadowing(wo, wi, h)
        if mirrors:
            share, turned = reflected, 1.0 / (4.0 * abs(cos_i))
            f_cos = self.tints[0] * share * shown / (4.0 * abs(wo[2]))
        else:
            # [Walter2007, eq. 21]; its eta^2 and the 1 / eta^2 of radiance cancel
            share, bend2 = 1.0 - reflected, (cos_o + eta * cos_i) ** 2
            turned = eta**2 * abs(cos_i) / bend2
            f_cos = self.tints[1] * share * shown * abs(cos_o * cos_i / wo[2]) / bend2
        if cos_o * wo[2] <= 0.0 or cos_i * wi[2] <= 0.0:
            return f_cos, 0.0
        return f_cos, share * turned * self._sampled(wo).pdf(_upward(wo), h)

    def sample(self, wo: Vector, numbers: tuple[float, float, float]) -> BsdfSample:
        """Sample a facet, and whether it reflects or refracts."""
        if wo[2] == 0.0:
            return NOTHING
        x, y, choice = numbers
        sampled, above = self._sampled(wo), _upward(wo)
        m = sampled.sample(above, x, y)
        pdf, cos_o = sampled.pdf(above, m), float(wo @ m)
        if pdf == 0.0:
            return NOTHING
        reflected = reflectance_of_glass(cos_o, self.eta)
        if choice <= reflected:
            wi, eta, share, tint = reflect(wo, m), 1.0, reflected, self.tints[0]
            turned = 1.0 / (4.0 * abs(wi @ m))
        else:
            eta = self.eta if cos_o > 0.0 else 1.0 / self.eta
            wi = refract(wo, math.copysign(1.0, cos_o) * m, eta)
            share, tint = 1.0 - reflected, self.tints[1] / eta**2
            turned = eta**2 * abs(wi @ m) / float(cos_o + eta * (wi @ m)) ** 2
        weight = tint * self.facets.weight(above, wi, m)
        return BsdfSample(wi, weight, float(pdf * share * turned), eta)


def _upward(v: Vector) -> Vector:
    """Return v or -v, whichever points up."""
    return v if v[2] > 0.0 else -v


class RoughPlastic(Coated):
    """A rough coat over a diffuse base; the coat's transmittance is from a table.

    The table has an entry for each cosine from 0 to 1 in steps of 1 / 63; the scene reader
    computes it as a mean over facets.
    """

    def __init__(self, bsdf: Any, hit: Hit) -> None:
        super().__init__(bsdf, hit)
        self.facets = microfacets(bsdf, hit)
        self.passes = bsdf.transmittance

    def transmitted(self, cosine: float) -> float:
        """Return the fraction of light at an angle that passes the coat."""
        return float(np.interp(cosine * 63.0, np.arange(64), self.passes))

    def eval_pdf(self, wo: Vector, wi: Vector) -> tuple[Vector, float]:
        """Return f cos and density of coat and base together."""
        if wo[2] <= 0.0 or wi[2] <= 0.0:
            return BLACK, 0.0
        h = normalize(wo + wi)
        out, into = self.transmitted(wo[2]), self.transmitted(wi[2])
        reflected = reflectance_of_glass(float(wo @ h), self.eta)
        shown = self.facets.density(h) * self.facets.shadowing(wo, wi, h)
        coat = self.tint * reflected * shown / (4.0 * wo[2])
        base = self.base * out * into * wi[2] / math.pi
        probability = self.coat_probability(1.0 - out)
        pdf = probability * self.facets.pdf(wo, h) / (4.0 * float(wi @ h))
        return coat + base, pdf + (1.0 - probability) * wi[2] / math.pi

    def sample(self, wo: Vector, numbers: tuple[float, float, float]) -> BsdfSample:
        """Reflect at a facet of the coat, or sample the base."""
        if wo[2] <= 0.0:
            return NOTHING
        x, y, choice = numbers
        if choice < self.coat_probability(1.0 - self.transmitted(wo[2])):
            return self.chosen(wo, reflect(wo, self.facets.sample(wo, x, y)))
        return self.chosen(wo, square_to_cosine_hemisphere(x, y))


class PPlastic(RoughPlastic):
    """Mitsuba's `pplastic`: a coat of smooth transmittance, without interreflection."""

    oriented = True

    def __init__(self, bsdf: Any, hit: Hit) -> None:
        self.facets, self.eta = microfacets(bsdf, hit), number(bsdf.eta, hit)
        self.tint = color(bsdf.specular_reflectance, hit)
        self.base = color(bsdf.diffuse_reflectance, hit)
        self.share = bsdf.specular_share

    def transmitted(self, cosine: float) -> float:
        """Return the share of light from an angle that passes the coat."""
        return 1.0 - reflectance_of_glass(cosine, self.eta)

    def coat_probability(self, reflected: float) -> float:
        """Return how often the coat is sampled."""
        return float(self.share)
