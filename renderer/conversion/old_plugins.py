"""What plugins and properties of Mitsuba 0.4 to 0.6 are called in Mitsuba 3.

Made from the parameters that Mitsuba 0.6 documents [Jakob2010] and those that 3 reads.
Names of properties are written as in Mitsuba 3 (`max_depth`, not `maxDepth`).
"""

from __future__ import annotations

_PATH = "another method for the same picture"
PLUGINS = {  # (tag, old): (new, what differs; nothing if the name alone does)
    ("integrator", "volpath_simple"): ("volpath", ""),
    **{
        ("integrator", name): ("path", _PATH)
        for name in "bdpt mlt pssmlt erpt photonmapper ppm sppm vpl".split()
    },
    **{
        ("sampler", name): ("multijitter", "another pattern, the same expected picture")
        for name in "halton hammersley sobol faure".split()
    },
    **{
        ("film", name): ("hdrfilm", "the ending of the output says the kind of file")
        for name in "ldrfilm tiledhdrfilm mfilm".split()
    },
    ("sensor", "perspective_rdist"): ("perspective", "without radial distortion"),
    ("bsdf", "roughdiffuse"): ("diffuse", "without roughness"),
    ("emitter", "sky"): ("sunsky", "a later fit of the same model, without the sun"),
    ("emitter", "sun"): ("sunsky", "a later fit of the same model, without the sky"),
}
KEPT = {  # of a plugin that another one replaces
    "integrator": {"max_depth", "rr_depth", "hide_emitters"},
    "sampler": {"sample_count"},
    "bsdf": {"reflectance"},
}
BLENDED = {"mixturebsdf": "blendbsdf", "mixturephase": "blendphase"}  # if they are two
RENAMED = {
    ("film", "high_quality_edges"): "sample_border",
    ("medium", "density"): "sigma_t",
}
_NO_EFFECT = "it does not change the picture"
_TONES = "pictures are linear; the ending of the output says how they are stored"
NO_HEIR = {  # (tag, name in Mitsuba 3's style): why
    ("integrator", "strict_normals"): "Mitsuba 3 has no such check",
    ("sampler", "dimension"): _NO_EFFECT,
    ("sampler", "scramble"): _NO_EFFECT,
    ("film", "attach_log"): _NO_EFFECT,
    ("film", "channel_names"): "the integrator `aov` names its own",
    **{("film", n): _TONES for n in "gamma exposure key burn tonemap_method".split()},
    ("film", "variable"): _NO_EFFECT,
    ("film", "digits"): _NO_EFFECT,
    ("shape", "max_smooth_angle"): "normals are those of the file, or smooth without it",
    ("shape", "collapse"): _NO_EFFECT,
    ("shape", "load_materials"): "a material file is never read",
    ("shape", "srgb"): "vertex colours are linear",
    ("texture", "cache"): _NO_EFFECT,
    ("texture", "max_anisotropy"): "textures are not filtered over pixels",
    ("emitter", "cache"): _NO_EFFECT,
    ("emitter", "gamma"): "the file says how it is encoded",
    ("emitter", "stretch"): "the sky ends at the horizon",
    ("emitter", "resolution"): "the sky is a formula, no picture",
    ("emitter", "sun_radius_scale"): "sun_aperture is the angle of the sun, 0.5358",
    ("sensor", "kc"): "there is no radial distortion",
    ("bsdf", "ext_eta"): "metals are in vacuum",
    ("bsdf", "preserve_colors"): "`nonlinear` says it since 0.4",
    **{
        ("medium", name): _NO_EFFECT
        for name in "method step_size strategy channel sampling_density "
        "medium_sampling_weight".split()
    },
    ("medium", "monochromatic"): "colours stay apart",
    ("medium", "orientation"): "no phase function here has fibres",
    ("volume", "send_data"): _NO_EFFECT,
}
VALUES = {  # (tag, name): what an old value is now, and what differs
    ("film", "pixel_format"): {
        "luminancealpha": ("luminance_alpha", ""),
        "spectrum": ("rgb", "no spectral bands"),
        "spectrumalpha": ("rgba", "no spectral bands"),
    },
    ("film", "file_format"): dict.fromkeys(
        "png jpeg matlab mathematica numpy".split(),
        ("openexr", "the ending of the output says the kind of file"),
    ),
    ("texture", "filter_type"): {
        "ewa": ("bilinear", "textures are not filtered over pixels"),
        "trilinear": ("bilinear", "textures are not filtered over pixels"),
    },
    ("bsdf", "distribution"): {
        "phong": ("beckmann", "the distribution of the same roughness"),
        "as": ("beckmann", "the distribution of the same roughness"),
    },
}
# Suns and skies: what `scale` is of each, and what turns off the other half of sunsky.
SUN_AND_SKY = {
    "sky": ("sky_scale", "sun_scale"),
    "sun": ("sun_scale", "sky_scale"),
    "sunsky": ("", ""),
}
# Their y was up, with z in the south and x in the east. Now z is up, with x in the south
# and y in the west: a mirroring, which does not change a sky. A sun that is given by its
# direction needs no compass.
UPRIGHT = '<rotate x="1" angle="-90"/>'
UPRIGHT_BY_COMPASS = '<matrix value="0 -1 0 0  0 0 1 0  1 0 0 0  0 0 0 1"/>'
UV = ("uscale", "vscale", "uoffset", "voffset")
HINTS = {  # of what is left as it is
    "integrator": "--integrator path renders the scene without it",
    "phong": "roughplastic comes near it",
    "ward": "roughconductor with alpha_u and alpha_v comes near it",
    "coating": "plastic comes near it where the base is diffuse",
    "roughcoating": "roughplastic comes near it where the base is diffuse",
    "mixturebsdf": "blendbsdf mixes two BSDFs whose weights add up to 1",
    "mixturephase": "blendphase mixes two whose weights add up to 1",
    "animation": "nothing moves here",
    "subsurface": "there is no subsurface scattering",
}
