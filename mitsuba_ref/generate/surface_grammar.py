"""The grammar of surfaces as data: BSDFs and shapes, their properties and values.

A property without "!" may be left out. What several properties have to agree on is one
entry that draws them together. Values are such that Mitsuba takes the scene; what it does
wrong for known reasons is not drawn, and says so here.
"""

from __future__ import annotations

from xml.etree.ElementTree import Element

from mitsuba_ref.generate import files
from mitsuba_ref.generate.drawing import Drawing, Properties, plain
from mitsuba_ref.generate.textures import texture
from mitsuba_ref.generate.values import (
    all_of,
    choice,
    either,
    flag,
    integer,
    number,
    placed,
    scaled,
    vector,
)

# ------------------------------------------------------------------------------- BSDFs

COLOR = texture()
SCALAR = texture(as_number=True)
COLOR_OF_MEAN = texture(mean=True)  # lobes are chosen by it
_REFRACTION = texture(0.1, 5.0, as_number=True)
_METAL = either(
    choice("none", "Ag", "Al", "Au", "Cu", "Cr", "TiN", "W", "Hg"),
    all_of(eta=_REFRACTION, k=_REFRACTION),
)
_ALPHA = texture(0.02, 0.9, as_number=True)
_ROUGHNESS: Properties = {
    "distribution": choice("beckmann", "ggx", "GGX"),
    "sample_visible": flag,
    "alpha": either(_ALPHA, all_of(alpha_u=_ALPHA, alpha_v=_ALPHA), number(0.0, 1.0, 0.0)),
}
_INDICES: Properties = {
    "int_ior": either(number(1.05, 2.6), choice("diamond", "bk7", "acrylic glass")),
    "ext_ior": either(number(0.9, 1.04), choice("air", "vacuum", "helium")),
}
_GLASS: Properties = {"specular_reflectance": COLOR, "specular_transmittance": COLOR}
_COLORS: Properties = {
    "diffuse_reflectance": COLOR_OF_MEAN,
    "specular_reflectance": texture(0.05, 1.0, mean=True),  # both black is 0/0 there
}
_COAT: Properties = {**_COLORS, "nonlinear": flag}
_SHEETS: Properties = {
    "base_color": COLOR,
    "roughness": SCALAR,
    **dict.fromkeys(
        ("anisotropic", "spec_tint", "sheen", "sheen_tint", "flatness"), SCALAR
    ),
}
_RATE = number(0.2, 2.0)
_ANGLE = number(0.0, 180.0)


def _merl(drawing: Drawing, name: str) -> list[Element]:
    content = files.merl_bytes(drawing.rng)
    return [plain("string", name, drawing.keep_file("binary", content))]


def _rgl(drawing: Drawing, name: str) -> list[Element]:
    content = files.rgl_bytes(drawing.rng)
    return [plain("string", name, drawing.keep_file("bsdf", content))]


def _spec_trans(drawing: Drawing, name: str) -> list[Element]:
    return [] if drawing.opaque else SCALAR(drawing, name)


BSDFS: dict[str, Properties] = {
    "diffuse": {"reflectance": COLOR},
    "conductor": {"material": _METAL, "specular_reflectance": COLOR},
    "roughconductor": {"material": _METAL, "specular_reflectance": COLOR, **_ROUGHNESS},
    "dielectric": {**_INDICES, **_GLASS},
    "thindielectric": {**_INDICES, **_GLASS},
    "roughdielectric": {**_INDICES, **_GLASS, **_ROUGHNESS},
    "plastic": {**_INDICES, **_COAT},
    "roughplastic": {
        **_INDICES,
        **_COAT,
        **_ROUGHNESS,
        "alpha": either(number(0.02, 0.8), number(0.0, 0.001)),
    },
    "pplastic": {
        "eta": either(number(1.1, 2.2), all_of(**_INDICES)),
        **_COLORS,
        **_ROUGHNESS,
    },
    "principled": {
        **_SHEETS,
        "metallic": SCALAR,
        "clearcoat": SCALAR,
        "clearcoat_gloss": SCALAR,
        "spec_trans": _spec_trans,
        "eta": either(number(1.1, 2.2), all_of(specular=number(0.0, 1.0))),
        "main_specular_sampling_rate": _RATE,
        "clearcoat_sampling_rate": _RATE,
        "diffuse_reflectance_sampling_rate": _RATE,
    },
    "principledthin": {
        **_SHEETS,
        "spec_trans": SCALAR,
        "diff_trans": texture(0.0, 2.0, as_number=True),
        "eta": number(1.1, 2.2),
        "specular_reflectance_sampling_rate": _RATE,
        "specular_transmittance_sampling_rate": _RATE,
        "diffuse_reflectance_sampling_rate": _RATE,
        "diffuse_transmittance_sampling_rate": _RATE,
    },
    "null": {},
    "polarizer": {"transmittance": COLOR, "theta": _ANGLE, "polarizing": flag},
    "circular": {"transmittance": COLOR, "left_handed": flag},
    "retarder": {"transmittance": COLOR, "theta": _ANGLE, "delta": _ANGLE},
    "merl": {"filename!": _merl},
    "measured": {"filename!": _rgl},
    "hair": {
        "sigma_a": either(
            all_of(sigma_a=COLOR, scale=number(0.1, 5.0, 0.0)),
            all_of(eumelanin=number(0.0, 2.0), pheomelanin=number(0.0, 2.0)),
        ),
        # smoother hair amplifies rounding; without roughness it is black
        "longitudinal_roughness": number(0.2, 1.0, 0.0),
        "azimuthal_roughness": number(0.2, 1.0, 0.0),
        "scale_tilt": number(-10.0, 10.0),
        **_INDICES,
    },
}
FILTERS = ("polarizer", "circular", "retarder")
TRANSPARENT = (
    *("dielectric", "thindielectric", "roughdielectric", "principledthin", "null"),
    *("hair", *FILTERS),
)

_TURN: Properties = {"flip_invalid_normals": flag, "use_shadowing_function": flag}
WRAPPERS: dict[str, Properties] = {  # the map of the last two stands in `scene`
    "twosided": {},
    "mask": {"opacity": SCALAR},
    "blendbsdf": {"weight!": SCALAR},
    "normalmap": _TURN,
    "bumpmap": {"scale": number(-0.5, 0.5, 0.0, 3.0), **_TURN},
}
Structure = str | tuple[object, ...]
STRUCTURES: tuple[Structure, ...] = (
    ("mask", "diffuse"),
    ("mask", "dielectric"),
    ("blendbsdf", "diffuse", "roughconductor"),
    ("blendbsdf", "roughdielectric", "plastic"),
    ("normalmap", "roughplastic"),
    ("normalmap", "principled"),
    ("bumpmap", "diffuse"),
    ("bumpmap", "roughdielectric"),
    ("twosided", ("normalmap", "diffuse")),
    ("twosided", ("blendbsdf", "conductor", "diffuse"), "roughconductor"),
    ("mask", ("blendbsdf", "principled", "null")),
    ("blendbsdf", ("mask", "thindielectric"), "merl"),
    ("normalmap", "measured"),
    ("normalmap", ("bumpmap", "conductor")),
)
"""Nested BSDFs: each structure has kernels of its own, so that a fixed pool bounds the time
to compile; values and textures vary."""

# ------------------------------------------------------------------------------ shapes

_FLIP: Properties = {"flip_normals": flag}
_MESH: Properties = {"to_world!": placed("affine"), "face_normals": flag, **_FLIP}
_AXIS = all_of(p0=vector("point", 0.5), p1=vector("point", 0.9), radius=scaled(0.1, 0.4))


def _points_file(drawing: Drawing, name: str) -> list[Element]:
    content = files.curve_bytes(drawing.rng, drawing.unit)
    return [plain("string", name, drawing.keep_file("txt", content))]


def _distances(drawing: Drawing, name: str) -> list[Element]:
    content = files.grid_bytes(files.draw_distances(drawing.rng))
    return [plain("string", name, drawing.keep_file("vol", content))]


SHAPES: dict[str, Properties] = {  # meshes get their file in `scene`
    "sphere": {"to_world!": placed("rigid"), **_FLIP},
    "cylinder": {"to_world!": placed("turned"), **_FLIP},
    "disk": {"to_world!": placed("affine"), **_FLIP},
    "rectangle": _MESH,
    "cube": _MESH,
    "obj": {**_MESH, "flip_tex_coords": flag},
    "ply": {**_MESH, "flip_tex_coords": flag},
    "serialized": {**_MESH, "shape_index": integer(0)},
    # a turned one, or sizes that differ along x and z, Mitsuba shows in part
    "sdfgrid": {
        "filename!": _distances,
        "to_world!": placed("moved", (0.8, 1.5)),
        "normals": choice("smooth", "analytic"),
    },
    "linearcurve": {"filename!": _points_file, "to_world!": placed("affine")},
    "bsplinecurve": {"filename!": _points_file, "to_world!": placed("affine")},
}
UNPLACED: dict[str, Properties] = {  # by their own properties, without to_world
    "sphere": {
        "center!": vector("point", 1.2),
        "radius!": scaled(0.2, 0.8),
        **_FLIP,
    },
    "cylinder": {"p0!": _AXIS, **_FLIP},
}
INSTANCE: Properties = {"to_world!": placed("affine", (0.6, 1.3))}
MESHES = ("obj", "ply", "serialized")
GROUPS = (
    ("sphere",),
    ("cube",),
    ("ply",),
    ("disk",),
    ("cube", "sphere"),
    ("bsplinecurve",),
)
"""What shapegroups hold; instances of each have kernels of their own."""
DARK = ("sdfgrid", "linearcurve", "bsplinecurve")  # they cannot emit
EVEN = ("cylinder", "cube")  # in one colour alone; faces of a cube share (u, v)
