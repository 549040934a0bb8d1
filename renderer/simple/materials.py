"""Nested BSDFs, the table of all BSDFs by name, and BSDFs in world space.

The integrators use `Material`: the BSDF at a surface point, for world directions.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from renderer.simple.bsdfs import (
    BLACK,
    NOTHING,
    UP,
    WHITE,
    Bsdf,
    BsdfSample,
    Conductor,
    Dielectric,
    Diffuse,
    Filter,
    Lobe,
    Null,
    Plastic,
    ThinDielectric,
    color,
    number,
)
from renderer.simple.camera import Vector, mix, normalize, orthonormal_basis
from renderer.simple.hair import Hair
from renderer.simple.measured import Measured, WarpedTables
from renderer.simple.principled import Principled, PrincipledThin
from renderer.simple.rough import (
    PPlastic,
    RoughConductor,
    RoughDielectric,
    RoughPlastic,
)
from renderer.simple.shapes import Hit
from renderer.simple.textures import eval_slope

Numbers = tuple[float, float, float]


class TwoSided(Bsdf):
    """One BSDF per side; the back is evaluated as if it were the front."""

    def __init__(self, bsdf: Any, hit: Hit, front: Bsdf, back: Bsdf) -> None:
        self.front, self.back = front, back
        self.oriented = front.oriented or back.oriented

    def _side(self, wo: Vector) -> tuple[Bsdf, Vector]:
        """Return the BSDF on wo's side, and factors that flip directions to its front."""
        if wo[2] > 0.0:
            return self.front, WHITE
        return self.back, np.array([1.0, 1.0, -1.0])

    def eval_pdf(self, wo: Vector, wi: Vector) -> tuple[Vector, float]:
        """Return f cos and density of the visible side."""
        seen, turn = self._side(wo)
        return seen.eval_pdf(wo * turn, wi * turn)

    def sample(self, wo: Vector, numbers: Numbers) -> BsdfSample:
        """Sample the visible side."""
        seen, turn = self._side(wo)
        sample = seen.sample(wo * turn, numbers)
        return sample._replace(wi=sample.wi * turn)

    def branches(self, wo: Vector) -> list[BsdfSample]:
        """Return the delta lobes of the visible side."""
        seen, turn = self._side(wo)
        return [b._replace(wi=b.wi * turn) for b in seen.branches(wo * turn)]


class Mask(Bsdf):
    """A BSDF with holes: `opacity` is the fraction of light that interacts with it."""

    def __init__(self, bsdf: Any, hit: Hit, nested: Bsdf) -> None:
        self.nested, self.oriented = nested, nested.oriented
        self.opacity = min(max(number(bsdf.opacity, hit), 0.0), 1.0)

    def eval_pdf(self, wo: Vector, wi: Vector) -> tuple[Vector, float]:
        """Return f |cos| and density of the BSDF, times the opacity."""
        f_cos, pdf = self.nested.eval_pdf(wo, wi)
        return f_cos * self.opacity, pdf * self.opacity

    def sample(self, wo: Vector, numbers: Numbers) -> BsdfSample:
        """Sample the BSDF with probability `opacity`, or pass through undeflected.

        The random number of that choice is rescaled to [0, 1) for the BSDF.
        """
        x, y, choice = numbers
        if choice >= self.opacity:
            return BsdfSample(-wo, WHITE, 1.0 - self.opacity, lobe=Lobe.STRAIGHT)
        sample = self.nested.sample(wo, (x, y, choice / self.opacity))
        return sample._replace(pdf=sample.pdf * self.opacity)


class Blend(Bsdf):
    """A mixture of two BSDFs, f = (1 - w) f_1 + w f_2; one of them samples the direction.

    The density is that of the mixture. For a delta lobe its probability is added to the
    other BSDF's density, although the units differ, so delta lobes lose some of their
    light. Mitsuba does the same.
    """

    def __init__(self, bsdf: Any, hit: Hit, first: Bsdf, second: Bsdf) -> None:
        self.first, self.second = first, second
        self.oriented = first.oriented or second.oriented
        self.w = min(max(number(bsdf.weight, hit), 0.0), 1.0)

    def eval_pdf(self, wo: Vector, wi: Vector) -> tuple[Vector, float]:
        """Return f |cos| and density of the mixture."""
        (f, p), (g, q) = self.first.eval_pdf(wo, wi), self.second.eval_pdf(wo, wi)
        return mix(f, g, self.w), mix(p, q, self.w)

    def sample(self, wo: Vector, numbers: Numbers) -> BsdfSample:
        """Sample one of the BSDFs; the weight is that of the mixture."""
        x, y, choice = numbers
        if 0.0 < self.w >= choice:
            share, chosen, other = self.w, self.second, self.first
            rest = choice / self.w
        else:
            share, chosen, other = 1.0 - self.w, self.first, self.second
            rest = (choice - self.w) / share
        sample = chosen.sample(wo, (x, y, rest))
        f, p = sample.weight * sample.pdf, sample.pdf
        g, q = other.eval_pdf(wo, sample.wi)
        pdf = mix(q, p, share)
        weight = mix(g, f, share) / pdf if pdf > 0.0 else BLACK
        return sample._replace(weight=weight, pdf=pdf)


class NormalMap(Bsdf):
    """A BSDF with a shading normal from an image.

    Light that is above one of the two horizons and below the other is dropped. A shadowing
    term fades light out towards that limit, so that there is no edge [Estevez2019].
    """

    oriented = True

    def __init__(self, bsdf: Any, hit: Hit, nested: Bsdf) -> None:
        self.bsdf, self.nested = bsdf, nested
        self.find_normal(bsdf, hit)

    def find_normal(self, bsdf: Any, hit: Hit) -> None:
        """Set the perturbed normal, and the direction from which its x axis is made."""
        self.normal, self.x = 2.0 * color(bsdf.normalmap, hit) - 1.0, np.eye(3)[0]

    def frame(self, wo: Vector) -> Vector | None:
        """Return rows s, t, n around the perturbed normal; None if the normal is 0."""
        n = self.normal
        if wo[2] * (wo @ n) <= 0.0 and self.bsdf.flip_invalid_normals:
            n = n * (-1.0, -1.0, 1.0)  # flip to the side of wo
        if not n @ n > 1e-20:
            return None
        n = normalize(n)
        s = self.x - n * (n @ self.x)
        if not s @ s > 1e-20:
            return None
        s = normalize(s)
        return np.array([s, np.cross(n, s), n])

    def shadowing(self, n: Vector, wi: Vector) -> float:
        """Return the shadowing term for light along wi [Estevez2019, eq. 3]."""
        if not self.bsdf.use_shadowing_function:
            return 1.0
        tan2_n, tan2_i = (max(1.0 / v[2] ** 2 - 1.0, 0.0) for v in (n, wi))
        return 2.0 / (1.0 + math.sqrt(1.0 + min(tan2_n / 8.0, 1.0) * tan2_i))

    def eval_pdf(self, wo: Vector, wi: Vector) -> tuple[Vector, float]:
        """Return f |cos| and density in the perturbed frame."""
        frame = self.frame(wo)
        if frame is None or wi[2] * (frame @ wi)[2] <= 0.0:
            return BLACK, 0.0
        f_cos, pdf = self.nested.eval_pdf(frame @ wo, frame @ wi)
        return f_cos * self.shadowing(frame[2], wi), pdf

    def sample(self, wo: Vector, numbers: Numbers) -> BsdfSample:
        """Sample in the perturbed frame."""
        frame = self.frame(wo)
        if frame is None:
            return NOTHING
        sample = self.nested.sample(frame @ wo, numbers)
        wi = sample.wi @ frame
        if wi[2] * sample.wi[2] <= 0.0:
            return NOTHING
        weight = sample.weight * self.shadowing(frame[2], wi)
        return sample._replace(wi=wi, weight=weight)


class BumpMap(NormalMap):
    """A BSDF with the shading normal of a surface displaced by h(u, v) along its normal.

    The surface p + h n has the derivatives dp/du + n dh/du and dp/dv + n dh/dv, except for
    terms that are small with h. The normal is their cross product [Blinn1978].
    """

    def find_normal(self, bsdf: Any, hit: Hit) -> None:
        """Set the perturbed normal, and the direction from which its x axis is made.

        As in Mitsuba, that is the world's dp/du, although all else is local.
        """
        n, (dp_du, dp_dv) = hit.normal, hit.derivatives()
        by_u, by_v = bsdf.scale * np.array(eval_slope(bsdf.height, *hit.uv))
        # the slope along n is that of h only, whatever the slope of n on a smooth mesh
        du = dp_du + n * (by_u - n @ dp_du)
        dv = dp_dv + n * (by_v - n @ dp_dv)
        displaced = np.cross(du, dv)
        if hit.geometric_normal @ displaced < 0.0:
            displaced = -displaced
        self.normal, self.x = UP, dp_du
        if displaced.any():
            self.normal = normalize(hit.frame(along_u=True) @ displaced)
        across = np.cross(self.normal, dp_du)
        if not across @ across > 1e-12 * (dp_du @ dp_du):
            self.x, _ = orthonormal_basis(self.normal)  # dp/du is along the normal, or 0


# -------------------------------------------------------------------------- BSDFs by name

BSDFS: dict[str, type[Bsdf]] = {
    "diffuse": Diffuse,
    "conductor": Conductor,
    "dielectric": Dielectric,
    "thindielectric": ThinDielectric,
    "null": Null,
    "plastic": Plastic,
    "roughconductor": RoughConductor,
    "roughdielectric": RoughDielectric,
    "roughplastic": RoughPlastic,
    "pplastic": PPlastic,
    "polarizer": Filter,
    "circular": Filter,
    "retarder": Filter,
    "hair": Hair,
    "principled": Principled,
    "principled with spec_trans": Principled,
    "principledthin": PrincipledThin,
    "merl": Measured,
    "measured": WarpedTables,
    "twosided": TwoSided,
    "mask": Mask,
    "blendbsdf": Blend,
    "normalmap": NormalMap,
    "bumpmap": BumpMap,
}
# attributes of a description that are nested BSDFs
NESTED: dict[str, tuple[str, ...]] = {
    "twosided": ("front", "back"),
    "mask": ("nested",),
    "blendbsdf": ("first", "second"),
    "normalmap": ("nested",),
    "bumpmap": ("nested",),
}


def bsdf_at(bsdf: Any, hit: Hit) -> Bsdf:
    """Return a BSDF of the description at a surface point."""
    inside = (getattr(bsdf, name) for name in NESTED.get(bsdf.plugin, ()))
    return BSDFS[bsdf.plugin](bsdf, hit, *(bsdf_at(one, hit) for one in inside))


class Material:
    """The BSDF at a surface point, for world directions."""

    def __init__(self, hit: Hit) -> None:
        self.bsdf = bsdf_at(hit.surface.shape.bsdf, hit)
        self.frame = hit.frame(along_u=self.bsdf.oriented)  # rows: world to local
        self.wo = self.frame @ hit.wo

    def eval_pdf(self, wi: Vector) -> tuple[Vector, float]:
        """Return f |cos|, and the density [1/sr] with which `sample` chooses wi."""
        return self.bsdf.eval_pdf(self.wo, self.frame @ wi)

    def sample(self, numbers: Numbers) -> BsdfSample:
        """Sample the next direction of a path."""
        sample = self.bsdf.sample(self.wo, numbers)
        return sample._replace(wi=sample.wi @ self.frame)

    def branches(self) -> list[BsdfSample]:
        """Return all delta lobes, weighted by their light."""
        found = self.bsdf.branches(self.wo)
        return [branch._replace(wi=branch.wi @ self.frame) for branch in found]
