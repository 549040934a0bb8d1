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
from chi_square import assert_follows, gauss_masses, histogram
from small_scenes import rgb

from renderer.plugins.bsdfs.kind import DELTA, SMOOTH, STRAIGHT
from renderer.simple.bsdfs import Lobe, reflectance_of_glass
from renderer.simple.materials import BSDFS, NESTED, bsdf_at
from renderer.simple.rough import Microfacets

BRONZE = Path(__file__).parents[2] / "plugins" / "bronze.binary"
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
    {"type": "principled"},
    {"type": "principled", **PAINT},
    {"type": "principled", "roughness": 0.2, "spec_trans": 0.8, "eta": 1.7},
    {"type": "principled", "spec_trans": 0.5, **PAINT},
    {"type": "principled", **PAINT, "clearcoat_sampling_rate": 0.2, "specular": 0.9},
    {"type": "principledthin"},
    {"type": "principledthin", "spec_trans": 0.6, "diff_trans": 0.9, **SHEET},
    {"type": "principledthin", "spec_trans": 0.2, "diff_trans": 1.6, "eta": 1.3},
    {"type": "merl", "filename": str(BRONZE)},
]


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
    error = np.abs(found - expected)
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


SAMPLES = 1 << 13
FINDS = 0.35
ROUND = np.linspace(0, 2 * np.pi, 7)
RISE = np.linspace(-1, 1, 11)
SPREAD = [
    {"type": "roughconductor", "alpha_u": 0.3, "alpha_v": 0.7, "distribution": "beckmann"},
    {"type": "roughdielectric", "alpha": 0.5, "distribution": "ggx"},
    {"type": "principledthin", "spec_trans": 0.4, "diff_trans": 1.0, "roughness": 0.8},
]


@pytest.mark.parametrize("bsdf", SPREAD, ids=name_of)
def test_directions_follow_their_density_and_weights_their_integral(bsdf):
    """By chi-square, 8192 samples each, with a false alarm rate of 1e-5 for all three.

    A density that is tilted by 35 % from one end to the other would be found with a power
    of 99 %; finer differences are those of the kernels' samplers, which choose the same
    directions and get a million samples (test_bsdfs_against_mitsuba.py). The mean of the
    weights is the integral of f |cos|, within 3 %.
    """
    simple, _ = both(bsdf)
    wo = np.array([0.6, 0.3, np.sqrt(0.55)])
    numbers = np.random.default_rng(4).random((SAMPLES, 3))
    samples = [simple.sample(wo, tuple(u)) for u in numbers]
    wi = np.array([s.wi for s in samples if s.weight.any()])
    known = {}

    def at(cosine, angle):
        if not known:
            sine = np.sqrt(1 - cosine**2)
            there = np.column_stack((sine * np.cos(angle), sine * np.sin(angle), cosine))
            known[0] = evaluated(simple, np.broadcast_to(wo, there.shape), there)
        return known[0]

    reflected = gauss_masses(lambda a, b: at(a, b)[:, 0], RISE, ROUND, 5)
    chosen = gauss_masses(lambda a, b: at(a, b)[:, 3], RISE, ROUND, 5)
    turns = np.arctan2(wi[:, 1], wi[:, 0]) % (2 * np.pi)
    assert_follows(
        histogram(wi[:, 2], turns, RISE, ROUND),
        chosen,
        SAMPLES,
        mass=min(chosen.sum(), 1.0),  # what lacks of 1 are samples that fail
        within=1e-3,
        finds=FINDS,
        tests=len(SPREAD),
    )
    mean = np.mean([s.weight[0] for s in samples])
    assert mean == pytest.approx(reflected.sum(), rel=0.03)


def test_the_table_of_a_rough_coat_is_what_its_facets_let_through():
    """Sampled normals of the simple renderer integrate what the reader's table holds."""
    plastic, _ = both({"type": "roughplastic", "alpha": 0.3, "int_ior": 1.7})
    facets = Microfacets(0.3, 0.3, beckmann=True)
    x, weight = np.polynomial.legendre.leggauss(32)
    nodes = list(zip((x + 1) / 2, weight / 2, strict=True))
    for entry in (10, 40, 63):
        mu = entry / 63
        wo = np.array([np.sqrt(1 - mu * mu), 0.0, mu])
        passed = 0.0
        for (u, a), (v, b) in itertools.product(nodes, nodes):
            m = facets.sample(wo, u, v)
            wi = refracted_by(wo, m, plastic.eta)
            if wi[2] < 0.0:
                share = 1.0 - reflectance_of_glass(float(wo @ m), plastic.eta)
                passed += a * b * share * facets.unshadowed(wi, m)
        assert plastic.transmitted(mu) == pytest.approx(passed, abs=2e-5)


def refracted_by(wo, m, eta):
    """Snell's law with angles, in the plane of wo and m."""
    cosine = float(wo @ m)
    across = wo - cosine * m
    length = np.linalg.norm(across)
    sine = length / eta
    tangent = across / length if length > 0.0 else across
    return -sine * tangent - np.sqrt(1.0 - sine**2) * m
