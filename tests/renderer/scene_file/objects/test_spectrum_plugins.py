"""Spectra that are plugins: regular, irregular, blackbody, and d65 with a colour."""

import numpy as np
import pytest
from scene_file_samples import error_of, ours, parameter, theirs
from scene_xml import props, tag

from renderer.scene_file.colors.colors import planck

STEFAN_BOLTZMANN = 5.670374419e-8  # [W / (m^2 K^4)]
WIEN = 2.897771955e6  # [nm K]

DIFFUSE = '<shape type="sphere"><bsdf type="diffuse">{}</bsdf></shape>'
LAMP = '<shape type="sphere"><emitter type="area">{}</emitter></shape>'
IRREGULAR = """<spectrum type="irregular" name="{}">
<string name="wavelengths" value="400, 450 700"/>
<string name="values" value="{}"/></spectrum>"""
REGULAR = """<spectrum type="regular" name="{}"><float name="wavelength_min" value="400"/>
<float name="wavelength_max" value="700"/><string name="values" value="{}"/></spectrum>"""
BLACKBODY = """<spectrum type="blackbody" name="radiance">
<float name="temperature" value="{}"/>{}</spectrum>"""


def reflectance(content):
    return ours(DIFFUSE.format(content)).shapes[0].bsdf.reflectance.rgb


def radiance(content):
    return ours(LAMP.format(content)).shapes[0].radiance


@pytest.mark.parametrize(
    ("of", "name"), [(reflectance, "reflectance"), (radiance, "radiance")]
)
def test_lists_of_all_forms_are_the_same_colour(of, name):
    """Which the list in one attribute has; Mitsuba's conversion of it has a test."""
    listed = f'<spectrum name="{name}" value="400:0.2, 450:0.5, 700:0.3"/>'
    assert of(IRREGULAR.format(name, "0.2 0.5, 0.3")) == of(listed)
    listed = f'<spectrum name="{name}" value="400:0.2, 500:0.5, 600:0.4, 700:0.3"/>'
    assert of(REGULAR.format(name, "0.2 0.5 0.4 0.3")) == of(listed)


@pytest.mark.parametrize("temperature", [300.0, 1000.0, 5778.0, 20000.0])
def test_a_black_body_radiates_by_the_laws_of_stefan_boltzmann_and_wien(temperature):
    wavelengths = np.geomspace(0.01, 1000.0, 20001) * WIEN / temperature
    values = planck(temperature, wavelengths)
    power = np.pi * np.trapezoid(values, wavelengths)
    assert power == pytest.approx(STEFAN_BOLTZMANN * temperature**4, rel=1e-5)
    brightest = wavelengths[np.argmax(values)]
    assert brightest == pytest.approx(WIEN / temperature, rel=1e-3)


def test_a_black_body_has_the_colour_that_mitsubas_spectral_variant_shows():
    """15310, 12093, 9627 by 20,000 samples of scalar_spectral at 5000 K.

    Its sum over 1000 wavelengths is 0.1 % brighter, and their noise another 0.2 %.
    """
    shown = radiance(BLACKBODY.format(5000, ""))
    assert shown == pytest.approx((15310.0, 12093.0, 9627.0), rel=5e-3)


def test_a_black_body_can_be_cut_to_a_band():
    """As scalar_spectral shows it: 3566, 12467 and a blue outside of sRGB."""
    band = "".join(
        f'<float name="wavelength_{end}" value="{at}"/>'
        for end, at in (("min", 500), ("max", 600))
    )
    described = ours(LAMP.format(BLACKBODY.format(5000, band)))
    red, green, blue = described.shapes[0].radiance
    assert (red, green) == pytest.approx((3566.0, 12467.0), rel=0.02)
    assert blue == 0.0
    assert "clamped" in described.warnings[0]


def test_d65_with_a_colour_is_that_colour_as_in_mitsuba():
    content = LAMP.format(
        '<spectrum type="d65" name="radiance"><float name="scale" value="2"/>'
        '<rgb name="color" value="0.5, 2, 7"/></spectrum>'
    )
    mine = ours(content).shapes[0].radiance
    scene = theirs(content)
    np.testing.assert_allclose(
        mine, parameter(scene, next(k for k in _keys(scene) if "radiance" in k)), rtol=1e-6
    )


RAW = '<texture type="rawconstant" name="{}">{}</texture>'
VECTOR = tag("vector", value="0.5, 0.25, 1")


@pytest.mark.parametrize("value", [VECTOR, props(value=0.4)])
def test_rawconstant_is_its_numbers_as_in_mitsuba(value):
    bsdf = f'<bsdf type="diffuse">{RAW.format("reflectance", value)}</bsdf>'
    content = f'<shape type="sphere">{bsdf}</shape>'
    mine = ours(content).shapes[0].bsdf.reflectance.rgb
    scene = theirs(content)
    keys = [key for key in _keys(scene) if "reflectance" in key]
    assert len(keys) == 1
    np.testing.assert_allclose(
        mine, np.broadcast_to(parameter(scene, keys[0]), 3), rtol=1e-6
    )


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("alpha", VECTOR, "found a value of type vector, expected a float, or a vector"),
        ("specular_reflectance", "", "found nothing, expected a float"),
        ("alpha", props(value=1), "a value of type integer"),
    ],
)
def test_a_rawconstant_without_a_usable_value(name, value, words):
    bsdf = f'<bsdf type="roughconductor">{RAW.format(name, value)}</bsdf>'
    assert words in error_of(f'<shape type="sphere">{bsdf}</shape>')


def _keys(scene):
    import mitsuba as mi

    return [key for key, _ in mi.traverse(scene)]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            DIFFUSE.format(REGULAR.format("reflectance", "1")),
            "found 1 numbers, expected at",
        ),
        (
            DIFFUSE.format(IRREGULAR.format("reflectance", "1 2")),
            "found 2 numbers for 3 wavelengths, expected one for each",
        ),
        (
            DIFFUSE.format(IRREGULAR.format("reflectance", "1 2 1")).replace("400", "500"),
            "the wavelengths 500 and 450 of a spectrum do not ascend",
        ),
        (DIFFUSE.format(IRREGULAR.format("reflectance", "1 x 1")), 'is "x"; expected a'),
        (
            DIFFUSE.format(REGULAR.format("reflectance", "1 1")).replace("700", "400"),
            "a range from 400 to 400, expected one above wavelength_min",
        ),
        (
            DIFFUSE.format(REGULAR.format("reflectance", "1 1")).replace("_max", "_last"),
            'property "wavelength_max": found nothing, expected a wavelength in nm',
        ),
        (LAMP.format(BLACKBODY.format(-3, "")), "found -3, expected above 0"),
        (
            LAMP.format('<spectrum type="blackbody" name="radiance"/>'),
            'property "temperature": found nothing, expected a temperature in Kelvin',
        ),
        (
            DIFFUSE.format(BLACKBODY.format(3000, "").replace("radiance", "reflectance")),
            "is no reflectance",
        ),
        (LAMP.format(BLACKBODY.format(3000, props(scale=2.0))), 'has no property "scale"'),
    ],
)
def test_spectra_that_are_wrong(content, message):
    assert message in error_of(content)
