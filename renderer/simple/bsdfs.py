"""The BSDF interface, and the smooth BSDFs: diffuse, conductor, dielectric, plastic.

Directions are in the local frame: z is the shading normal, wo points to the previous vertex
of the path, wi to the next. Both are unit vectors away from the surface. Reflection has
wo.z wi.z > 0, transmission wo.z wi.z < 0.

Smooth conductors and dielectrics have delta lobes. There f and the density are infinite,
but their quotient is finite: `sample` and `branches` return the quotient, and `eval_pdf`
returns 0.
"""

from __future__ import annotations

import math
from enum import Enum
from typing import Any, NamedTuple

import numpy as np

from renderer.scene_file.description import Texture
from renderer.simple.camera import Vector, normalize, square_to_cosine_hemisphere
from renderer.simple.shapes import Hit
from renderer.simple.textures import eval_number, eval_texture

BLACK, WHITE = np.zeros(3), np.ones(3)
UP = np.array([0.0, 0.0, 1.0])


class Lobe(Enum):
    """The kind of lobe that a direction was sampled from."""

    SMOOTH = "a density over directions"
    DELTA = "a single mirrored or refracted direction"
    STRAIGHT = "straight on, as through a hole"


class BsdfSample(NamedTuple):
    """A BSDF sample."""

    wi: Vector  # unit, local
    weight: Vector  # f |cos| / pdf; of a delta lobe, f over its probability
    pdf: float  # [1/sr] of wi; of a delta lobe, its probability
    eta: float = 1.0  # index of refraction on the side of wi over that on the side of wo
    lobe: Lobe = Lobe.SMOOTH


NOTHING = BsdfSample(UP, BLACK, 0.0)


class Bsdf:
    """A BSDF with its parameters at one surface point. This base class is black.

    Parameters
    ----------
    bsdf
        The BSDF of the scene description; its parameters are textures or numbers.
    hit
        The surface point at which textures are looked up.
    """

    oriented = False  # whether the local x axis must be along dp/du

    def __init__(self, bsdf: Any, hit: Hit) -> None: ...

    def eval_pdf(self, wo: Vector, wi: Vector) -> tuple[Vector, float]:
        """Return f |cos| as RGB, and the density [1/sr] with which `sample` chooses wi."""
        return BLACK, 0.0

    def sample(self, wo: Vector, numbers: tuple[float, float, float]) -> BsdfSample:
        """Sample wi from three numbers in [0, 1): two for a direction, one for a lobe."""
        return NOTHING

    def branches(self, wo: Vector) -> list[BsdfSample]:
        """Return all delta lobes; `weight` is the fraction of light in each.

        `pdf` is the probability with which `sample` chooses the lobe.
        """
        return []

    def chosen(self, wo: Vector, wi: Vector, eta: float = 1.0) -> BsdfSample:
        """Return the sample of a smooth lobe for a direction; `NOTHING` if its pdf is 0."""
        f_cos, pdf = self.eval_pdf(wo, wi)
        return BsdfSample(wi, f_cos / pdf, pdf, eta) if pdf > 0.0 else NOTHING


# -------------------------------------------------------------------------------- formulas


def reflect(wo: Vector, n: Vector) -> Vector:
    """Return wo mirrored at n [Whitted1980]."""
    return 2.0 * (wo @ n) * n - wo


def refract(wo: Vector, n: Vector, eta: float) -> Vector:
    """Return wo refracted by Snell's law, sin_t = sin_i / eta, to the other side of n.

    The angle must be below the critical angle.
    """
    across = (wo - (wo @ n) * n) / eta
    return normalize(-across - np.sqrt(max(1.0 - float(across @ across), 0.0)) * n)


def fresnel(cosine: float, eta: Any) -> Any:
    """Return the Fresnel reflectance, averaged over both polarisations.

    `eta` is the index of refraction behind the surface over that in front of it. For a
    metal it is complex, and an array for several colours. Beyond the critical angle the
    root is imaginary and the reflectance is 1.
    """
    eta2 = np.asarray(eta, np.complex128) ** 2
    if np.all(eta2 == 1.0):
        return np.zeros(eta2.shape)  # equal indices: no surface
    root = np.sqrt(eta2 - (1.0 - cosine**2))
    perpendicular = (cosine - root) / (cosine + root)
    parallel = (eta2 * cosine - root) / (eta2 * cosine + root)
    return (abs(perpendicular) ** 2 + abs(parallel) ** 2) / 2.0


def reflectance_of_glass(cosine: float, eta: float) -> float:
    """Return the Fresnel reflectance for cos(wo, n), which is negative inside the glass.

    `eta` is the index of refraction inside over that outside.
    """
    behind = eta if cosine >= 0.0 else 1.0 / eta
    if 1.0 - cosine**2 >= behind**2 and behind != 1.0:
        return 1.0  # exactly 1 beyond the critical angle
    return float(fresnel(abs(cosine), behind))


def complex_index(bsdf: Any, hit: Hit) -> Vector:
    """Return the index of refraction of a metal for red, green and blue."""
    index: Vector = color(bsdf.eta, hit) + 1j * color(bsdf.k, hit)
    return index


def color(texture: Texture, hit: Hit) -> Vector:
    """Evaluate a parameter that is a colour."""
    return eval_texture(texture, *hit.uv)


def number(texture: Texture | float, hit: Hit) -> float:
    """Evaluate a parameter that is a number."""
    return eval_number(texture, *hit.uv)


# ----------------------------------------------------------------------------------- BSDFs


class Diffuse(Bsdf):
    """A Lambertian surface: f = albedo / pi [Lambert1760]."""

    def __init__(self, bsdf: Any, hit: Hit) -> None:
        self.albedo = color(bsdf.reflectance, hit)

    def eval_pdf(self, wo: Vector, wi: Vector) -> tuple[Vector, float]:
        """Return f cos and the cosine-weighted density."""
        if wo[2] <= 0.0 or wi[2] <= 0.0:
            return BLACK, 0.0
        return self.albedo / math.pi * wi[2], wi[2] / math.pi

    def sample(self, wo: Vector, numbers: tuple[float, float, float]) -> BsdfSample:
        """Sample the cosine-weighted hemisphere: f cos / pdf is the albedo."""
        return self.chosen(wo, square_to_cosine_hemisphere(*numbers[:2]))


class Conductor(Bsdf):
    """A smooth conductor."""

    def __init__(self, bsdf: Any, hit: Hit) -> None:
        self.index = complex_index(bsdf, hit)
        self.tint = color(bsdf.specular_reflectance, hit)

    def branches(self, wo: Vector) -> list[BsdfSample]:
        """Return the mirror direction."""
        if wo[2] <= 0.0:
            return []
        weight = self.tint * fresnel(float(wo[2]), self.index)
        return [BsdfSample(reflect(wo, UP), weight, 1.0, lobe=Lobe.DELTA)]

    def sample(self, wo: Vector, numbers: tuple[float, float, float]) -> BsdfSample:
        """Return the mirror direction."""
        return next(iter(self.branches(wo)), NOTHING)


class Dielectric(Bsdf):
    """Glass: a mirrored and a refracted direction, with Fresnel probabilities."""

    def __init__(self, bsdf: Any, hit: Hit) -> None:
        self.eta = bsdf.eta
        self.tints = (
            color(bsdf.specular_reflectance, hit),
            color(bsdf.specular_transmittance, hit),
        )

    def branches(self, wo: Vector) -> list[BsdfSample]:
        """Return both directions, with the fraction of light in each."""
        mirrored = reflectance_of_glass(wo[2], self.eta)
        n, eta = (UP, self.eta) if wo[2] >= 0.0 else (-UP, 1.0 / self.eta)
        found = [
            BsdfSample(reflect(wo, n), self.tints[0] * mirrored, mirrored, lobe=Lobe.DELTA)
        ]
        if mirrored < 1.0:
            # radiance is scaled by 1 / eta^2 where rays spread [Veach1997, 5.2]
            weight = self.tints[1] * (1.0 - mirrored) / eta**2
            wi = refract(wo, n, eta)
            found.append(BsdfSample(wi, weight, 1.0 - mirrored, eta, Lobe.DELTA))
        return found

    def sample(self, wo: Vector, numbers: tuple[float, float, float]) -> BsdfSample:
        """Choose one of the two, in proportion to their light."""
        mirrored, *refracted = self.branches(wo)
        chosen = mirrored if numbers[2] <= mirrored.pdf else refracted[0]
        return chosen._replace(weight=chosen.weight / chosen.pdf)


class ThinDielectric(Dielectric):
    """A pane of glass, both surfaces at once: light is mirrored or passes undeflected.

    With the reflectance R and T = 1 - R of one surface, the interreflections between the
    two sum to R + T R T + T R^3 T + ... = 2 R / (1 + R) [Stokes1862].
    """

    def branches(self, wo: Vector) -> list[BsdfSample]:
        """Return both directions, with the fraction of light in each."""
        once = reflectance_of_glass(abs(wo[2]), self.eta)
        mirrored, through = 2.0 * once / (1.0 + once), (1.0 - once) / (1.0 + once)
        back = np.array([-wo[0], -wo[1], wo[2]])
        found = [BsdfSample(back, self.tints[0] * mirrored, mirrored, lobe=Lobe.DELTA)]
        if through > 0.0:
            straight = self.tints[1] * through
            found.append(BsdfSample(-wo, straight, through, lobe=Lobe.STRAIGHT))
        return found


class Filter(Bsdf):
    """A polarizer or a wave plate without polarization: light goes straight on, tinted."""

    def __init__(self, bsdf: Any, hit: Hit) -> None:
        self.passes = bsdf.share * color(bsdf.transmittance, hit)

    def branches(self, wo: Vector) -> list[BsdfSample]:
        """Return the undeflected direction."""
        return [BsdfSample(-wo, self.passes, 1.0, lobe=Lobe.STRAIGHT)]

    def sample(self, wo: Vector, numbers: tuple[float, float, float]) -> BsdfSample:
        """Return the undeflected direction."""
        return self.branches(wo)[0]


class Null(Filter):
    """A surface without effect on light."""

    def __init__(self, bsdf: Any, hit: Hit) -> None:
        self.passes = WHITE


class Coated(Bsdf):
    """The common part of smooth and rough plastic: a diffuse base under a clear coat.

    Light enters through the coat and is scattered by the base. The coat reflects the
    fraction `thrown_back` of it to the base, and so on: a geometric series
    [Saunderson1942]. The fraction is a mean over all angles; the scene reader computes it.
    With `nonlinear` the base's colour is applied at each scattering.
    """

    def __init__(self, bsdf: Any, hit: Hit) -> None:
        self.eta, self.specular_share = bsdf.eta, bsdf.specular_share
        self.tint = color(bsdf.specular_reflectance, hit)
        base = color(bsdf.diffuse_reflectance, hit)
        again = bsdf.thrown_back * (base if bsdf.nonlinear else 1.0)
        self.base = base / (1.0 - again) / self.eta**2

    def coat_probability(self, mirrored: float) -> float:
        """Return the probability of sampling the coat, given its reflectance."""
        coat = mirrored * self.specular_share
        base = (1.0 - mirrored) * (1.0 - self.specular_share)
        return float(coat / (coat + base)) if coat + base > 0.0 else 0.0


class Plastic(Coated):
    """A smooth coat over a diffuse base."""

    def eval_pdf(self, wo: Vector, wi: Vector) -> tuple[Vector, float]:
        """Return f cos and density of the base."""
        if wo[2] <= 0.0 or wi[2] <= 0.0:
            return BLACK, 0.0
        out, into = (reflectance_of_glass(w[2], self.eta) for w in (wo, wi))
        f_cos = self.base * (1.0 - out) * (1.0 - into) / math.pi * wi[2]
        return f_cos, (1.0 - self.coat_probability(out)) * wi[2] / math.pi

    def branches(self, wo: Vector) -> list[BsdfSample]:
        """Return the coat's mirror direction."""
        if wo[2] <= 0.0:
            return []
        mirrored = reflectance_of_glass(wo[2], self.eta)
        probability = self.coat_probability(mirrored)
        wi = reflect(wo, UP)
        return [BsdfSample(wi, self.tint * mirrored, probability, lobe=Lobe.DELTA)]

    def sample(self, wo: Vector, numbers: tuple[float, float, float]) -> BsdfSample:
        """Choose the coat or the base."""
        for mirrored in self.branches(wo):
            if numbers[2] < mirrored.pdf:
                return mirrored._replace(weight=mirrored.weight / mirrored.pdf)
        return self.chosen(wo, square_to_cosine_hemisphere(*numbers[:2]))
