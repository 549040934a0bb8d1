"""Measured BSDF in the parameterization of Dupuy and Jakob (2018): the RGL database.

Half vectors are warped to the unit square such that visible normals are uniform there
[Dupuy2018]. Colours are stored by the place on that square, where highlights are wide, and
their luminance is the density of places. So samples follow f cos itself.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.functions import (
    floor,
    maximum,
    negate_by_sign,
    select,
    splat_f32,
    sqrt,
)
from renderer.kernels.lanes.mathematics import arctan2, sincos
from renderer.kernels.lanes.vectors import dot, normalize, select3, vec3
from renderer.plugins.bsdfs.kind import (
    BsdfKind,
    BsdfSample,
    Float,
    albedo_at_normal_incidence,
)
from renderer.plugins.bsdfs.measured_file import read_measured
from renderer.plugins.bsdfs.mirror import reflect
from renderer.plugins.bsdfs.parameters import Table
from renderer.plugins.bsdfs.parametric_warp import (
    Density,
    eval_image,
    invert_density,
    sample_density,
    slices_at,
)
from renderer.scene_file.description import OtherBsdf

_PI = np.float32(np.pi)
_HALF_PI = np.float32(np.pi / 2)
_TWO_OVER_PI = np.float32(2 / np.pi)
_INV_TWO_PI = np.float32(0.5 / np.pi)
_TWO_PI_SQUARED = np.float32(2 * np.pi**2)


class Measured(NamedTuple):
    """Its parameters. Tables have their numbers of rows and columns in front."""

    isotropic: Float  # 1: the azimuth of normals is that relative to wo
    jacobian: Float  # 1: f cos is rgb ndf / (4 sigma); 0: it is rgb
    half: Float  # 1: tabulated for half of the azimuths of wo; the rest is turned
    quarter: Float  # 1: for a quarter; the rest is mirrored
    phi_i: Table  # [rad]
    theta_i: Table  # [rad]
    ndf: Table
    sigma: Table
    vndf: Table
    vndf_rows: Table  # integrals, without sizes in front
    vndf_columns: Table
    luminance: Table
    luminance_rows: Table
    luminance_columns: Table
    rgb: Table


class View(NamedTuple):
    """The direction wo, folded into the azimuths that are tabulated."""

    wo: Any
    phi: Any
    theta: Any
    slices: Any  # of the tables that depend on wo


def read(properties: Any) -> OtherBsdf:
    """Read the properties of a file: a `filename` with the measurements."""
    expected = "the path of an _rgb.bsdf file (RGL)"
    found = properties.file("the measurements", expected, read_measured)
    return OtherBsdf(
        "measured",
        {
            "isotropic": float(found.isotropic),
            "jacobian": float(found.jacobian),
            "half": float(found.sectors >= 2),
            "quarter": float(found.sectors == 4),
            "phi_i": _table(found.phi_i[None]),
            "theta_i": _table(found.theta_i[None]),
            "ndf": _table(found.ndf),
            "sigma": _table(found.sigma),
            "vndf": _table(found.vndf.values),
            "vndf_rows": found.vndf.rows.ravel(),
            "vndf_columns": found.vndf.columns.ravel(),
            "luminance": _table(found.luminance.values),
            "luminance_rows": found.luminance.rows.ravel(),
            "luminance_columns": found.luminance.columns.ravel(),
            "rgb": _table(found.rgb),
        },
    )


def _table(numbers: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return a flat array that begins with the sizes of the last two axes."""
    return np.concatenate((numbers.shape[-2:], numbers.ravel())).astype(np.float32)


@kernel
def _angles(v):
    """Return elevation and azimuth."""
    return arctan2(sqrt(v.x * v.x + v.y * v.y), v.z), arctan2(v.y, v.x)


@kernel
def _column(theta):
    """Return the place of an elevation along the columns of an image, in [0, 1]."""
    return sqrt(theta * _TWO_OVER_PI)


@kernel
def _row(phi):
    """Return the place of an azimuth along the rows of an image, in [0, 1]."""
    return (phi + _PI) * _INV_TWO_PI


@kernel
def _folded(material, wo, v):
    """Return a direction, mirrored as wo is to reach the azimuths that are tabulated."""
    by_y = select(material.half > 0.0, -wo.y, 1.0)
    by_x = select(material.quarter > 0.0, -wo.x, by_y)
    return vec3(negate_by_sign(v.x, by_x), negate_by_sign(v.y, by_y), v.z)


@kernel
def _view(material, wo):
    folded = _folded(material, wo, wo)
    theta, phi = _angles(folded)
    return View(folded, phi, theta, slices_at(material.phi_i, material.theta_i, phi, theta))


@kernel
def _densities(material):
    return (
        Density(material.vndf, material.vndf_rows, material.vndf_columns),
        Density(material.luminance, material.luminance_rows, material.luminance_columns),
    )


@kernel
def _f_cos(material, view, x, y, column, row):
    """Return f cos by the place (x, y) on the warped square, and that of the normal."""
    rgb, slices = material.rgb, view.slices
    color = vec3(
        eval_image(rgb, slices, x, y, 3, 0),
        eval_image(rgb, slices, x, y, 3, 1),
        eval_image(rgb, slices, x, y, 3, 2),
    )
    ndf = eval_image(material.ndf, None, column, row, 1, 0)
    area = eval_image(material.sigma, None, _column(view.theta), _row(view.phi), 1, 0)
    by_area = ndf / (4.0 * select(area > 0.0, area, np.float32(np.inf)))
    return color * select(material.jacobian > 0.0, by_area, 1.0)


@kernel
def _directions_by_area(column, sine, cosine):
    """Return the solid angle [sr] of wi by the area on the square of normals.

    `cosine` is that between wo and the normal, whose sine to z is `sine`.
    """
    return maximum(_TWO_PI_SQUARED * column * sine, np.float32(1e-6)) * 4.0 * cosine


@kernel
def eval_pdf(material, wo, wi):
    """Return f cos, and the density [1/sr] with which `sample` chooses wi."""
    possible = (wi.z > 0.0) & (wo.z > 0.0)
    view = _view(material, wo)
    m = normalize(view.wo + _folded(material, wo, wi))
    theta, phi = _angles(m)
    column = _column(theta)
    row = _row(select(material.isotropic > 0.0, phi - view.phi, phi))
    row = row - floor(row)
    vndf, luminance = _densities(material)
    x, y, visible = invert_density(vndf, view.slices, column, row)
    f_cos = _f_cos(material, view, x, y, column, row)
    density = visible * eval_image(luminance.values, view.slices, x, y, 1, 0)
    sine = sqrt(m.x * m.x + m.y * m.y)
    pdf = density / _directions_by_area(column, sine, dot(view.wo, m))
    none = splat_f32(0.0)
    return select3(possible, f_cos, vec3(none, none, none)), select(possible, pdf, 0.0)


@kernel
def sample(material, wo, numbers):
    """Mirror wo at a normal: a place by its luminance, warped to a visible normal."""
    view = _view(material, wo)
    vndf, luminance = _densities(material)
    x, y, bright = sample_density(luminance, view.slices, numbers.y, numbers.x)
    column, row, visible = sample_density(vndf, view.slices, x, y)
    theta, phi = column * column * _HALF_PI, (2.0 * row - 1.0) * _PI
    sin_phi, cos_phi = sincos(select(material.isotropic > 0.0, phi + view.phi, phi))
    sine, cosine = sincos(theta)
    m = vec3(cos_phi * sine, sin_phi * sine, cosine)
    towards = dot(view.wo, m)
    wi = _folded(material, wo, reflect(view.wo, m))
    possible = (wi.z > 0.0) & (wo.z > 0.0) & (towards > 0.0)
    pdf = bright * visible / _directions_by_area(column, sine, towards)
    pdf = select(possible, pdf, 0.0)
    f_cos = _f_cos(material, view, x, y, column, row)
    weight = f_cos * select(pdf > 0.0, 1.0 / pdf, 0.0)
    return BsdfSample(wi, weight, pdf, splat_f32(1.0))


def _not_all(description: Any) -> bool:
    """Say that samples may miss light: where the luminance is 0 a colour may be stored."""
    return False


MEASURED = BsdfKind(
    "measured",
    Measured,
    read,
    "measured (RGL)",
    sample,
    eval_pdf,
    albedo=albedo_at_normal_incidence,
    oriented=True,
    reaches_all=_not_all,
)
