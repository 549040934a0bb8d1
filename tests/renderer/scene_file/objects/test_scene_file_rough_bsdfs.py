"""Rough surfaces and plastics: Mitsuba's defaults, values and checks."""

from __future__ import annotations

import numpy as np
import pytest
from bsdf_probes import BsdfProbe, MitsubaProbe, seen_under
from scene_file_samples import error_of, mitsuba_refuses, ours, theirs
from scene_xml import props, tag

from renderer.plugins.bsdfs.rough_transmittance import rough_transmittance
from renderer.scene_file.description import Bsdf, CheckerboardTexture, ConstantTexture

SHAPE = '<shape type="sphere">\n<bsdf type="{}">{}</bsdf></shape>'
ROUGH = ("roughconductor", "roughdielectric", "roughplastic")


def read(plugin: str, content: str = "") -> Bsdf:
    return ours(SHAPE.format(plugin, content)).shapes[0].bsdf


@pytest.mark.parametrize("plugin", ROUGH)
def test_roughness_that_a_file_is_silent_about(plugin: str) -> None:
    bsdf = read(plugin)
    assert (bsdf.alpha_u, bsdf.alpha_v) == pytest.approx((0.1, 0.1))
    assert (bsdf.beckmann, bsdf.every_normal) == (1.0, 0.0)
    assert bsdf.specular_reflectance == ConstantTexture((1.0, 1.0, 1.0))


def test_indices_that_a_file_is_silent_about() -> None:
    for plugin, eta in (
        ("roughdielectric", 1.5046),
        ("plastic", 1.49),
        ("roughplastic", 1.49),
    ):
        assert read(plugin).eta == pytest.approx(eta / 1.000277)
    metal = read("roughconductor")
    assert (metal.eta.rgb, metal.k.rgb) == ((0.0,) * 3, (1.0,) * 3)
    plastic = read("plastic")
    assert plastic.diffuse_reflectance.rgb == (0.5,) * 3
    assert (plastic.nonlinear, plastic.specular_share) == (0.0, pytest.approx(2 / 3))


@pytest.mark.parametrize("name", ["ggx", "GGX", "Beckmann", "beckmann"])
def test_distributions_are_known_in_any_case(name: str) -> None:
    content = f'<string name="distribution" value="{name}"/>'
    assert read("roughconductor", content).beckmann == (name.lower() == "beckmann")
    theirs(SHAPE.format("roughconductor", content))


def test_two_alphas() -> None:
    content = '<float name="alpha_u" value="0.2"/><float name="alpha_v" value="{}"/>'
    bsdf = read("roughconductor", content.format(0.3))
    assert (bsdf.alpha_u, bsdf.alpha_v) == pytest.approx((0.2, 0.3))
    bsdf = read("roughplastic", content.format(0.2))
    assert (bsdf.alpha_u, bsdf.alpha_v) == (0.2, 0.2)


@pytest.mark.parametrize("alpha", [0.0, -1.0, 1e-5, 1e-4])
def test_a_roughness_of_nothing_is_taken_as_a_ten_thousandth(alpha: float) -> None:
    """As by Mitsuba: read as it is, the same table, and in the kernels the same lobe."""
    given = {"type": "roughconductor", "distribution": "ggx", "alpha": alpha}
    mine, reference = BsdfProbe(given), MitsubaProbe(given)
    wo, numbers = seen_under(30), np.array([[0.3, 0.6, 0.5]])
    a, b = mine.sample(wo, numbers), reference.sample(wo, numbers)
    np.testing.assert_allclose(a.wi, b.wi, atol=1e-6)
    np.testing.assert_allclose(a.pdf, b.pdf, rtol=1e-2)
    table, _ = rough_transmittance(False, alpha, 1.5)
    np.testing.assert_array_equal(table, rough_transmittance(False, 1e-4, 1.5)[0])


def test_a_roughness_may_be_a_colour_or_a_texture() -> None:
    """Of a colour the mean counts; the table of rough plastic knows one number alone."""
    metal = read("roughconductor", tag("rgb", alpha="0.1 0.2 0.6"))
    assert (metal.alpha_u, metal.alpha_v) == (pytest.approx(0.3), pytest.approx(0.3))
    board = '<texture name="alpha_u" type="checkerboard"/>'
    glass = read("roughdielectric", board + props(alpha_v=0.3))
    assert isinstance(glass.alpha_u, CheckerboardTexture)
    assert glass.alpha_v == pytest.approx(0.3)
    text = SHAPE.format("roughplastic", board.replace("alpha_u", "alpha"))
    assert 'property "alpha": found a value of type texture' in error_of(text)
    assert mitsuba_refuses(text)


# -------------------------------------------------------------------- errors

ALPHA = '<float name="{}" value="0.2"/>'


@pytest.mark.parametrize(
    ("plugin", "content", "message"),
    [
        (
            "roughconductor",
            props(distribution="phong"),
            'property "distribution": found "phong", expected one of beckmann, ggx',
        ),
        (
            "roughconductor",
            ALPHA.format("alpha_u"),
            'property "alpha_u": found this one alone, expected both alpha_u and alpha_v',
        ),
        (
            "roughdielectric",
            "".join(map(ALPHA.format, ("alpha", "alpha_u", "alpha_v"))),
            'property "alpha_u": found a value together with "alpha", expected one of',
        ),
        (
            "roughplastic",
            props(alpha_u=0.2, alpha_v=0.3),
            'property "alpha_u": found 0.2 together with alpha_v 0.3, expected the same',
        ),
        (
            "roughplastic",
            tag("rgb", alpha="0.5"),
            'property "alpha": found a value of type rgb, expected float',
        ),
        (
            "roughconductor",
            props(material="gold"),
            'property "material": found "gold", expected one of none, Ag',
        ),
        (
            "roughconductor",
            '<string name="material" value="Au"/><rgb name="eta" value="1"/>',
            'property "eta": found a value together with "material"',
        ),
        (
            "roughdielectric",
            props(int_ior=1.5, ext_ior=1.5),
            'property "int_ior": found 1.5 on both sides, expected two different indices',
        ),
        (
            "pplastic",
            props(eta=1.5, int_ior=1.5),
            'property "int_ior": found a value together with "eta"',
        ),
        (
            "roughplastic",
            props(ext_ior="polypropylene"),
            'property "ext_ior": found 1.49 on both sides',
        ),
        (
            "plastic",
            props(int_ior="jelly"),
            'property "int_ior": found "jelly", expected a float or one of vacuum',
        ),
        ("plastic", props(int_ior=-1.0), "expected an index of refraction above 0"),
        (
            "plastic",
            ALPHA.format("alpha"),
            'has no property "alpha"; supported: int_ior, ext_ior',
        ),
        (
            "roughplastic",
            props(nonlinear="yes"),
            'property "nonlinear": found a value of type string, expected boolean',
        ),
        (
            "plastic",
            tag("rgb", diffuse_reflectance="2"),
            "expected a reflectance in [0, 1]",
        ),
    ],
)
def test_rough_bsdfs_that_are_wrong(plugin: str, content: str, message: str) -> None:
    text = SHAPE.format(plugin, content)
    assert error_of(text).startswith("<string>:3: ")
    assert message in error_of(text)
    assert mitsuba_refuses(text)


@pytest.mark.parametrize("plugin", ["roughdielectric", "plastic", "roughplastic"])
def test_an_index_of_nothing_is_refused_by_us_alone(plugin: str) -> None:
    """Mitsuba divides by it, and shows NaN."""
    content = props(int_ior=0.0)
    assert "an index of refraction above 0" in error_of(SHAPE.format(plugin, content))


@pytest.mark.parametrize(
    ("content", "found"),
    [
        (props(eta=-1.5), "-1.5"),
        (props(eta=0.0), "0"),
        ('<texture type="checkerboard" name="eta"/>', "a texture"),
    ],
)
def test_an_eta_that_gives_infinite_light_is_refused_by_us_alone(content, found) -> None:
    """Of textures too: a texel may be anything."""
    expected = f'property "eta": found {found}, expected a number from 1e-09 to 1e+09'
    assert expected in error_of(SHAPE.format("pplastic", content))


def test_rough_glass_cannot_be_inside_of_twosided() -> None:
    text = SHAPE.format("twosided", '<bsdf type="roughdielectric"/>')
    assert 'bsdf "roughdielectric" cannot be inside of twosided' in error_of(text)
    assert mitsuba_refuses(text)
