"""BSDFs inside of BSDFs: number by number as Mitsuba's, by chi-square, and bad input.

tests/plugins/{null,mask,blendbsdf,normalmap,bumpmap,nesting}.xml take Mitsuba's paths.
"""

from __future__ import annotations

import importlib
import pkgutil

import numpy as np
import pytest
from bsdf_probes import (
    BsdfProbe,
    MitsubaProbe,
    frames_along,
    random_directions,
    seen_under,
)
from chi_square import assert_follows, gauss_masses, histogram
from scene_file_samples import error_of, mitsuba_refuses, ours
from scene_xml import props, tag
from small_scenes import floor, pixels, rectangle, scene, sensor, sphere

import renderer
from renderer.errors import SceneError
from renderer.plugins import bsdfs
from renderer.plugins.bsdfs.kind import SMOOTH, BsdfKind
from renderer.plugins.bsdfs.registry import kind_of
from renderer.rendering.planning.make_plan import make_plan
from renderer.simple import path_tracer


def rgb(*value):
    return {"type": "rgb", "value": list(value)}


def mask(opacity, bsdf):
    return {"type": "mask", "opacity": opacity, "nested": bsdf}


def blend(weight, first, second):
    return {"type": "blendbsdf", "weight": weight, "a": first, "b": second}


def mapped(normal, bsdf, **switches):
    return {"type": "normalmap", "normalmap": rgb(*normal), "nested": bsdf} | switches


RED = {"type": "diffuse", "reflectance": rgb(0.7, 0.2, 0.1)}
PLASTIC = {"type": "plastic"}
GLASS = {"type": "dielectric"}
GOLD = {"type": "conductor", "material": "Au"}
ROUGH = {"type": "roughconductor", "alpha_u": 0.2, "alpha_v": 0.5}
SLANTED = (0.7, 0.4, 0.9)
SETS = {
    "null": {"type": "null"},
    "thindielectric": {"type": "thindielectric", "int_ior": "diamond"},
    "mask of a coat": mask(0.3, PLASTIC),
    "mask of glass": mask(0.6, GLASS),
    # straight on, but glass and no hole
    "mask of matched glass": mask(0.6, GLASS | {"int_ior": 1.3, "ext_ior": 1.3}),
    "blend": blend(0.3, PLASTIC, ROUGH),
    "blend with a mirror": blend(0.6, GOLD, RED),
    "blend with glass": blend(0.4, GLASS, mask(0.5, RED)),
    "one for both": {"type": "twosided", "a": blend(0.5, RED, GOLD)},
    "one for each": {"type": "twosided", "a": mapped(SLANTED, RED), "b": ROUGH},
    "normals": mapped(SLANTED, ROUGH),
    "normals as they are": mapped((0.9, 0.4, 0.6), RED, flip_invalid_normals=False),
    "normals without shadows": mapped(SLANTED, GLASS, use_shadowing_function=False),
    "four deep": mask(0.8, mapped(SLANTED, mask(0.9, blend(0.5, RED, {"type": "null"})))),
}
PAIRS = 1024
CAMERA = sensor((0, -3, 1), (0, 0, 0))


def rng_of(name):
    return np.random.default_rng(len(name))


@pytest.fixture(scope="module")
def probes():
    return {name: BsdfProbe(bsdf) for name, bsdf in SETS.items()}


def assert_close(mine, theirs, usual, largest):
    error = np.abs(mine - theirs) / (np.abs(theirs) + 1e-3)
    assert np.quantile(error, 0.99) < usual and error.max() < largest


@pytest.mark.parametrize("name", SETS)
def test_the_same_numbers_as_mitsuba(name, probes):
    """Of both sides; the limits are those of the BSDFs by themselves."""
    rng, mine, theirs = rng_of(name), probes[name], MitsubaProbe(SETS[name])
    wo = random_directions(PAIRS, rng, both_sides=True)
    wi = random_directions(PAIRS, rng, both_sides=True)
    if mine.kind.smooth:
        for a, b in zip(mine.eval_pdf(wo, wi), theirs.eval_pdf(wo, wi), strict=True):
            assert_close(a, b, 2e-5, 3e-3)
    numbers = rng.random((PAIRS, 3)).astype(np.float32)
    a, b = mine.sample(wo, numbers), theirs.sample(wo, numbers)
    alive, theirs_alive = ((s.weight > 0.0).any(axis=1) for s in (a, b))
    assert np.count_nonzero(alive != theirs_alive) <= 1
    alive &= theirs_alive & (np.sign(a.wi[:, 2]) == np.sign(b.wi[:, 2]))
    assert np.count_nonzero(alive) > PAIRS // 4
    assert_close(a.weight[alive], b.weight[alive], 1e-4, 2e-2)
    assert_close(a.pdf[alive], b.pdf[alive], 1e-4, 2e-2)
    np.testing.assert_array_equal(a.lobe[alive], b.lobe[alive])
    np.testing.assert_allclose(a.eta[alive], b.eta[alive], rtol=3e-7)
    assert np.abs(a.wi - b.wi)[alive].max() < 1e-4


COSINES, TURN = np.linspace(-1.0, 1.0, 25), np.linspace(0.0, 2.0 * np.pi, 33)


@pytest.mark.parametrize("name", ["blend", "normals as they are", "four deep"])
def test_directions_follow_the_density(name, probes):
    """A chi-square test of 2^16 directions over the sphere, of the smooth lobes.

    A false alarm rate of 1e-5 each; a density tilted by 25 % from end to end is found with
    a power of 99 %.
    """
    probe, wo = probes[name], seen_under(30)
    out = probe.sample(wo, rng_of(name).random((1 << 16, 3), np.float32))
    smooth = (out.lobe == SMOOTH) & (out.pdf > 0.0) & (out.weight.max(axis=1) > 0.0)
    wi = out.wi[smooth]

    def density(cosine, azimuth):
        sine = np.sqrt(1.0 - cosine * cosine)
        there = np.stack((sine * np.cos(azimuth), sine * np.sin(azimuth), cosine), axis=1)
        return probe.eval_pdf(wo, there)[1]

    masses = gauss_masses(density, COSINES, TURN, 20)
    azimuth = np.arctan2(wi[:, 1], wi[:, 0]) % (2 * np.pi)
    counts = histogram(np.clip(wi[:, 2], -1, 1), azimuth, COSINES, TURN)
    assert masses.sum() == pytest.approx(len(wi) / (1 << 16), abs=5e-3)
    assert_follows(counts, masses, 1 << 16, finds=0.25, mass=masses.sum(), stray=20)


def test_a_normal_without_length_reflects_nothing():
    probe = BsdfProbe(mapped((0.5, 0.5, 0.5), ROUGH))
    wo = random_directions(64, rng_of("none"), both_sides=True)
    out = probe.sample(wo, np.full((64, 3), 0.4))
    f_cos, pdf = probe.eval_pdf(wo, wo)
    assert not out.weight.any() and not f_cos.any() and not pdf.any()


# ----------------------------------------------------------------------------- structures


def bsdf_of(bsdf):
    content = {"type": "scene", "camera": CAMERA, "shape": {"type": "sphere", "b": bsdf}}
    return renderer.load_dict(content).description.shapes[0].bsdf


def test_what_samples_a_nested_bsdf_belongs_to_one_kind():
    """A kernel that two kinds share is recursive where these stand in each other.

    Then Numba leaves its symbol unresolved if an inner one is not compiled first.
    """
    nested, registered, found = {"sample_nested", "eval_pdf_nested"}, set(), set()
    for each in pkgutil.iter_modules(bsdfs.__path__, f"{bsdfs.__name__}."):
        for value in vars(importlib.import_module(each.name)).values():
            if isinstance(value, BsdfKind):
                registered |= {value.sample, value.eval_pdf}
            code = getattr(getattr(value, "py_func", None), "__code__", None)
            if code is not None and nested & set(code.co_names):
                found.add(value)
    assert len(found) >= 10 and found <= registered


def test_a_structure_is_named_as_a_function():
    four = kind_of(bsdf_of(SETS["four deep"]))
    assert four.name == "mask(normalmap(mask(blendbsdf(diffuse, null))))"
    assert (four.smooth, four.delta, four.transmits) == (True, True, True)
    assert [name for name, _, _ in four.layout()][-2:] == [
        "nested.nested.nested.weight",
        "nested.nested.nested.first.reflectance",
    ]
    both = kind_of(bsdf_of(SETS["one for both"]))
    assert (both.name, both.transmits) == ("twosided(blendbsdf(diffuse, conductor))", False)


@pytest.mark.parametrize("ghost", [mask(0.0, RED), {"type": "null"}], ids=["mask", "null"])
def test_light_goes_straight_through(ghost):
    """A ball that is not there: the light behind, from both of its sides, unchanged."""
    lamp = rectangle((0, 0, -2), (0.1, 0, 0), (0, 0.1, 0), RED, shine=(3.0, 2.0, 1.0))
    camera = sensor((0, 0.05, 3), (0, 0.05, 0), up=(0, 1, 0))
    content = scene(camera, "path", lamp, sphere(ghost), max_depth=3)
    np.testing.assert_allclose(pixels(content, spp=4)[0, 0], (3.0, 2.0, 1.0), rtol=1e-6)
    content["integrator"]["max_depth"] = 2  # each side costs a segment
    assert not pixels(content, spp=4).any()


# ------------------------------------------------------------------------------ bad input

SHAPE = '<shape type="sphere">\n<bsdf type="{}">{}</bsdf></shape>'
ONE = '<bsdf type="diffuse"/>'
BOARD = '<texture type="checkerboard" name="{}"/>'


@pytest.mark.parametrize(
    ("plugin", "content", "message"),
    [
        ("mask", "", 'bsdf "mask" holds 0 bsdfs; expected one'),
        ("mask", ONE * 2, 'bsdf "mask" holds 2 bsdfs; expected one'),
        ("mask", ONE + BOARD.format("opaque"), 'has no property "opaque"'),
        ("blendbsdf", props(weight=0.0) + ONE, "holds 1 bsdfs; expected two"),
        ("normalmap", tag("rgb", normalmap="2") + ONE, "found the colour (2, 2, 2)"),
        ("bumpmap", ONE, "holds 0 textures; expected one"),
        ("bumpmap", ONE + BOARD.format("a") + BOARD.format("b"), "holds 2 textures"),
        ("twosided", '<bsdf type="null"/>', 'bsdf "null" cannot be inside of twosided'),
        ("twosided", f'<bsdf type="mask">{ONE}</bsdf>', 'bsdf "mask" cannot be inside'),
        ("null", ONE, 'bsdf "null" has no <bsdf>'),
        ("thindielectric", props(eta=1.0), 'has no property "eta"'),
    ],
)
def test_nestings_that_are_wrong(plugin, content, message):
    text = SHAPE.format(plugin, content)
    assert error_of(text).startswith("<string>:3: ")
    assert message in error_of(text)
    assert mitsuba_refuses(text)


@pytest.mark.parametrize(
    ("plugin", "content", "name"),
    [("blendbsdf", ONE * 2, "weight"), ("normalmap", ONE, "normalmap")],
)
def test_a_texture_that_is_not_there(plugin, content, name):
    """Mitsuba 3.9.1 is not run: most times it refuses these, some times it crashes.

    Each of four processes that loaded one of them over and over died within 3000 loads,
    and once the suite saw it load one; with a texture, 27,000 wrong nestings did neither.
    """
    message = error_of(SHAPE.format(plugin, content))
    assert message.startswith("<string>:3: ")
    assert f'property "{name}": found nothing' in message


@pytest.mark.parametrize(
    ("plugin", "content", "message"),
    [
        ("normalmap", BOARD.format("normalmap") + ONE, "found a texture without normals"),
        ("bumpmap", BOARD.format("a") + ONE, "found a texture without a slope"),
        ("mask", '<bsdf type="mask">' * 8 + ONE + "</bsdf>" * 8, "nests more than 8 bsdfs"),
    ],
)
def test_nestings_that_mitsuba_refuses_later_or_never(plugin, content, message):
    assert message in error_of(SHAPE.format(plugin, content))


def test_an_opacity_may_be_any_number():
    text = props(opacity=-3.5) + ONE
    assert ours(SHAPE.format("mask", text)).shapes[0].bsdf.opacity == -3.5


def test_trees_of_rays_refuse_holes():
    content = scene(CAMERA, "whitted", floor(), sphere(mask(0.5, GLASS)))
    with pytest.raises(SceneError, match=r"no branches for the bsdf mask\(dielectric\)"):
        make_plan(renderer.load_dict(content), integrator="whitted")


def test_turned_normals_are_shown():
    """A plate that faces the camera; Mitsuba's own `aov` says the same, to 1e-6."""
    tilted = rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), bsdf=mapped((0.6, 0.5, 0.9), RED))
    content = scene(
        sensor((0, 0, 3), (0, 0, 0), up=(0, 1, 0)), "aov", tilted, aovs="n:sh_normal"
    )
    normal = renderer.render(renderer.load_dict(content), spp=1).aovs["n"]
    middle = normal[normal.shape[0] // 2, normal.shape[1] // 2]
    np.testing.assert_allclose(middle, (0.24253538, 0.0, 0.97014153), atol=1e-6)


@pytest.mark.parametrize("inside", ["diffuse", "roughconductor", "plastic"])
def test_flat_bumps_change_nothing_where_u_runs_along_z(inside):
    """Mitsuba divides by 0 there: docs/mitsuba-faults.md, 34."""
    bumps = {"type": "bumpmap", "h": {"type": "uniform"}, "bsdf": {"type": inside}}
    for along_u in ((0, 0, 1), (0, 0, -1)):
        wall = rectangle((0, 0, 0), along_u, (0, 1, 0), bsdf=bumps)
        view = sensor((-5 * along_u[2], 0, 0.5), (0, 0, 0), size=(4, 4), fov=5.0)
        seen = scene(view, "path", wall, {"type": "constant"})
        plain = scene(view, "path", {**wall, "bsdf": bumps["bsdf"]}, {"type": "constant"})
        shown = [pixels(each, spp=64) for each in (seen, plain)]
        np.testing.assert_allclose(shown[0].mean(), shown[1].mean(), rtol=0.02)
        assert shown[1].mean() > 0.4
        short = path_tracer.render(renderer.load_dict(seen).description, 16)
        np.testing.assert_allclose(short.mean(), shown[1].mean(), rtol=0.1)


def test_axes_of_a_turned_frame_are_at_right_angles():
    """Also where x is nearly along the normal, and what is across it mostly rounding.

    The frame's axes had cosines of up to 0.19 between them.
    """
    rng = np.random.default_rng(3)
    normals = rng.normal(size=(3, 4096))
    normals /= np.linalg.norm(normals, axis=0)
    aside = rng.normal(size=normals.shape) * 10.0 ** rng.uniform(-5, 0, normals.shape[1])
    axes = frames_along(normals, normals + aside)
    between = np.einsum("icn,jcn->ijn", axes, axes)
    np.testing.assert_allclose(between, np.eye(3)[..., None] + 0 * between, atol=1e-6)
