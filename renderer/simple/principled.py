"""The principled BSDFs: one set of parameters for most materials [Burley2012; Burley2015].

Both are sums of lobes. Each lobe has its own sampling probability, and the density of a
direction is that of all lobes together. So the weight of a sample is f cos / pdf of the
whole BSDF, whichever lobe was sampled. The lobes are weighted as in Mitsuba.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from renderer.simple.bsdfs import (
    BLACK,
    NOTHING,
    WHITE,
    Bsdf,
    BsdfSample,
    color,
    number,
    reflect,
    reflectance_of_glass,
    refract,
)
from renderer.simple.camera import Vector, mix, normalize, square_to_cosine_hemisphere
from renderer.simple.rough import Microfacets
from renderer.simple.shapes import Hit
from renderer.simple.textures import LUMINANCE

COAT_SHADOWING = Microfacets(0.25, 0.25, beckmann=False)  # independent of the coat's gloss
Numbers = tuple[float, float, float]


def schlick(cosine: float) -> float:
    """Return (1 - cosine)^5: the rise of Fresnel's reflectance towards the horizon."""
    return min(max(1.0 - cosine, 0.0), 1.0) ** 5


class PrincipledBase(Bsdf):
    """The parameters and lobes that both principled BSDFs share."""

    oriented = True

    def __init__(self, bsdf: Any, hit: Hit) -> None:
        self.base = color(bsdf.base_color, hit)
        luminance = float(self.base @ LUMINANCE)
        self.tint = self.base / luminance if luminance > 0.0 else WHITE  # luminance 1
        self.roughness, self.anisotropic = (
            number(value, hit) for value in (bsdf.roughness, bsdf.anisotropic)
        )
        self.spec_tint, self.flatness = (
            number(value, hit) for value in (bsdf.spec_tint, bsdf.flatness)
        )
        self.sheen, self.sheen_tint = (
            number(value, hit) for value in (bsdf.sheen, bsdf.sheen_tint)
        )
        self.eta = number(bsdf.eta, hit)
        self.facets = self.facets_of(self.roughness)

    def facets_of(self, roughness: float) -> Microfacets:
        """Return the GGX distribution of a perceived roughness."""
        aspect = math.sqrt(1.0 - 0.9 * self.anisotropic)
        alphas = max(1e-3, roughness**2 / aspect), max(1e-3, roughness**2 * aspect)
        return Microfacets(*alphas, beckmann=False)

    def fresnel_weight(self, cosine: float) -> float:
        """Return Schlick's weight; inside the denser medium, of the refracted angle."""
        behind = self.eta if cosine >= 0.0 else 1.0 / self.eta
        if behind > 1.0:
            return schlick(abs(cosine))
        return schlick(math.sqrt(max(1.0 - (1.0 - cosine**2) / behind**2, 0.0)))

    def tinted(self, cosine: float, behind: float) -> Vector:
        """Return Schlick's reflectance of glass, tinted at normal incidence."""
        normal = ((behind - 1.0) / (behind + 1.0)) ** 2
        tinted: Vector = mix(normal * self.tint, 1.0, self.fresnel_weight(cosine))
        return tinted

    def diffuse(self, cos_o: float, cos_i: float, cos_h: float) -> Vector:
        """Return f of the diffuse lobe with retro-reflection, and of the subsurface lobe.

        `cos_h` is the cosine between wi and the half vector.
        """
        back = 2.0 * self.roughness * cos_h**2
        out, into = schlick(cos_i), schlick(cos_o)
        matt = (1.0 - into / 2.0) * (1.0 - out / 2.0)
        matt += back * (out + into + out * into * (back - 1.0))
        scattered = mix(1.0, back / 2.0, out) * mix(1.0, back / 2.0, into)
        flat = 1.25 * (scattered * (1.0 / (cos_o + cos_i) - 0.5) + 0.5)
        return self.base / math.pi * mix(matt, flat, self.flatness)

    def cloth(self, cos_h: float) -> Vector:
        """Return f of the sheen lobe."""
        glow: Vector = mix(WHITE, self.tint, self.sheen_tint)
        return self.sheen * schlick(abs(cos_h)) * glow


class Principled(PrincipledBase):
    """A blend of metal, glass and a diffuse base, under a clear coat.

    The fraction of metal is `metallic`. Of the rest, `spec_trans` is glass, and the
    remainder is diffuse. Without glass the back of the surface is black.
    """

    def __init__(self, bsdf: Any, hit: Hit) -> None:
        super().__init__(bsdf, hit)
        self.metallic = number(bsdf.metallic, hit)
        spec_trans = number(bsdf.values.get("spec_trans", 0.0), hit)
        self.matt = (1.0 - self.metallic) * (1.0 - spec_trans)  # of the diffuse base
        self.glass = (1.0 - self.metallic) * spec_trans
        self.clearcoat = number(bsdf.clearcoat, hit)
        self.coat_alpha2 = (0.1 - 0.099 * number(bsdf.clearcoat_gloss, hit)) ** 2
        self.rates = (
            bsdf.main_specular_sampling_rate,
            bsdf.clearcoat_sampling_rate,
            bsdf.diffuse_reflectance_sampling_rate,
        )

    def probabilities(self, reflected: float, front: bool) -> tuple[float, ...]:
        """Return the sampling probabilities of diffuse, coat, refraction and reflection.

        `reflected` is the Fresnel reflectance of a facet.
        """
        specular, coat, diffuse = self.rates
        if front:
            refraction = specular * self.glass * (1.0 - reflected)
            coat *= 0.25 * self.clearcoat
            lobes = diffuse * self.matt, coat, refraction, specular - refraction
        else:
            lobes = 0.0, 0.0, 1.0 - reflected, reflected
        total = sum(lobes) or 1.0
        return tuple(lobe / total for lobe in lobes)

    def eval_pdf(self, wo: Vector, wi: Vector) -> tuple[Vector, float]:
        """Return f |cos| and density of all lobes together."""
        front, mirrors = wo[2] > 0.0, wo[2] * wi[2] > 0.0
        if wo[2] == 0.0 or wi[2] == 0.0:
            return BLACK, 0.0
        if self.glass == 0.0 and not (front and mirrors):
            return BLACK, 0.0
        eta = self.eta if front else 1.0 / self.eta
        h = normalize(wo + wi if mirrors else wo + eta * wi)
        h = h if h[2] > 0.0 else -h
        cos_o, cos_i = float(wo @ h), float(wi @ h)
        reflected = reflectance_of_glass(cos_o, self.eta)
        diffuse, coat, refraction, reflection = self.probabilities(reflected, front)
        f_cos, pdf = BLACK, 0.0
        if front and mirrors and self.matt > 0.0:
            sheen = (1.0 - self.metallic) * self.cloth(cos_i)
            f = self.matt * self.diffuse(wo[2], wi[2], cos_i) + sheen
            f_cos = f_cos + f * wi[2]
        if front and mirrors:
            pdf += diffuse * wi[2] / math.pi
        if cos_o * wo[2] <= 0.0 or cos_i * wi[2] <= 0.0:
            return f_cos, pdf  # wo or wi is on the wrong side of the facet

        normals = self.facets.pdf(wo if front else -wo, h)
        shown = self.facets.density(h) * self.facets.shadowing(wo, wi, h) / abs(wo[2])
        if not mirrors:  # as rough glass, [Walter2007, eqs. 17, 21]
            bend2 = (cos_o + eta * cos_i) ** 2
            f = self.glass * (1.0 - reflected) * shown * abs(cos_o * cos_i) / bend2
            turned = eta**2 * abs(cos_i) / bend2
            return f_cos + f * np.sqrt(self.base), pdf + refraction * normals * turned
        if reflected > 0.0:
            f_cos = f_cos + self.mirrored(cos_o, reflected, front) * shown / 4.0
        pdf += reflection * normals / (4.0 * abs(cos_i))
        if front:
            shown = self.coat_density(h) * COAT_SHADOWING.shadowing(wo, wi, h)
            coated = mix(0.04, 1.0, self.fresnel_weight(cos_o)) * shown * wi[2]
            f_cos = f_cos + 0.25 * self.clearcoat * coated
            pdf += coat * self.coat_density(h) * h[2] / (4.0 * abs(cos_i))
        return f_cos, pdf

    def mirrored(self, cosine: float, reflected: float, front: bool) -> Any:
        """Return the reflectance of a facet, blended from metal, glass and tinted glass."""
        if not front:
            return self.glass * reflected
        metal = mix(self.base, 1.0, self.fresnel_weight(cosine))
        behind = self.eta if cosine >= 0.0 else 1.0 / self.eta
        glass = mix(reflected, self.tinted(cosine, behind), self.spec_tint)
        return mix(glass, metal, self.metallic)

    def coat_density(self, m: Vector) -> float:
        """Return the density of the coat's normals, which has a long tail [Burley2012]."""
        rest = self.coat_alpha2 - 1.0
        density = rest / math.pi / math.log(self.coat_alpha2) / (1.0 + rest * m[2] ** 2)
        return float(density) if density * m[2] > 1e-20 else 0.0

    def coat_normal(self, x: float, y: float) -> Vector:
        """Sample a normal of the coat by its density times the cosine."""
        cos2 = (1.0 - self.coat_alpha2 ** (1.0 - y)) / (1.0 - self.coat_alpha2)
        sine, phi = math.sqrt(max(1.0 - cos2, 0.0)), 2.0 * math.pi * x
        return np.array([sine * math.cos(phi), sine * math.sin(phi), math.sqrt(cos2)])

    def sample(self, wo: Vector, numbers: Numbers) -> BsdfSample:
        """Sample a lobe, and a direction from it."""
        x, y, choice = numbers
        front = wo[2] > 0.0
        if wo[2] == 0.0 or not (front or self.glass > 0.0):
            return NOTHING
        # this facet's Fresnel reflectance gives the lobe probabilities, whichever is chosen
        m = self.facets.sample(wo if front else -wo, x, y)
        cos_o = float(wo @ m)
        reflected = reflectance_of_glass(cos_o, self.eta)
        diffuse, coat, refraction, _ = self.probabilities(reflected, front)
        if choice < diffuse:
            return self.chosen(wo, square_to_cosine_hemisphere(x, y))
        if diffuse + coat <= choice < diffuse + coat + refraction:
            eta = self.eta if cos_o >= 0.0 else 1.0 / self.eta
            wi = refract(wo, math.copysign(1.0, cos_o) * m, eta)
            return self.chosen(wo, wi, eta) if wi[2] * wo[2] < 0.0 else NOTHING
        wi = reflect(wo, self.coat_normal(x, y) if choice < diffuse + coat else m)
        return self.chosen(wo, wi) if wi[2] * wo[2] > 0.0 else NOTHING


class PrincipledThin(PrincipledBase):
    """A thin sheet: equal on both sides; transmission is not refracted on average.

    Two refractions spread transmitted light like one surface of smaller roughness.
    """

    def __init__(self, bsdf: Any, hit: Hit) -> None:
        super().__init__(bsdf, hit)
        self.glass = number(bsdf.spec_trans, hit)
        self.through = number(bsdf.diff_trans, hit) / 2.0  # of the diffuse light, per side
        self.passing = self.facets_of(self.roughness * (0.65 * self.eta - 0.35))
        diffuse = 1.0 - self.glass
        lobes = np.array(
            [
                self.glass / 2.0 * bsdf.specular_reflectance_sampling_rate,
                self.glass / 2.0 * bsdf.specular_transmittance_sampling_rate,
                diffuse * (1.0 - self.through) * bsdf.diffuse_reflectance_sampling_rate,
                diffuse * self.through * bsdf.diffuse_transmittance_sampling_rate,
            ]
        )
        self.probabilities = lobes / (lobes.sum() or 1.0)

    def eval_pdf(self, wo: Vector, wi: Vector) -> tuple[Vector, float]:
        """Return f |cos| and density of all lobes together."""
        if wo[2] == 0.0 or wi[2] == 0.0:
            return BLACK, 0.0
        side = math.copysign(1.0, wo[2])
        a, b = side * wo, side * wi
        returns = b[2] > 0.0
        mirrored = np.array([b[0], b[1], abs(b[2])])  # transmission as a reflection
        h = normalize(a + mirrored)
        cos_o, cos_i = float(a @ h), float(b @ h)
        first, second, third, fourth = self.probabilities
        if returns:
            reflected = (1.0 - self.through) * (1.0 - self.glass)
            f = reflected * (self.diffuse(a[2], b[2], cos_i) + self.cloth(cos_i))
        else:
            f = self.through * (1.0 - self.glass) * self.base / math.pi
        f_cos = f * abs(b[2])
        pdf = (third if returns else fourth) * abs(b[2]) / math.pi
        if returns == (cos_i > 0.0):  # wi is on the right side of the facet
            fresnel = reflectance_of_glass(cos_o, self.eta)
            facets = self.facets if returns else self.passing
            shown = facets.density(h) * facets.shadowing(a, b, h) / (4.0 * a[2])
            if returns:
                shade = mix(fresnel, self.tinted(cos_o, self.eta), self.spec_tint)
            else:
                shade = self.base * (1.0 - fresnel)
            f_cos = f_cos + self.glass * shade * shown
            probability = first if returns else second
            pdf += probability * facets.pdf(a, h) / (4.0 * float(mirrored @ h))
        return f_cos, float(pdf)

    def sample(self, wo: Vector, numbers: Numbers) -> BsdfSample:
        """Sample a lobe, and a direction from it."""
        if wo[2] == 0.0:
            return NOTHING
        x, y, choice = numbers
        side = math.copysign(1.0, wo[2])
        a, (first, second, third, _) = side * wo, self.probabilities
        returns = choice < first or first + second <= choice < first + second + third
        if choice < first + second:
            facets = self.facets if returns else self.passing
            m = facets.sample(a, x, y)
            wi = reflect(a, m)
            if not returns:
                wi = wi * (1.0, 1.0, -1.0)
                if wi @ m >= 0.0:
                    return NOTHING  # wi is on the wrong side of the facet
        else:
            wi = square_to_cosine_hemisphere(x, y) * (1.0 if returns else -1.0)
        if returns != (wi[2] > 0.0):
            return NOTHING
        return self.chosen(wo, side * wi)
