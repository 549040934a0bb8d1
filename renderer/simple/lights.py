"""Lights: sample a direction towards a light, and its density.

Point, spot and directional lights are delta lights: a BSDF sample cannot hit them. Their
density is 0 by convention.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from renderer.scene_file.description import (
    ConstantLight,
    DirectionalLight,
    Emitter,
    PointLight,
    Sphere,
    SpotLight,
    SunSky,
)
from renderer.simple.camera import Vector, normalize, orthonormal_basis, square_to_sphere
from renderer.simple.shapes import Hit, Surface
from renderer.simple.sky import Sky

Light = Emitter | Surface | Sky
EMITTERS = (PointLight, SpotLight, DirectionalLight, ConstantLight, SunSky)
SPHERE_PDF = 1.0 / (4.0 * math.pi)


class LightSample(NamedTuple):
    """A light sample."""

    wi: Vector  # unit, towards the light
    distance: float
    radiance: Vector  # unoccluded incident radiance / pdf
    pdf: float  # [1/sr] of wi; 0 for a delta light


def sample_light(light: Light, p: Vector, x: float, y: float, z: float) -> LightSample:
    """Sample a direction from the point p to a light with x, y, z in [0, 1)."""
    match light:
        case PointLight():  # I / r^2 [Appel1968]
            return _towards(np.array(light.position) - p, np.array(light.intensity))
        case SpotLight():  # linear falloff in the angle
            to_light = light.to_world[:3, 3] - p
            cosine = float(-normalize(to_light) @ normalize(light.to_world[:3, 2]))
            angle = math.degrees(math.acos(min(cosine, 1.0)))
            fading = np.interp(angle, [light.beam_width, light.cutoff_angle], [1.0, 0.0])
            return _towards(to_light, np.array(light.intensity) * fading)
        case DirectionalLight():
            wi = -normalize(np.array(light.direction))
            return LightSample(wi, math.inf, np.array(light.irradiance), 0.0)
        case ConstantLight():  # half of the directions are below the surface
            wi = np.array(square_to_sphere(x, y))
            radiance = np.array(light.radiance) / SPHERE_PDF
            return LightSample(wi, math.inf, radiance, SPHERE_PDF)
        case Sky():
            wi, in_sun = light.sample(x, y)
            pdf = light.pdf(wi, in_sun)
            radiance = light.radiance(wi, in_sun) / pdf if pdf > 0.0 else np.zeros(3)
            return LightSample(wi, math.inf, radiance, pdf)
        case Surface():
            return _sample_surface(light, p, x, y, z)
    raise TypeError(f"no formula for {light}")


def _towards(to_light: Vector, intensity: Vector) -> LightSample:
    r2 = float(to_light @ to_light)
    return LightSample(normalize(to_light), math.sqrt(r2), intensity / r2, 0.0)


def _sample_surface(light: Surface, p: Vector, x: float, y: float, z: float) -> LightSample:
    """Sample an area light uniformly by area; a sphere by its cone of directions."""
    hit: Hit | None
    if cone := _cone(light, p):
        # a point on the lamp itself: reject the hit at t = 0
        hit = light.hit(p, _in_cone(*cone, x, y), 1e-12, math.inf)
    else:
        hit = light.at(np.array(light.unit.point(x, y)), choose_face(light, z), p)
    if hit is None or hit.light is None:  # rounding at the silhouette, or the back
        return LightSample(np.zeros(3), 0.0, np.zeros(3), 0.0)
    pdf = pdf_light(light, p, -hit.wo, hit)
    return LightSample(-hit.wo, hit.t, np.array(light.radiance) / pdf, pdf)


def pdf_light(
    light: ConstantLight | Sky | Surface, p: Vector, d: Vector, hit: Hit | None
) -> float:
    """Return the density [1/sr] with which `sample_light` chooses the direction d to a hit.

    Area density becomes solid-angle density: r^2 / (A cos).
    """
    if isinstance(light, Sky):
        return light.pdf(d)
    if isinstance(light, ConstantLight) or hit is None:
        return SPHERE_PDF
    if cone := _cone(light, p):
        return 1.0 / (2.0 * math.pi * cone[1])
    squared = float(np.sum((hit.x - p) ** 2))  # not t: p may be before the ray's origin
    return squared / (light.area * abs(float(hit.wo @ hit.geometric_normal)))


def power_heuristic(pdf: float, other_pdf: float) -> float:
    """Return the power heuristic's weight of a sample drawn with `pdf`.

    `other_pdf` is the density of the other technique for the same direction; the weights of
    both add up to 1 [Veach1997]. Multiply a density by the technique's number of samples.
    """
    return 1.0 / (1.0 + (other_pdf / pdf) ** 2)


def choose_face(mesh: Surface, z: float) -> int:
    """Return one face of an area light, in proportion to face areas."""
    cumulated = np.cumsum(mesh.face_areas)
    return int(np.searchsorted(cumulated, z * cumulated[-1], side="right"))


def _cone(light: Surface, p: Vector) -> tuple[Vector, float] | None:
    """Return the cone that a sphere subtends at p: axis, 1 - cos of the half angle.

    None for other shapes, and inside the sphere. On the sphere itself, the side of the
    emission decides whether p is inside, not rounding.
    """
    if not isinstance(light.shape, Sphere):
        return None
    to_center = light.a[0] - p
    distance = float(np.linalg.norm(to_center))
    radius = float(np.linalg.norm(light.A[0, :, 0]))
    outwards = -1.0 if light.shape.flip_normals else 1.0
    if distance <= radius * (1.0 - outwards * 1e-9):
        return None
    sine2 = min(radius**2 / distance**2, 1.0)
    return to_center / distance, sine2 / (1.0 + math.sqrt(1.0 - sine2))


def _in_cone(axis: Vector, one_minus_cos: float, x: float, y: float) -> Vector:
    """Sample the cone uniformly: cos theta is linear in x [Akalin2015]."""
    height = x * one_minus_cos  # 1 - cos theta
    sine, phi = math.sqrt(height * (2.0 - height)), 2.0 * math.pi * y
    s, t = orthonormal_basis(-axis)
    around = s * math.cos(phi) + t * math.sin(phi)
    return normalize((1.0 - height) * axis + sine * around)
