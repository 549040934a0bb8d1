"""Every BSDF against Mitsuba's own object, number by number, and against itself.

`SETS` is the one table: a row is a dictionary of parameters, and each test here goes
through all of them, or through those for which it makes sense. A new BSDF adds rows.
"""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from bsdf_probes import BsdfProbe, MitsubaProbe, albedo, random_directions, seen_under
from chi_square import assert_follows, gauss_masses, histogram
from scene_file_samples import mi

from mitsuba_ref.reference.plugins.merl import register_merl
from renderer.plugins.bsdfs.kind import SMOOTH
from renderer.replay.directions import AsMitsuba

register_merl(mi)
GOLD = {"type": "roughconductor", "material": "Au"}
GLASS = {"type": "roughdielectric", "int_ior": 1.5, "ext_ior": 1.0}
ALL = {"sample_visible": False}
GGX = {"distribution": "ggx"}
ALONG_V = {"alpha_u": 0.05, "alpha_v": 0.4}


def rgb(*value: float) -> dict[str, Any]:
    return {"type": "rgb", "value": list(value)}


RED, PALE = rgb(0.7, 0.2, 0.1), rgb(0.9, 0.95, 0.8)
PLASTIC = {"type": "plastic", "diffuse_reflectance": RED}
ROUGH = {"type": "roughplastic", "diffuse_reflectance": RED}
PLUGINS = Path(__file__).parents[2] / "plugins"
KNOBS = {"type": "principled", "base_color": RED, "roughness": 0.35}
SETS: dict[str, dict[str, Any]] = {
    "roughconductor": {"type": "roughconductor"},
    "roughconductor gold": GOLD | {"alpha": 0.3, "specular_reflectance": PALE},
    "roughconductor ggx": GOLD | GGX | {"alpha": 0.3},
    "roughconductor eta k": {"type": "roughconductor", "alpha": 1.2, **GGX}
    | {"eta": rgb(-0.2, 0.9, 1.1), "k": rgb(3.9, 2.4, -2.1)},
    "roughconductor ggx uv": GOLD | GGX | ALONG_V,
    "roughconductor uv": GOLD | ALONG_V,
    "roughconductor all": GOLD | ALL | {"alpha": 0.3},
    "roughconductor all ggx uv": GOLD | GGX | ALL | ALONG_V,
    "roughconductor all uv": GOLD | ALL | ALONG_V,
    "roughdielectric": {"type": "roughdielectric"},
    "roughdielectric ggx": GLASS | GGX | {"alpha": 0.4},
    "roughdielectric uv": GLASS | ALONG_V | {"specular_transmittance": RED},
    "roughdielectric thin": GLASS | {"alpha": 0.5, "int_ior": "air", "ext_ior": "diamond"},
    "roughdielectric all": GLASS | ALL | {"alpha": 0.3, "specular_reflectance": PALE},
    "roughdielectric all ggx uv": GLASS | GGX | ALL | ALONG_V,
    "plastic": {"type": "plastic"},
    "plastic nonlinear": PLASTIC | {"nonlinear": True, "int_ior": "diamond"},
    "plastic pale": PLASTIC | {"specular_reflectance": PALE, "int_ior": 1.9},
    "plastic thin": PLASTIC | {"int_ior": 1.0, "ext_ior": 1.4},
    "plastic mirror": PLASTIC | {"diffuse_reflectance": 0.0},
    "plastic no mirror": PLASTIC | {"specular_reflectance": 0.0},
    "roughplastic": {"type": "roughplastic"},
    "roughplastic nonlinear": ROUGH | GGX | {"nonlinear": True, "alpha": 0.3},
    "roughplastic all": ROUGH | ALL | {"alpha": 0.5, "specular_reflectance": PALE},
    "roughplastic all ggx": ROUGH | GGX | ALL | {"alpha": 0.2, "int_ior": 1.9},
    "roughplastic thin": ROUGH | {"int_ior": 1.0, "ext_ior": 1.4, "alpha": 0.3},
    "pplastic": {"type": "pplastic"},
    "pplastic all ggx": {"type": "pplastic", "diffuse_reflectance": RED, "eta": 1.9}
    | GGX
    | ALL
    | {"alpha": 0.4},
    "pplastic uv": {"type": "pplastic", "specular_reflectance": PALE} | ALONG_V,
    "hair": {"type": "hair"},
    "hair rough": {"type": "hair", "longitudinal_roughness": 0.8, "int_ior": 1.3}
    | {"azimuthal_roughness": 0.7, "sigma_a": rgb(0.1, 0.5, 2.0), "scale": 0.4}
    | {"scale_tilt": 15.0},
    "hair smooth": {"type": "hair", "longitudinal_roughness": 0.2, "eumelanin": 0.1}
    | {"azimuthal_roughness": 0.25, "ext_ior": "water", "scale_tilt": -5.0},
    "principled": {"type": "principled"},
    "principled metal": KNOBS | {"metallic": 0.7, "anisotropic": 0.8},
    "principled cloth": KNOBS | {"sheen": 0.8, "sheen_tint": 0.6, "flatness": 0.5},
    "principled coat": KNOBS | {"clearcoat": 1.0, "clearcoat_gloss": 0.3, "spec_tint": 0.7},
    "principled rates": KNOBS
    | {"clearcoat": 0.6, "metallic": 0.2, "specular": 0.9, "roughness": 0.15}
    | {"main_specular_sampling_rate": 0.4, "diffuse_reflectance_sampling_rate": 2.0},
    "principled glass": KNOBS | {"spec_trans": 0.5, "eta": 1.33},
    "principled glass all": KNOBS
    | {"spec_trans": 0.6, "metallic": 0.2, "clearcoat": 0.7, "spec_tint": 0.5}
    | {"sheen": 0.3, "anisotropic": 0.4, "flatness": 0.2, "clearcoat_gloss": 0.8},
    "principled glass alone": KNOBS | {"spec_trans": 1.0, "roughness": 0.5},
    "principledthin": {"type": "principledthin"},
    "principledthin all": KNOBS
    | {"type": "principledthin", "spec_trans": 0.5, "diff_trans": 1.2, "eta": 1.4}
    | {"sheen": 0.5, "sheen_tint": 1.0, "flatness": 0.5, "spec_tint": 0.4}
    | {"anisotropic": 0.5, "specular_transmittance_sampling_rate": 1.5},
    "measured": {"type": "measured", "filename": str(PLUGINS / "copper_rgb.bsdf")},
}


_OURS: dict[str, BsdfProbe] = {}


def ours(name: str) -> BsdfProbe:
    if name not in _OURS:
        _OURS[name] = BsdfProbe(SETS[name])
    return _OURS[name]


def rng_of(name: str) -> Any:
    return np.random.default_rng(zlib.crc32(name.encode()))


def sets(*, without: tuple[str, ...] = ()) -> Any:
    names = [n for n in SETS if not any(word in n for word in without)]
    return pytest.mark.parametrize("name", names)


# --------------------------------------------------------------- against Mitsuba's object

PAIRS = 2048


class Limits(NamedTuple):
    """Of relative differences; of values below a thousandth, in thousandths."""

    usual: float  # of 99 %
    largest: float


# sample divides by what eval multiplies with, and its normals have rounded slopes
EVAL, SAMPLE = Limits(2e-5, 3e-3), Limits(1e-4, 4e-2)
DIRECTION = Limits(2e-6, 1e-3)
# in nearly even tables Mitsuba subtracts roots of nearly equal numbers
WARPED = Limits(5e-5, 1e-3)
# the azimuth is that of a logistic distribution: a logarithm of what is left of a number
LOGISTIC = Limits(3e-5, 3e-2)


def assert_close(ours: Any, theirs: Any, limits: Limits) -> None:
    error = np.abs(ours - theirs) / (np.abs(theirs) + 1e-3)
    assert np.quantile(error, 0.99) < limits.usual
    assert error.max() < limits.largest


@sets()
def test_eval_and_pdf(name):
    """Both sides, one in ten near the horizon, half of the wi near a sampled one."""
    rng, mine, theirs = rng_of(name), ours(name), MitsubaProbe(SETS[name])
    wo = random_directions(PAIRS, rng, both_sides=mine.kind.transmits)
    wi = random_directions(PAIRS, rng, both_sides=True)
    sampled = mine.sample(wo, rng.random((PAIRS, 3)))
    near = sampled.wi + 0.02 * rng.standard_normal((PAIRS, 3))
    half = (sampled.lobe == SMOOTH) & (sampled.pdf > 0.0) & (np.arange(PAIRS) % 2 == 0)
    wi[half] = near[half] / np.linalg.norm(near[half], axis=1, keepdims=True)
    f_cos, pdf = mine.eval_pdf(wo, wi)
    their_f_cos, their_pdf = theirs.eval_pdf(wo, wi)
    assert_close(f_cos, their_f_cos, EVAL)
    assert_close(pdf, their_pdf, EVAL)


@sets()
def test_sample(name):
    """The same numbers choose the same lobe, direction, weight, density and eta."""
    rng, theirs = rng_of(name), MitsubaProbe(SETS[name])
    mine = BsdfProbe(SETS[name], arithmetic=AsMitsuba(1e-4))
    wo = random_directions(PAIRS, rng, both_sides=mine.kind.transmits)
    numbers = rng.random((PAIRS, 3)).astype(np.float32)
    a, b = mine.sample(wo, numbers), theirs.sample(wo, numbers)
    alive = (b.weight > 0.0).any(axis=1)
    # a hair's breadth decides: of 2048, two may fall on the other side
    assert np.count_nonzero(alive != (a.weight > 0.0).any(axis=1)) <= 2
    alive &= (a.weight > 0.0).any(axis=1) & (np.sign(a.wi[:, 2]) == np.sign(b.wi[:, 2]))
    assert np.count_nonzero(alive) > PAIRS // 2
    assert_close(a.weight[alive], b.weight[alive], SAMPLE)
    assert_close(a.pdf[alive], b.pdf[alive], SAMPLE)
    np.testing.assert_array_equal(a.lobe[alive], b.lobe[alive])
    np.testing.assert_allclose(a.eta[alive], b.eta[alive], rtol=3e-7)
    away = np.abs(a.wi - b.wi)[alive]
    limits = {"hair": LOGISTIC, "measured": WARPED}.get(mine.kind.name, DIRECTION)
    assert np.quantile(away, 0.99) < limits.usual and away.max() < limits.largest


# ----------------------------------------------------------------- sample against its pdf

SAMPLES, FINDS = 1 << 16, 0.25
COSINES = np.linspace(-1.0, 1.0, 25)
TURN = np.linspace(0.0, 2.0 * np.pi, 33)


def directions(cosine: Any, azimuth: Any) -> Any:
    sine = np.sqrt(1.0 - cosine * cosine)
    return np.stack((sine * np.cos(azimuth), sine * np.sin(azimuth), cosine), axis=1)


SEEN = [20, 70]  # [deg]; glass from above and from below


def counted(name: str, degrees: float) -> Any:
    """Return samples in the cells of a sphere, those of all smooth lobes, and masses."""
    probe = ours(name)
    wo = seen_under(degrees, below=probe.kind.transmits and degrees > 45)
    out = probe.sample(wo, rng_of(name).random((SAMPLES, 3), np.float32))
    # what a sample states on the wrong side of the surface or of a facet does not count
    there = out.weight.max(axis=1) if probe.kind.transmits else out.wi[:, 2]
    smooth = (out.lobe == SMOOTH) & (out.pdf > 0.0) & (there > 0.0)
    wi = out.wi[smooth]
    cosine, azimuth = np.clip(wi[:, 2], -1, 1), np.arctan2(wi[:, 1], wi[:, 0]) % (2 * np.pi)
    rows = COSINES if probe.kind.transmits else COSINES[12:]
    masses = gauss_masses(
        lambda c, a: probe.eval_pdf(wo, directions(c, a))[1], rows, TURN, 20
    )
    return histogram(cosine, azimuth, rows, TURN), np.count_nonzero(smooth), masses


@pytest.mark.parametrize("degrees", SEEN)
@sets(without=("mirror",))
def test_directions_follow_the_density(name, degrees):
    """A chi-square test over the sphere, of the smooth lobes; the others are one cell.

    A false alarm rate of 1e-5 each; a density tilted by 25 % from end to end is found with
    a power of 99 %. With 20 nodes along a cell the narrowest lobe keeps its mass to 2e-3.
    """
    counts, smooth, masses = counted(name, degrees)
    mass = masses.sum()
    assert mass < 1.0 + 2e-3
    assert mass == pytest.approx(smooth / SAMPLES, abs=5e-3)
    if ours(name).kind.name == "hair":  # Mitsuba's I0 is up to 0.6 % too small
        masses, mass = masses / mass, 1.0
    if mass > 0.0:  # else all is mirrored
        assert_follows(counts, masses, SAMPLES, finds=FINDS, mass=mass, stray=20)


# --------------------------------------------------------------------------------- energy

ANGLES = (0.0, 30.0, 60.0, 85.0)  # [deg]
OTHERS = {
    "diffuse": {"type": "diffuse", "reflectance": RED},
    "conductor": {"type": "conductor", "material": "Au"},
    "dielectric": {"type": "dielectric", "specular_transmittance": PALE},
    "merl": {"type": "merl", "filename": str(PLUGINS / "small.binary")},
    "polarizer": {"type": "polarizer", "theta": 30.0, "transmittance": PALE},
    "circular": {"type": "circular"},
}
WHITE = rgb(1.0, 1.0, 1.0)
NO_METAL = {"type": "roughconductor", "material": "none"}
# what absorbs nothing by its parameters
LOSSLESS: dict[str, dict[str, Any]] = {
    "white diffuse": {"type": "diffuse", "reflectance": WHITE},
    "perfect mirror": {"type": "conductor", "material": "none"},
    "clear glass": {"type": "dielectric"},
    "clear pane": {"type": "thindielectric"},
    "wave plate": {"type": "retarder"},
    "white hair": {"type": "hair", "eumelanin": 0.0, "pheomelanin": 0.0},
    "rough mirror 0.1": NO_METAL,
    "rough mirror 0.5": NO_METAL | {"alpha": 0.5},
    "rough mirror 1 ggx": NO_METAL | GGX | {"alpha": 1.0},
    "rough glass 0.1": GLASS,
    "rough glass 0.5": GLASS | {"alpha": 0.5},
    "white plastic": {"type": "plastic", "diffuse_reflectance": WHITE},
    "white plastic nonlinear": {"type": "plastic", "diffuse_reflectance": WHITE}
    | {"nonlinear": True},
    "white roughplastic 0.3": {"type": "roughplastic", "diffuse_reflectance": WHITE}
    | {"alpha": 0.3},
    "white principled": {"type": "principled", "base_color": WHITE},
    "white principled metal": {"type": "principled", "base_color": WHITE, "metallic": 1.0},
    "white principled glass": {"type": "principled", "base_color": WHITE}
    | {"spec_trans": 1.0, "eta": 1.5},
}
CONSERVING = tuple(LOSSLESS)[:6]
BY_ALBEDO = LOSSLESS | OTHERS | {"measured": SETS["measured"]}


def albedos(bsdf: dict[str, Any], n: int) -> Any:
    """Return ours and Mitsuba's, (2 sides, angles, 3) each, by n^2 even samples."""
    pair = BsdfProbe(bsdf), MitsubaProbe(bsdf)
    sides = (False, True) if pair[0].kind.transmits else (False,)
    return [
        np.array(
            [[albedo(p, seen_under(a, below=below), n) for a in ANGLES] for below in sides]
        )
        for p in pair
    ]


@pytest.mark.parametrize("name", BY_ALBEDO)
def test_the_albedo_is_mitsubas(name):
    """To 1e-3 at each angle; microfacets make no light, but for what the grid rounds.

    The principled BSDF does: its diffuse part and its mirrors know nothing of each other.
    """
    ours, theirs = albedos(BY_ALBEDO[name], 8)
    np.testing.assert_allclose(ours, theirs, atol=1e-3)
    if name in CONSERVING:
        np.testing.assert_allclose(ours, 1.0, atol=1e-5)
    elif name.startswith("rough "):
        assert ours.max() < 1.0 + 5e-3


# ---------------------------------------------------------------------------- reciprocity


@sets(without=("principledthin all", "hair", "measured"))
def test_light_finds_its_way_back(name):
    """f(wo, wi) / n_i^2 is symmetric, n_i the index of refraction on the side of wi.

    Of Mitsuba's thin sheets it is not: a facet that passes light on tests the side of wi
    alone, which leaves out other pairs one way than the other. Nor is hair: how much passes
    a fibre goes by the angle of wo alone. Tables are interpolated over
    wo and over half vectors in different ways.
    """
    rng, probe = rng_of(name), ours(name)
    wo, wi = (random_directions(2048, rng, both_sides=True) for _ in range(2))
    if not probe.kind.transmits:
        wo[:, 2], wi[:, 2] = np.abs(wo[:, 2]), np.abs(wi[:, 2])
    eta = getattr(probe.description, "eta", 1.0)
    thick = probe.kind.transmits and "thin" not in probe.kind.name
    inside = np.float64(eta if thick else 1.0)
    there, back = probe.eval_pdf(wo, wi)[0], probe.eval_pdf(wi, wo)[0]
    index_i, index_o = (np.where(w[:, 2] > 0, 1.0, inside) for w in (wi, wo))
    a = there / (np.abs(wi[:, 2]) / index_i**2)[:, None]
    b = back / (np.abs(wo[:, 2]) / index_o**2)[:, None]
    clear = np.minimum(np.abs(wo[:, 2]), np.abs(wi[:, 2])) > 0.05
    np.testing.assert_allclose(a[clear], b[clear], rtol=2e-3, atol=1e-3)


# --------------------------------------------------------------------------------- tables


def test_several_tables_in_one_scene():
    """Each rough plastic looks up its own, whatever others there are next to it."""
    names = [name for name in SETS if name.startswith("roughplastic")]
    others = tuple(SETS[n] for n in names)
    wo = random_directions(256, np.random.default_rng(1), both_sides=False)
    wi = random_directions(256, np.random.default_rng(2), both_sides=False)
    for name in names:
        beside = BsdfProbe(SETS[name], earlier=others)
        for a, b in zip(beside.eval_pdf(wo, wi), ours(name).eval_pdf(wo, wi), strict=True):
            np.testing.assert_array_equal(a, b)
