"""Reader of measured materials of the RGL database, `*_rgb.bsdf` [Dupuy2018].

A file has, for pairs of azimuth and elevation of the viewer (`phi_i`, `theta_i`), two
densities on the unit square and a colour image, and the distribution of normals `ndf` with
its projected area `sigma`. Rows go along the azimuth, columns along the elevation.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.plugins.bsdfs.tensor_file import TensorFile

Array = NDArray[np.float32]

_LARGEST = 1e9  # of a number in the file: products of several fit into a float32
# name -> type and number of axes
_FIELDS = {
    "description": ("u1", 1),
    "jacobian": ("u1", 1),
    "phi_i": ("<f4", 1),
    "theta_i": ("<f4", 1),
    "ndf": ("<f4", 2),
    "sigma": ("<f4", 2),
    "vndf": ("<f4", 4),
    "luminance": ("<f4", 4),
    "rgb": ("<f4", 5),
}
_IMAGES = ("ndf", "sigma", "vndf", "luminance", "rgb")
_DENSITIES = ("vndf", "luminance")


class Density(NamedTuple):
    """Bilinear densities on the unit square with their integrals, for sampling.

    The integral of each density is 1.
    """

    values: Array  # (phi_i, theta_i, rows, columns)
    rows: Array  # (phi_i, theta_i, rows - 1): of all rows up to the end of each patch
    columns: Array  # (phi_i, theta_i, rows, columns - 1): along a row, likewise


@dataclass(frozen=True, eq=False)
class MeasuredMaterial:
    """The content of a file; its images have the azimuth along rows."""

    phi_i: Array
    """(phi_i,) [rad]; one or two: the material is isotropic."""

    theta_i: Array
    """(theta_i,) [rad]."""

    ndf: Array
    """(rows, columns), distribution of normals."""

    sigma: Array
    """(rows, columns), projected area of the normals that a direction sees."""

    vndf: Density
    """Distribution of visible normals."""

    luminance: Density
    """What it reflects, by the place that `vndf` warps to the normal."""

    rgb: Array
    """(phi_i, theta_i, 3, size, size), f cos; by the same place."""

    jacobian: bool
    """Whether f cos is `rgb` times ndf / (4 sigma)."""

    @property
    def isotropic(self) -> bool:
        """Whether only the azimuth between viewer and normal matters."""
        return len(self.phi_i) <= 2

    @property
    def sectors(self) -> int:
        """Return how often the range of `phi_i` fits in a full turn; isotropic: 1."""
        if self.isotropic:
            return 1
        return round(2.0 * np.pi / (float(self.phi_i[-1]) - float(self.phi_i[0])))


def read_measured(path: Path) -> MeasuredMaterial:
    """Read a `*_rgb.bsdf` file.

    Raises
    ------
    SceneError
        If it cannot be read, or its fields are not those of a measured material.
    """
    try:
        with path.open("rb") as file:
            content = TensorFile(path, file)
            _check(content)
            fields = {name: content.read(name) for name in _FIELDS}
    except OSError as error:
        raise SceneError(f"{path.name}: {error.strerror or error}") from None
    for name in ("phi_i", "theta_i", *_IMAGES):
        # NaN is not below the limit either
        if not (largest := np.abs(fields[name]).max()) <= _LARGEST:
            raise content.error(f"{name}: found {largest:g}; expected at most {_LARGEST:g}")
    for name in ("phi_i", "theta_i"):
        steps = np.diff(fields[name].astype(np.float64))
        for k in np.flatnonzero(steps <= 0.0)[:1]:
            before, after = fields[name][k : k + 2]
            raise content.error(
                f"{name}: found {after:g} after {before:g}; expected increasing angles"
            )
    for name in _IMAGES[:-1]:  # colours outside of the gamut are negative
        if (lowest := fields[name].min()) < 0.0:
            raise content.error(f"{name}: found {lowest:g}; expected no negative numbers")
    densities = {}
    for name in _DENSITIES:
        densities[name] = _normalized(fields[name])
        if densities[name] is None:
            raise content.error(
                f"{name}: found a density that integrates to 0 or overflows; expected a "
                "positive integral for each pair of angles"
            )
    images = {name: fields[name] for name in ("phi_i", "theta_i", "ndf", "sigma", "rgb")}
    return MeasuredMaterial(**images, **densities, jacobian=bool(fields["jacobian"][0]))


def _check(file: TensorFile) -> None:
    """Refuse a file whose fields do not fit, before any is read."""
    if "wavelengths" in file.fields:
        raise file.error(
            "has spectra over wavelengths; as in Mitsuba's scalar_rgb colours are needed: "
            "the file of the same material whose name ends with _rgb.bsdf"
        )
    if missing := [name for name in _FIELDS if name not in file.fields]:
        raise file.error(
            f"has no field {', '.join(missing)}; it has "
            f"{', '.join(file.fields) or 'none'}; needed are {', '.join(_FIELDS)}"
        )
    for name, (kind, rank) in _FIELDS.items():
        field = file.fields[name]
        if (field.type, len(field.shape)) != (kind, rank):
            raise file.error(
                f"{name}: found {len(field.shape)} axes of type {np.dtype(field.type)}; "
                f"expected {rank} of type {np.dtype(kind)}"
            )
    shapes = {name: file.fields[name].shape for name in _FIELDS}
    angles = shapes["phi_i"] + shapes["theta_i"]
    square = (shapes["luminance"][2],) * 2
    expected = {
        "jacobian": (1,),
        "vndf": (*angles, *shapes["vndf"][2:]),
        "luminance": (*angles, *square),
        "rgb": (*angles, 3, *square),
    }
    for name, shape in expected.items():
        if shapes[name] != shape:
            raise file.error(f"{name}: found the shape {shapes[name]}; expected {shape}")
    for name in ("phi_i", "theta_i", *_IMAGES):
        least = 2 if name in _IMAGES else 1
        if min(shapes[name][-2:]) < least:
            raise file.error(
                f"{name}: found the shape {shapes[name]}; expected at least {least} along "
                "each axis"
            )


def _normalized(data: Array) -> Density | None:
    """Return densities that integrate to 1; None if one of them is 0 or overflows.

    Integrals are sums of trapezia in double precision, rounded before they are divided by
    the whole, as in Mitsuba.
    """
    _, _, height, width = data.shape
    d = data.astype(np.float64)
    columns = np.cumsum((d[..., :-1] + d[..., 1:]) * (0.5 / (width - 1)), axis=-1)
    along = columns[..., -1]
    rows = np.cumsum((along[..., :-1] + along[..., 1:]) * (0.5 / (height - 1)), axis=-1)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        scale = (1.0 / rows[..., -1:]).astype(np.float32)
        scaled = Density(
            data * scale[..., None],
            rows.astype(np.float32) * scale,
            columns.astype(np.float32) * scale[..., None],
        )
    return scaled if all(np.isfinite(part).all() for part in scaled) else None
