"""The grammar of the rest as data: lights, sensors, films, integrators, media.

As `surface_grammar`: a property without "!" may be left out.
"""

from __future__ import annotations

from xml.etree.ElementTree import Element

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
    scaled,
    turned,
)

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

# -------------------------------------------------------------------------------- media


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
    "blendphase": {"weight!": either(number(0.1, 0.9), _density(0.0, 1.2))},
}
