"""Make the measured material in this folder: `python tests/plugins/make_measured.py`.

It is a rough metal (GGX) in the format of the RGL database, computed from its formulas, as
real measurements may not be passed on.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.plugins.bsdfs.tensor_file import tensor_file
from renderer.simple.measured import BilinearDensity

Array = NDArray[np.float64]
COPPER = np.array([0.95, 0.64, 0.54])
SIZES = (9, 14)  # azimuths and elevations of normals
PLACES = 5  # of colours along each axis of the warped square


def directions(theta: Any, phi: Any) -> Array:
    """Return unit vectors (..., 3)."""
    theta, phi = np.broadcast_arrays(theta, phi)
    sine = np.sin(theta)
    return np.stack((sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)), axis=-1)


def normals(columns: Any, rows: Any, azimuth: float = 0.0) -> Array:
    """Return the normals at places of the square: theta = u^2 pi / 2, phi by rows."""
    return directions(columns**2 * np.pi / 2, (2.0 * rows - 1.0) * np.pi + azimuth)


def square(rows: int, columns: int) -> tuple[Array, Array]:
    """Return the columns (1, n) and rows (m, 1) of an image on the unit square."""
    return np.linspace(0, 1, columns)[None], np.linspace(0, 1, rows)[:, None]


def measured_fields(
    alphas: tuple[float, float], phi_i: Any, theta_i: Any, *, jacobian: bool = True
) -> dict[str, NDArray[Any]]:
    """Return the fields of a file: a metal of roughness `alphas` along x and along y."""
    phi_i, theta_i = (np.asarray(a, np.float32) for a in (phi_i, theta_i))
    isotropic = len(phi_i) <= 2
    stretch = np.array([*alphas, 1.0])

    def distribution(m: Array) -> Array:
        along = np.sum((m / stretch) ** 2, axis=-1)
        return np.asarray(1.0 / (np.pi * alphas[0] * alphas[1] * along**2))

    def visible_area(w: Array) -> Array:
        """Return cos / G1 of Smith: the projected area of normals seen along w."""
        length = np.linalg.norm(w * stretch, axis=-1)
        return np.asarray((w[..., 2] + length) / 2)

    at = square(*SIZES)
    weight = 2.0 * np.pi**2 * at[0] * np.sin(at[0] ** 2 * np.pi / 2)
    places = np.linspace(0.0, 1.0, PLACES)
    vndf, luminance, rgb = [], [], []
    for phi in phi_i:
        for theta in theta_i:
            wo = directions(float(theta), float(phi))
            m = normals(*at, float(phi) if isotropic else 0.0)
            seen = distribution(m) * np.maximum(m @ wo, 0.0) * weight + 1e-3
            vndf.append(seen)
            warp = BilinearDensity(seen)
            colors = np.zeros((3, PLACES, PLACES))
            for j, y in enumerate(places):
                for i, x in enumerate(places):
                    u = [np.float64(a) for a in warp.place_of(x, y)]
                    h = normals(*u, float(phi) if isotropic else 0.0)
                    cosine = max(float(h @ wo), 0.0)
                    wi = 2.0 * cosine * h - wo
                    tint = COPPER + (1.0 - COPPER) * (1.0 - cosine) ** 5
                    shadowed = max(wi[2], 0.0) / max(float(visible_area(wi)), 1e-3)
                    colors[:, j, i] = tint * min(shadowed, 1.0) + 0.01
                    if not jacobian:
                        area = float(visible_area(wo))
                        colors[:, j, i] *= distribution(h) / (4.0 * max(area, 1e-3))
            rgb.append(colors)
            luminance.append(np.tensordot([0.2, 0.7, 0.1], colors, 1))
    shape = (len(phi_i), len(theta_i))
    coarse = square(3 if isotropic else 9, 6)
    images = {
        "ndf": distribution(normals(*at)),
        "sigma": visible_area(normals(*coarse)),
        "vndf": np.reshape(vndf, (*shape, *SIZES)),
        "luminance": np.reshape(luminance, (*shape, PLACES, PLACES)),
        "rgb": np.reshape(rgb, (*shape, 3, PLACES, PLACES)),
    }
    return {
        "description": np.frombuffer(b"a metal by its formula", np.uint8),
        "phi_i": phi_i,
        "theta_i": theta_i,
        **{name: image.astype(np.float32) for name, image in images.items()},
        "jacobian": np.array([jacobian], np.uint8),
    }


def main(folder: Path = Path(__file__).parent) -> None:
    """Write the file: an isotropic metal, seen under five angles."""
    theta_i = np.linspace(0.0, math.sqrt(math.pi / 2), 5) ** 2
    fields = measured_fields((0.35, 0.35), [0.0], theta_i)
    (folder / "copper_rgb.bsdf").write_bytes(tensor_file(fields))


if __name__ == "__main__":
    main()
