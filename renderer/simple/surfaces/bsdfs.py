"""Reflection and refraction: a direction at random, and what it carries.

`weight` is f cos / pdf. A mirror and glass scatter into single directions, for which f and
pdf are infinite alike; their quotient is not, and their pdf is said to be 0.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from renderer.scene_file.description import Conductor, Dielectric, Diffuse
from renderer.simple.surfaces.surfaces import Hit
from renderer.simple.surfaces.textures import eval_texture
from renderer.simple.vectors import Vector, normalize, orthonormal_basis
from renderer.simple.warps import square_to_cosine_hemisphere


class BsdfSample(NamedTuple):
    """Where a path goes on."""

    wi: Vector  # unit, away from the surface
    weight: Vector  # f cos / pdf
    pdf: float  # [1/sr] of wi; 0: there is no other direction
    eta: float = 1.0  # index of refraction of the side of wi over that of wo


def albedo(bsdf: Diffuse, hit: Hit) -> Vector:
    """Return k_d; f = k_d / pi [Lambert1760]."""
    return eval_texture(bsdf.reflectance, *hit.uv)


def sample_bsdf(hit: Hit, x: float, y: float, choice: float) -> BsdfSample | None:
    """Choose a direction with x, y, choice in [0, 1); None where the surface is black."""
    match hit.bsdf:
        case Diffuse() as bsdf:  # by the cosine: f cos / pdf is k_d
            s, t = orthonormal_basis(hit.shading_normal)
            a, b, cosine = square_to_cosine_hemisphere(x, y)
            wi = a * s + b * t + cosine * hit.normal
            return BsdfSample(wi, albedo(bsdf, hit), cosine / np.pi) if cosine else None
        case Conductor() as bsdf:
            index = eval_texture(bsdf.eta, *hit.uv) + 1j * eval_texture(bsdf.k, *hit.uv)
            tint = eval_texture(bsdf.specular_reflectance, *hit.uv)
            weight = tint * fresnel(float(hit.wo @ hit.normal), index)
            return BsdfSample(reflect(hit.wo, hit.normal), weight, 0.0)
        case Dielectric() as bsdf:
            eta = bsdf.eta if hit.front else 1.0 / bsdf.eta
            if choice < fresnel(float(hit.wo @ hit.normal), eta):
                wi = reflect(hit.wo, hit.normal)
                tint = eval_texture(bsdf.specular_reflectance, *hit.uv)
                return BsdfSample(wi, tint, 0.0)
            # radiance thins out by eta^2 where its rays spread [Veach1997, 5.2]
            weight = eval_texture(bsdf.specular_transmittance, *hit.uv) / eta**2
            return BsdfSample(refract(hit.wo, hit.normal, eta), weight, 0.0, eta)
        case _:
            return None


def reflect(wo: Vector, n: Vector) -> Vector:
    """Return wo mirrored at n [Whitted1980]."""
    return 2.0 * (wo @ n) * n - wo


def refract(wo: Vector, n: Vector, eta: float) -> Vector:
    """Return wo bent by Snell's law, sin_t = sin_i / eta, to the other side of n."""
    across = (wo - (wo @ n) * n) / eta
    return normalize(-across - np.sqrt(1.0 - across @ across) * n)


def fresnel(cosine: float, eta: Any) -> Vector:
    """Return how much light a smooth surface reflects, the mean of both polarisations.

    `eta` is the index of refraction behind the surface over that before it; for a metal it
    is complex. Beyond the critical angle the root is imaginary, and all is reflected.
    """
    eta2 = np.asarray(eta, np.complex128) ** 2
    root = np.sqrt(eta2 - (1.0 - cosine**2))
    perpendicular = (cosine - root) / (cosine + root)
    parallel = (eta2 * cosine - root) / (eta2 * cosine + root)
    return (abs(perpendicular) ** 2 + abs(parallel) ** 2) / 2.0
