"""Make the measured material in this folder: `python tests/plugins/make_measured.py`.

It is a rough metal (GGX) in the format of the RGL database, computed from its formulas, as
real measurements may not be passed on.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.plugins.bsdfs.tensor_file import tensor_file
from renderer.simple.measured import BilinearDensity

Array = NDArray[np.float64]
COPPER = np.array([0.95, 0.64, 0.54])
HERE = Path(__file__).parent


def directions(theta: Any, phi: Any) -> Array:
    """Return unit vectors (..., 3)."""
    theta, phi = np.broadcast_arrays(theta, phi)
    sine = np.sin(theta)
    return np.stack((sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)), axis=-1)


def normals(column: Any, row: Any, azimuth: float = 0.0) -> Array:
    """Return the normals at places of the unit square."""
    return directions(column**2 * np.pi / 2, (2.0 * row - 1.0) * np.pi + azimuth)


def square(rows: int, columns: int) -> tuple[Array, Array]:
    """Return the columns (1, n) and rows (m, 1) of an image on the unit square."""
    return np.linspace(0.0, 1.0, columns)[None], np.linspace(0.0, 1.0, rows)[:, None]


def elevations(count: int) -> Array:
    """Return angles from 0 to pi / 2 [rad], closer together near the normal."""
    return np.asarray(np.linspace(0.0, 1.0, count) ** 2 * np.pi / 2)


class Metal:
    """A rough metal by the formulas of GGX.

    Parameters
    ----------
    alpha_x, alpha_y
        Roughness along x and along y.
    """

    def __init__(self, alpha_x: float, alpha_y: float) -> None:
        self.stretch = np.array([alpha_x, alpha_y, 1.0])

    def distribution(self, m: Array) -> Array:
        """Return the density of normals."""
        stretched = np.sum((m / self.stretch) ** 2, axis=-1)
        return np.asarray(1.0 / (np.pi * np.prod(self.stretch) * stretched**2))

    def area(self, w: Array) -> Array:
        """Return the projected area of the normals that a direction sees [Walter2007]."""
        return np.asarray((w[..., 2] + np.linalg.norm(w * self.stretch, axis=-1)) / 2)

    def tint(self, m: Array, wo: Array) -> Array:
        """Return F G(wi), what f cos is in units of D / (4 area(wo)); (..., 3)."""
        cosine = np.maximum(np.sum(m * wo, axis=-1), 0.0)[..., None]
        cos_i = np.maximum(2.0 * cosine[..., 0] * m[..., 2] - wo[..., 2], 0.0)
        wi = 2.0 * cosine * m - wo
        shadowing = np.minimum(cos_i / np.maximum(self.area(wi), 1e-3), 1.0)[..., None]
        return np.asarray((COPPER + (1.0 - COPPER) * (1.0 - cosine) ** 5) * shadowing)


def measured_fields(
    metal: Metal,
    phi_i: Any,
    theta_i: Any,
    *,
    jacobian: bool = True,
    normals_at: tuple[int, int] = (9, 14),
    colors_at: int = 5,
) -> dict[str, NDArray[Any]]:
    """Return the fields of a file, of images with so many rows and columns.

    With one azimuth or two the material is isotropic. Without `jacobian` the file has f cos
    as its colours.
    """
    column, row = square(*normals_at)
    solid_angle = column * np.sin(column**2 * np.pi / 2)
    places = np.linspace(0.0, 1.0, colors_at)
    vndf, rgb = [], []
    for phi in phi_i:
        azimuth = phi if len(phi_i) <= 2 else 0.0
        for theta in theta_i:
            wo, m = directions(theta, phi), normals(column, row, azimuth)
            seen = metal.distribution(m) * np.maximum(m @ wo, 0.0) * solid_angle
            vndf.append(seen + 1e-4)
            warp = BilinearDensity(vndf[-1])
            warped = [[warp.place_of(x, y) for x in places] for y in places]
            h = normals(*np.moveaxis(warped, -1, 0), azimuth)
            color = metal.tint(h, wo) + 0.01
            if not jacobian:
                color *= (metal.distribution(h) / (4.0 * metal.area(wo)))[..., None]
            rgb.append(np.moveaxis(color, -1, 0))
    colors = np.reshape(rgb, (len(phi_i), len(theta_i), 3, colors_at, colors_at))
    images = {
        "ndf": metal.distribution(normals(column, row)),
        "sigma": metal.area(normals(*square(9, 9))),
        "vndf": np.reshape(vndf, (len(phi_i), len(theta_i), *normals_at)),
        "luminance": np.tensordot(colors, [0.2, 0.7, 0.1], (2, 0)),
        "rgb": colors,
    }
    return {
        "description": np.frombuffer(b"a metal by its formula", np.uint8),
        "phi_i": np.array(phi_i, np.float32),
        "theta_i": np.array(theta_i, np.float32),
        **{name: image.astype(np.float32) for name, image in images.items()},
        "jacobian": np.array([jacobian], np.uint8),
    }


def main(folder: Path = HERE) -> None:
    """Write the file: an isotropic metal, seen under five angles."""
    fields = measured_fields(Metal(0.35, 0.35), [0.0], elevations(5))
    (folder / "copper_rgb.bsdf").write_bytes(tensor_file(fields))


if __name__ == "__main__":
    main()
