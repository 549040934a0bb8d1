"""BSDFs: Mitsuba's defaults and values, and one error for each fault."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest
from scene_file_samples import error_of, mitsuba_refuses, ours, parameter, theirs
from scene_xml import props, tag

from renderer.scene_file.colors.named_materials import INDICES
from renderer.scene_file.description import WHITE, Bsdf, Conductor, Dielectric, Diffuse

SHAPE = '<shape type="sphere">\n<bsdf type="{}">{}</bsdf></shape>'


def both(plugin: str, content: str = "") -> tuple[Bsdf, object]:
    text = SHAPE.format(plugin, content)
    return ours(text).shapes[0].bsdf, theirs(text).shapes()[0].bsdf()


def test_defaults_are_those_of_mitsuba() -> None:
    mine, reference = both("diffuse")
    assert mine.reflectance.rgb == tuple(parameter(reference, "reflectance.value"))
    mine, reference = both("dielectric")
    assert mine.eta == pytest.approx(mi.traverse(reference)["eta"], rel=1e-6)
    assert mine.eta == pytest.approx(Dielectric().eta)
    assert mine.specular_reflectance == mine.specular_transmittance == WHITE
    mine, reference = both("conductor")
    for name in ("eta", "k", "specular_reflectance"):
        assert getattr(mine, name).rgb == tuple(parameter(reference, f"{name}.value"))


@pytest.mark.parametrize("name", [*INDICES, "Water", "FUSED QUARTZ"])
def test_named_indices_are_those_of_mitsuba(name: str) -> None:
    mine, reference = both("dielectric", f'<string name="int_ior" value="{name}"/>')
    assert mine.eta == pytest.approx(mi.traverse(reference)["eta"], rel=1e-6)


def test_indices_as_numbers_and_colours_of_glass() -> None:
    content = (
        tag("rgb", specular_reflectance="0.5 0.25 1")
        + tag("spectrum", specular_transmittance="0.125")
        + props(int_ior=1.2, ext_ior=1.6)
    )
    mine, reference = both("dielectric", content)
    assert mine.eta == pytest.approx(mi.traverse(reference)["eta"], rel=1e-6)
    for name in ("specular_reflectance", "specular_transmittance"):
        assert getattr(mine, name).rgb == tuple(parameter(reference, f"{name}.value"))


def test_every_colour_takes_a_texture() -> None:
    """Of unbounded ones a checkerboard may be above 1, of reflectances not."""
    board = (
        '<texture name="{}" type="checkerboard"><float name="color0" value="{}"/></texture>'
    )
    for plugin, name, white in (
        ("conductor", "eta", 2.5),
        ("conductor", "k", 2.5),
        ("conductor", "specular_reflectance", 1.0),
        ("dielectric", "specular_reflectance", 1.0),
        ("dielectric", "specular_transmittance", 1.0),
    ):
        mine, reference = both(plugin, board.format(name, white))
        assert getattr(mine, name).color0.rgb == (white,) * 3
        assert (parameter(reference, f"{name}.color0.value") == white).all()
    for plugin, name in (
        ("diffuse", "reflectance"),
        ("dielectric", "specular_reflectance"),
    ):
        found = error_of(SHAPE.format(plugin, board.format(name, 2.5)))
        assert 'property "color0": found the colour (2.5, 2.5, 2.5)' in found
    found = error_of(SHAPE.format("dielectric", board.format("int_ior", 1.5)))
    assert 'property "int_ior": found a value of type texture, expected a float' in found


@pytest.mark.parametrize(
    "content",
    [
        '<rgb name="eta" value="0.2 0.3 0.4"/><rgb name="k" value="2 3 4"/>',
        '<float name="eta" value="0.5"/><spectrum name="k" value="3"/>',
        tag("rgb", k="2"),
        tag("spectrum", eta="400:1.5 700:1.4") + tag("spectrum", k="360:2 830:3"),
        tag("rgb", specular_reflectance=".5 1 0") + props(material="none"),
    ],
)
def test_conductor_colours_are_those_of_mitsuba(content: str) -> None:
    mine, reference = both("conductor", content)
    for name in ("eta", "k", "specular_reflectance"):
        expected = parameter(reference, f"{name}.value")
        np.testing.assert_allclose(getattr(mine, name).rgb, expected, rtol=1e-5)


def test_twosided_has_one_bsdf_for_both_sides_or_two() -> None:
    one = ours(SHAPE.format("twosided", '<bsdf type="diffuse"/>')).shapes[0].bsdf
    assert one.front is one.back
    two, reference = both(
        "twosided", '<bsdf type="diffuse" name="z"/><bsdf type="conductor"/>'
    )
    assert isinstance(two.front, Diffuse)
    assert isinstance(two.back, Conductor)
    assert "brdf_0.reflectance.value" in mi.traverse(reference).keys()


# -------------------------------------------------------------------- errors


@pytest.mark.parametrize(
    ("plugin", "content", "message"),
    [
        ("velvet", "", "supported bsdf plugins: diffuse, conductor, dielectric, roughc"),
        ("sphere", "", 'bsdf "sphere" is not supported; supported bsdf plugins: diffuse'),
        ("twosided", "", "holds 0 bsdfs; expected one for both sides"),
        ("twosided", '<bsdf type="diffuse"/>' * 3, "holds 3 bsdfs"),
        (
            "twosided",
            '<bsdf type="dielectric"/>',
            'bsdf "dielectric" cannot be inside of twos',
        ),
        ("dielectric", props(int_ior="foo"), "a float or one of vacuum, heli"),
        ("dielectric", props(int_ior=2), "a value of type integer"),
        ("dielectric", props(int_ior=-1.0), "expected an index of refraction ab"),
        ("dielectric", props(eta=1.0), 'has no property "eta"; supported: int_'),
        ("dielectric", tag("rgb", specular_reflectance="2"), "a reflectance in [0, 1]"),
        ("conductor", props(material="au"), '"au", expected one of none, Ag'),
        (
            "conductor",
            tag("rgb", k="1") + props(material="Au"),
            'property "k": found a value together with "material", expected one of the two',
        ),
        (
            "diffuse",
            '<texture type="checkerboard"/>',
            "has no <texture>; supported: reflectance",
        ),
    ],
)
def test_bsdfs_that_are_wrong(plugin: str, content: str, message: str) -> None:
    text = SHAPE.format(plugin, content)
    assert error_of(text).startswith("<string>:3: ")
    assert message in error_of(text)
    if plugin != "velvet":
        assert mitsuba_refuses(text)


@pytest.mark.parametrize(
    ("plugin", "content", "message"),
    [
        ("dielectric", props(int_ior=0.0), "an index of refraction above 0"),
        ("conductor", tag("rgb", eta="-2e9"), "an index of refraction from -1e9 to 1e9"),
    ],
)
def test_bsdfs_that_only_we_refuse(plugin: str, content: str, message: str) -> None:
    """No physics in these, or no kernels for them."""
    assert message in error_of(SHAPE.format(plugin, content))


def test_negative_indices_of_metals_are_taken_and_told() -> None:
    """Converters write them for colours outside of sRGB; the equations square them."""
    content = '<rgb name="{}" value="-0.05 4.1 4.7"/><rgb name="{}" value="0.02 0.09 1.3"/>'
    for names in (("eta", "k"), ("k", "eta")):
        mine, reference = both("roughconductor", content.format(*names))
        assert getattr(mine, names[0]).rgb == (-0.05, 4.1, 4.7)
        assert parameter(reference, f"{names[0]}.value") == pytest.approx((-0.05, 4.1, 4.7))
        (warning,) = ours(SHAPE.format("conductor", content.format(*names))).warnings
        assert warning == (
            f'<string>:3: bsdf "conductor", property "{names[0]}": (-0.05, 4.1, 4.7) is '
            "below 0; Fresnel's equations take its square, as in Mitsuba"
        )


def test_index_too_large_through_a_twosided_reference_names_its_own_line() -> None:
    content = (
        '<bsdf type="conductor" id="m">\n<rgb name="k" value="-1e10"/></bsdf>\n'
        '<shape type="sphere"><bsdf type="twosided"><ref id="m"/></bsdf></shape>'
    )
    assert error_of(content).startswith('<string>:3: bsdf "conductor", property "k"')
