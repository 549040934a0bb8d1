"""The BSDFs of the simple renderer and of the kernels: number by number the same.

They share the reader of scenes and no formula. One is in double precision, with complex
indices of refraction, integrals inverted by bisection and the axes of textbooks. The other
is in single precision, on lanes, and leaves out what cancels. The same BSDFs along whole
paths, with textures and inside of one another, are compared in
tests/renderer/integrators/test_simple_path_tracer.py.
"""

from __future__ import annotations

import itertools
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from bsdf_probes import BsdfProbe, random_directions
from small_scenes import rgb

from renderer.plugins.bsdfs.kind import DELTA, SMOOTH, STRAIGHT
from renderer.simple.bsdfs import Lobe
from renderer.simple.materials import BSDFS, NESTED, bsdf_at

PLUGINS = Path(__file__).parents[2] / "plugins"
COUNT = 112  # of pairs of directions for each set of parameters
CLOSE = 1e-4
# of what moving the directions by a rounding of float32 changes: kernels round more often
ROUNDINGS = 20
HIT = SimpleNamespace(uv=(0.25, 0.75))  # no BSDF here has textures

LOBES = {Lobe.SMOOTH: SMOOTH, Lobe.DELTA: DELTA, Lobe.STRAIGHT: STRAIGHT}


def rough(plugin, **more):
    """Return a rough BSDF by both distributions, one and two alphas, both samplings."""
    alphas = ({"alpha": 0.1}, {"alpha_u": 0.4, "alpha_v": 0.06}, {"alpha": 0.9})
    if plugin == "roughplastic":
        alphas = ({"alpha": 0.1}, {"alpha": 0.5})
    return [
        {"type": plugin, "distribution": name, "sample_visible": visible, **alpha, **more}
        for name, visible, alpha in itertools.product(
            ("beckmann", "ggx"), (True, False), alphas
        )
    ]


PAINT = {
    "base_color": rgb(0.8, 0.4, 0.1),
    "roughness": 0.4,
    "anisotropic": 0.6,
    "metallic": 0.3,
    "spec_tint": 0.4,
    "sheen": 0.7,
    "sheen_tint": 0.5,
    "flatness": 0.6,
    "clearcoat": 0.8,
    "clearcoat_gloss": 0.3,
}
SHEET = {k: v for k, v in PAINT.items() if k != "metallic" and "coat" not in k}
GLASS = {"specular_reflectance": rgb(0.9, 0.8, 0.6), "specular_transmittance": 0.7}
COLORS = {"diffuse_reflectance": rgb(0.7, 0.2, 0.1), "specular_reflectance": 0.8}
SETS = [
    {"type": "diffuse", "reflectance": rgb(0.2, 0.5, 0.9)},
    {"type": "conductor", "material": "Au"},
    {"type": "conductor", "material": "none"},
    {"type": "dielectric", **GLASS},
    {"type": "dielectric", "int_ior": 1.0, "ext_ior": 1.7},
    {"type": "thindielectric", **GLASS},
    {"type": "null"},
    {"type": "plastic", **COLORS},
    {"type": "plastic", "nonlinear": True, "int_ior": 1.9, **COLORS},
    *rough("roughconductor", material="Cu"),
    *rough("roughdielectric", **GLASS),
    *rough("roughdielectric", int_ior=1.0, ext_ior=1.5)[:2],
    *rough("roughplastic", **COLORS),
    *rough("roughplastic", nonlinear=True, int_ior=1.9, **COLORS)[-1:],
    *rough("pplastic", **COLORS)[::2],
    {"type": "pplastic", "eta": 1.8},
    {"type": "polarizer", "transmittance": rgb(0.9, 0.5, 0.2)},
    {"type": "circular"},
    {"type": "retarder", "transmittance": 0.7},
    {"type": "hair"},
    {"type": "hair", "sigma_a": rgb(0.1, 0.4, 1.5), "scale": 0.3, "scale_tilt": 15.0}
    | {"longitudinal_roughness": 0.8, "azimuthal_roughness": 0.9, "int_ior": 1.3},
    {"type": "hair", "eumelanin": 0.1, "pheomelanin": 0.0, "scale_tilt": -4.0}
    | {"longitudinal_roughness": 0.2, "azimuthal_roughness": 0.2, "ext_ior": 1.8},
    {"type": "principled"},
    {"type": "principled", **PAINT},
    {"type": "principled", "roughness": 0.2, "spec_trans": 0.8, "eta": 1.7},
    {"type": "principled", "spec_trans": 0.5, **PAINT},
    {"type": "principled", **PAINT, "clearcoat_sampling_rate": 0.2, "specular": 0.9},
    {"type": "principledthin"},
    {"type": "principledthin", "spec_trans": 0.6, "diff_trans": 0.9, **SHEET},
    {"type": "principledthin", "spec_trans": 0.2, "diff_trans": 1.6, "eta": 1.3},
    {"type": "merl", "filename": str(PLUGINS / "bronze.binary")},
    {"type": "measured", "filename": str(PLUGINS / "copper_rgb.bsdf")},
]


def is_precise(bsdf, wo):
    """Return where the kernels keep their digits (n,).

    As Mitsuba's, those of `hair` have the angle gamma from an arc cosine, and its cosine
    from the sine. Near 0 and 90 degrees both lose digits.
    """
    if bsdf["type"] != "hair":
        return np.ones(len(wo), bool)
    across = np.abs(wo[:, ::2]) / np.linalg.norm(wo[:, ::2], axis=1, keepdims=True)
    return across.min(axis=1) > 0.05


def name_of(bsdf):
    values = (value for value in bsdf.values() if not isinstance(value, dict))
    return "-".join(Path(str(value)).name for value in values)


def both(bsdf):
    """Return the simple BSDF and the probe of the kernels."""
    probe = BsdfProbe(bsdf)
    return bsdf_at(probe.description, HIT), probe


def directions(simple, probe, seed):
    """Return wo, wi (n, 3) of float32: on both sides, one in ten grazing, half near lobes.

    wo is in front of a BSDF that only reflects: behind it the kernels find no material.
    """
    rng = np.random.default_rng(seed)
    transmits = probe.kind.transmits
    wo = random_directions(COUNT, rng, both_sides=transmits)
    wi = random_directions(COUNT, rng, both_sides=True)
    for k in range(0, COUNT, 2):
        sample = simple.sample(wo[k].astype(float), tuple(rng.random(3)))
        moved = sample.wi + 0.02 * rng.standard_normal(3)
        wi[k] = moved / np.linalg.norm(moved)
    return wo, wi


def evaluated(simple, wo, wi):
    """Return f |cos| and density as the columns of an array (n, 4)."""
    pairs = zip(wo.astype(float), wi.astype(float), strict=True)
    found = (simple.eval_pdf(o, i) for o, i in pairs)
    return np.array([(*f_cos, pdf) for f_cos, pdf in found])


def rounded_otherwise(v, rng):
    """Return directions that differ by a rounding of float32 in each component."""
    return v.astype(float) * (1.0 + 2.0**-24 * rng.choice((-1.0, 1.0), v.shape))


def test_every_material_is_there_twice():
    from renderer.plugins.bsdfs.registry import PLUGINS, VARIANTS

    theirs = {name for name, kind in (PLUGINS | VARIANTS).items() if ours(kind)}
    assert set(BSDFS) == theirs
    assert {bsdf["type"] for bsdf in SETS} == theirs - set(NESTED) - set(VARIANTS)


def ours(kind):
    return not getattr(kind, "source", "")


@pytest.mark.parametrize("bsdf", SETS, ids=name_of)
def test_f_and_density_are_the_same(bsdf):
    """At 112 pairs of directions, within 1e-4 or what rounding the directions changes."""
    simple, probe = both(bsdf)
    if not probe.kind.smooth:
        assert not evaluated(simple, *directions(simple, probe, 1)).any()
        return
    wo, wi = directions(simple, probe, 1)
    expected = evaluated(simple, wo, wi)
    rng = np.random.default_rng(2)
    moved = [
        evaluated(simple, rounded_otherwise(wo, rng), rounded_otherwise(wi, rng))
        for _ in range(2)
    ]
    unsure = np.max(np.abs(np.array(moved) - expected), axis=0)
    found = np.column_stack(probe.eval_pdf(wo, wi))
    error = np.abs(found - expected) * is_precise(bsdf, wo)[:, None]
    allowed = CLOSE * np.abs(expected) + ROUNDINGS * unsure + 1e-7
    worst = np.unravel_index(np.argmax(error / allowed), error.shape)
    assert (error <= allowed).all(), (wo[worst[0]], wi[worst[0]], found[worst[0]])
    assert (expected[:, 3] > 0.0).mean() > 0.3


@pytest.mark.parametrize("bsdf", SETS, ids=name_of)
def test_the_same_numbers_choose_the_same_directions(bsdf):
    """Lobe, direction, weight, density and eta; some in a hundred meet an edge.

    There a number is on the other side of a probability, or a direction on the other side
    of the horizon, by rounding.
    """
    simple, probe = both(bsdf)
    rng = np.random.default_rng(3)
    wo = random_directions(COUNT, rng, both_sides=probe.kind.transmits)
    numbers = rng.integers(0, 1 << 24, (COUNT, 3)) * 2.0**-24
    found = probe.sample(wo, numbers)
    samples = [
        simple.sample(o, tuple(n)) for o, n in zip(wo.astype(float), numbers, strict=True)
    ]
    wi, weight = np.array([s.wi for s in samples]), np.array([s.weight for s in samples])
    alive = weight.any(axis=1)
    same = alive == (found.weight.any(axis=1) & (found.pdf > 0.0))
    close = np.abs(found.weight - weight).max(axis=1) <= 3e-3 * weight.max(axis=1)
    lobes = np.array([LOBES[s.lobe] for s in samples])
    pdf = np.where(lobes == SMOOTH, [s.pdf for s in samples], found.pdf)
    close &= np.abs(found.pdf - pdf) <= 3e-3 * np.abs(pdf) + 1e-6
    close &= lobes == found.lobe
    close &= np.abs(found.eta - [s.eta for s in samples]) < 1e-6
    close &= np.abs(found.wi - wi).max(axis=1) < 3e-4
    assert same.mean() >= 0.99
    assert close[alive & same].mean() >= 0.98, np.flatnonzero(alive & same & ~close)
    assert alive.mean() > 0.3
