"""The grammar of scenes as data: plugins, their properties, and what each may be.

A property without "!" may be left out. What several properties have to agree on is one
entry that draws them together. Values are such that Mitsuba takes the scene; what it does
wrong for known reasons is not drawn, and says so here.
"""

from __future__ import annotations

from xml.etree.ElementTree import Element

from mitsuba_ref.generate import files
from mitsuba_ref.generate.drawing import Drawing, Properties, Value, numbers_text, plain
from mitsuba_ref.generate.textures import (
    GRID,
    grid,
    light_image,
    light_texture,
    texture,
    volume,
)
from mitsuba_ref.generate.values import (
    above,
    aimed,
    all_of,
    choice,
    either,
    emission,
    flag,
    integer,
    number,
    placed,
    scaled,
    turned,
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
_COAT: Properties = {
    "diffuse_reflectance": COLOR_OF_MEAN,
    "specular_reflectance": texture(0.05, 1.0, mean=True),  # both black is 0/0 there
    "nonlinear": flag,
}
_SHEETS: Properties = {
    "base_color": COLOR,
    "roughness": SCALAR,
    **dict.fromkeys(
        ("anisotropic", "spec_tint", "sheen", "sheen_tint", "flatness"), SCALAR
    ),
}
_RATE = number(0.2, 2.0)


def _measured(drawing: Drawing, name: str) -> list[Element]:
    content = files.measured_bytes(drawing.rng)
    return [plain("string", name, drawing.keep_file("binary", content))]


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
    "merl": {"filename!": _measured},
}
TRANSPARENT = ("dielectric", "thindielectric", "roughdielectric", "principledthin", "null")

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
    ("normalmap", ("bumpmap", "conductor")),
)
"""Nested BSDFs: each structure has kernels of its own, so that a fixed pool bounds the time
to compile; values and textures vary."""

# ------------------------------------------------------------------------------ shapes

_FLIP: Properties = {"flip_normals": flag}
_MESH: Properties = {"to_world!": placed("affine"), "face_normals": flag, **_FLIP}
_AXIS = all_of(p0=vector("point", 0.5), p1=vector("point", 0.9), radius=scaled(0.1, 0.4))


def _points_file(drawing: Drawing, name: str) -> list[Element]:
    content = files.curve_bytes(drawing.rng)
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

# ------------------------------------------------------------------------------ lights


def _place(drawing: Drawing, name: str) -> list[Element]:
    if name == "position":
        return [above(drawing, "point", name, 3.0)]
    transform = Element("transform", name=name)
    step = above(drawing, "translate", "", 3.0)
    del step.attrib["name"]
    transform.append(step)
    return [transform]


def _direction(drawing: Drawing, name: str) -> list[Element]:
    x, y, z = drawing.direction()
    return [plain("vector", name, numbers_text((x, -abs(y) - 0.2, z)))]


def _sun(drawing: Drawing, name: str) -> list[Element]:
    x, y, z = drawing.direction()
    return [plain("vector", name, numbers_text((x, y, abs(z) + 0.2)))]


def _spot_cone(drawing: Drawing, name: str) -> list[Element]:
    cutoff = drawing.rng.uniform(10.0, 60.0)
    found = [plain("float", name, cutoff)]
    if drawing.chance(0.5):
        beam = cutoff * drawing.rng.uniform(0.1, 1.0)
        found.append(plain("float", "beam_width", beam))
    return found


_WIDTH = either(
    number(20.0, 60.0),
    all_of(
        fov=number(20.0, 60.0), fov_axis=choice("x", "y", "diagonal", "smaller", "larger")
    ),
    all_of(focal_length=choice("50mm", "35mm", "80mm")),
)
LIGHTS: dict[str, Properties] = {
    "point": {
        "position!": either(_place, lambda drawing, _: _place(drawing, "to_world")),
        "intensity!": emission(30.0, 2),
    },
    "spot": {
        "to_world!": aimed,
        "intensity!": emission(60.0, 2),
        "cutoff_angle": _spot_cone,
        "texture": light_texture(1.0, plain_share=0.0),
    },
    "directional": {
        "direction!": either(_direction, lambda drawing, _: aimed(drawing, "to_world")),
        "irradiance!": emission(3.0),
    },
    "projector": {
        "to_world!": aimed,
        "irradiance!": light_texture(1.0, plain_share=0.3),
        "scale": scaled(5.0, 30.0, 2),
        "fov!": _WIDTH,
    },
    "constant": {"radiance!": emission(1.0), "to_world": turned},
    "envmap": {
        "filename!": light_image,
        "scale": number(0.3, 2.0),
        "mis_compensation": flag,
        "to_world": turned,
    },
    "sunsky": {
        "sun_direction!": either(
            _sun,
            all_of(
                hour=number(10.0, 16.0), minute=number(0.0, 59.0), latitude=number(20, 50)
            ),
            all_of(
                month=integer(4, 6, 8), day=integer(1, 12, 28), year=integer(1999, 2026)
            ),
        ),
        "turbidity": number(1.0, 10.0, 1.0, 10.0),
        "albedo": texture(plain_share=1.0),
        "sun_scale": number(0.0, 1.0, 0.0),
        "sky_scale": number(0.1, 2.0),
        "sun_aperture": number(0.3, 20.0),
        "complex_sun": flag,
        "to_world": turned,
    },
}
ENVIRONMENTS = ("constant", "envmap", "sunsky")
WITHOUT_EXTENT = ("point", "spot", "directional")  # those that `whitted` replays

# ---------------------------------------------------------------------- sensor and film

_SHUTTER = all_of(shutter_open=number(0.0, 0.5), shutter_close=number(0.5, 1.0))
_CLIP: Properties = {"near_clip!": scaled(1e-3, 0.5), "far_clip": scaled(50.0, 5e3)}
_PINHOLE: Properties = {**_CLIP, "fov!": _WIDTH, "shutter_open": _SHUTTER}
SENSORS: dict[str, Properties] = {
    "perspective": {
        **_PINHOLE,
        "principal_point_offset_x": number(-0.2, 0.2),
        "principal_point_offset_y": number(-0.2, 0.2),
        "focus_distance": scaled(2.0, 6.0),
    },
    "thinlens": {
        **_PINHOLE,
        "aperture_radius!": scaled(0.01, 0.3),
        "focus_distance": scaled(2.0, 6.0),
    },
    "orthographic": {**_CLIP, "shutter_open": _SHUTTER},
}


def _size(drawing: Drawing, name: str) -> list[Element]:
    """Draw the film's size, and a crop window at times."""
    rng = drawing.rng
    sizes = {"width": rng.randint(8, 14), "height": rng.randint(6, 11)}
    if drawing.chance(0.3):
        for side, axis in (("width", "x"), ("height", "y")):
            crop = rng.randint(sizes[side] // 2, sizes[side])
            sizes[f"crop_{side}"] = crop
            sizes[f"crop_offset_{axis}"] = rng.randint(0, sizes[side] - crop)
        sizes = dict(sorted(sizes.items(), key=lambda item: len(item[0])))
    return [plain("integer", key, str(value)) for key, value in sizes.items()]


FILM: Properties = {
    "width!": _size,
    "pixel_format": choice("rgb", "rgba", "luminance", "xyz"),
    "component_format": choice("float16", "float32"),
    "file_format": choice("openexr", "pfm", "rgbe"),
    "sample_border": flag,
    "compensate": flag,
    "banner": flag,
}
FILTERS: dict[str, Properties] = {  # read by both; a replay has the box
    "box": {},
    "tent": {"radius": number(0.5, 2.0)},
    "gaussian": {"stddev": number(0.3, 0.8)},
    "mitchell": {"B": number(0.0, 0.5), "C": number(0.0, 0.5)},
    "catmullrom": {},
    "lanczos": {"lobes": integer(1, 2, 3)},
}
_COUNT: Properties = {"sample_count!": integer(1, 1, 2, 4), "seed": integer(0, 1, 77)}
SAMPLERS: dict[str, Properties] = {
    "independent": _COUNT,
    "stratified": {**_COUNT, "jitter": flag},
    "multijitter": {**_COUNT, "jitter": flag},
    "orthogonal": {**_COUNT, "jitter": flag, "strength": integer(2, 3)},
    "ldsampler": _COUNT,
}

# -------------------------------------------------------------------------- integrators

_DEPTH: Properties = {"max_depth": integer(-1, 1, 2, 3, 5, 8), "rr_depth": integer(1, 2, 5)}
_HIDE: Properties = {"hide_emitters": flag}
_SAMPLES = either(
    all_of(shading_samples=integer(1)),
    all_of(emitter_samples=integer(1, 2), bsdf_samples=integer(0, 1)),
    all_of(emitter_samples=integer(0), bsdf_samples=integer(1)),
)
INTEGRATORS: dict[str, Properties] = {
    "path": {**_DEPTH, **_HIDE},
    "direct": {"shading_samples": _SAMPLES, **_HIDE},
    "whitted": {"max_depth": integer(1, 2, 3, 5), "cutoff": number(0.0005, 0.05), **_HIDE},
    "depth": _HIDE,
    "aov": {"aovs!": choice("z:depth", "n:sh_normal, p:position", "t:uv", "g:geo_normal")},
    "moment": {},
    "volpath": {**_DEPTH, **_HIDE},
}
INSIDE: Value = choice("path", "direct")  # of `moment`, and often of `aov`

# -------------------------------------------------------------------------------- media

MEDIA = False
"""Whether scenes have media, in `volpath`: to be switched on where it can be replayed."""


def _density(low: float, high: float) -> Value:
    numbers = {**GRID, "filename!": grid(low, high)}

    def draw(drawing: Drawing, name: str) -> list[Element]:
        return [volume(drawing, name, numbers)]

    return draw


_ALBEDO = texture(0.2, 1.0, plain_share=1.0)
MEDIUM: dict[str, Properties] = {
    "homogeneous": {
        "sigma_t!": number(0.1, 3.0),
        "albedo": _ALBEDO,
        "scale": number(0.5, 2.0),
    },
    "heterogeneous": {
        "sigma_t!": _density(0.1, 3.0),
        "albedo": _density(0.2, 0.9),
        "scale": number(0.5, 2.0),
    },
}
PHASES: dict[str, Properties] = {
    "isotropic": {},
    "hg": {"g": number(-0.9, 0.9, 0.0)},
    "rayleigh": {},
    "tabphase": {"values!": choice("0.5, 1, 2", "1, 0, 1", "0.1, 0.1, 0.2, 3")},
    "blendphase": {"weight!": number(0.1, 0.9)},
}
