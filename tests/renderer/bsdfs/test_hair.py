"""The BSDF `hair`: numbers from Mitsuba, energy, and the lobe that Mitsuba misplaces."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from bsdf_probes import BsdfProbe, MitsubaProbe, random_directions
from chi_square import gauss_masses
from scene_file_samples import error_of, mitsuba_refuses, ours
from scene_xml import props

from renderer.plugins.bsdfs.registry import kind_of
from renderer.scene_file.description import CheckerboardTexture

DEFAULT = {"type": "hair"}
WHITE = DEFAULT | {"eumelanin": 0.0, "pheomelanin": 0.0}
WO = [[0.6, 0.0, 0.8]]
GRAZING = [[0.59, 0.8, np.sqrt(1.0 - 0.59**2 - 0.8**2)]]
SINES, AZIMUTHS = np.linspace(-1.0, 1.0, 9), np.linspace(0.0, 2.0 * np.pi, 9)


def around_the_fibre(sine: Any, azimuth: Any) -> Any:
    """Return directions of a sine of theta and an azimuth."""
    across = np.sqrt(1.0 - sine**2)
    return np.stack((across * np.cos(azimuth), sine, across * np.sin(azimuth)), axis=1)


def light_by_sine(probe: Any, wo: Any) -> Any:
    """Return the integrals of f |cos| (green) over each range of the sine."""

    def f(sine: Any, azimuth: Any) -> Any:
        return probe.eval_pdf(wo, around_the_fibre(sine, azimuth))[0][:, 1]

    return gauss_masses(f, SINES, AZIMUTHS, 24).sum(axis=1)


@pytest.mark.parametrize(
    ("u", "wi", "pdf", "weight"),
    [
        (0.05, (-0.455518, -0.292231, 0.840895), 0.214721, (0.224446, 0.224405, 0.2244)),
        (0.5, (-0.212902, -0.215319, -0.953053), 1.91229, (0.402493, 0.191081, 0.029954)),
        (0.9, (0.080976, -0.215319, -0.973181), 0.870658, (0.402496, 0.19108, 0.029954)),
    ],
)
def test_samples_of_the_defaults(u, wi, pdf, weight):
    found = BsdfProbe(DEFAULT).sample(WO, [[0.3, 0.6, u]])
    np.testing.assert_allclose(found.wi[0], wi, atol=3e-6)
    np.testing.assert_allclose(found.pdf[0], pdf, rtol=1e-5)
    np.testing.assert_allclose(found.weight[0], weight, rtol=1e-5)


def test_f_and_density_of_the_defaults():
    f, pdf = BsdfProbe(DEFAULT).eval_pdf(WO, [[-0.48, 0.64, 0.6]])
    np.testing.assert_allclose(f[0], (0.018093, 0.0180873, 0.0180866), rtol=1e-5)
    np.testing.assert_allclose(pdf[0], 0.0806032, rtol=1e-5)


@pytest.mark.parametrize("roughness", [0.15, 0.3, 0.5, 1.0])
def test_hair_without_pigment_keeps_all_light(roughness):
    """From all sides, but for the error of I0: 11 terms of a series, then an expansion."""
    probe = BsdfProbe(WHITE | {"longitudinal_roughness": roughness})
    for wo in random_directions(6, np.random.default_rng(1), both_sides=True):
        total = light_by_sine(probe, [wo]).sum()
        assert -6e-3 < total - 1.0 < 1e-4


def test_roughness_zero_is_black_as_in_mitsuba():
    wo, wi = random_directions(200, np.random.default_rng(2), both_sides=True).reshape(
        2, 100, 3
    )
    for name in ("longitudinal_roughness", "azimuthal_roughness"):
        bsdf = DEFAULT | {name: 0.0}
        for probe in (BsdfProbe(bsdf), MitsubaProbe(bsdf)):
            f, pdf = probe.eval_pdf(wo, wi)
            assert not f.any() and not pdf.any()
            sampled = probe.sample(wo, np.full((100, 3), 0.4))
            assert not sampled.weight.any() and not sampled.pdf.any()


def test_samples_of_the_last_lobe_are_not_all_across_the_fibre():
    """The mean by sine of theta is the integral of f; Mitsuba's is not.

    White hair that is seen along its fibre: 14 % of the samples are in the last lobe.
    """
    numbers = np.random.default_rng(3).random((1 << 15, 3), np.float32)
    right = light_by_sine(BsdfProbe(WHITE), GRAZING)

    def sampled(probe: Any, n: int) -> Any:
        found = probe.sample(GRAZING, numbers[:n])
        weights = found.weight[:, 1] / n
        return np.histogram(found.wi[:, 1], SINES, weights=weights)[0]

    np.testing.assert_allclose(sampled(BsdfProbe(WHITE), 1 << 15), right, atol=0.012)
    theirs = sampled(MitsubaProbe(WHITE), 1 << 13)
    assert theirs[SINES[:-1] == 0.0] > right[SINES[:-1] == 0.0] + 0.1


# --------------------------------------------------------------------------------- reader

SHAPE = '<shape type="sphere">\n<bsdf type="hair">{}</bsdf></shape>'
RGB = '<rgb name="sigma_a" value="{}"/>'


def read(content: str = "") -> Any:
    return ours(SHAPE.format(content)).shapes[0].bsdf


def test_properties_that_a_file_is_silent_about():
    hair = read()
    assert hair.eta == pytest.approx(1.55 / 1.000277)
    np.testing.assert_allclose(hair.sigma_a.rgb, (0.5821, 0.9861, 1.991))
    assert (hair.scale, hair.sin_tilt) == (1.0, pytest.approx(np.sin(np.radians(2.0))))
    assert hair.variance == pytest.approx((0.726 * 0.3 + 0.812 * 0.09) ** 2, rel=1e-6)
    assert kind_of(hair).transmits


def test_the_scale_is_that_of_the_absorption_alone():
    scale = '<float name="scale" value="3"/>'
    assert read(scale).scale == 1.0
    assert read(scale + RGB.format("1, 2, 3")).scale == 3.0
    assert read(scale + RGB.format("1, 2, 3")).sigma_a.rgb == (1.0, 2.0, 3.0)
    texture = '<texture name="sigma_a" type="checkerboard"/>'
    assert isinstance(read(texture).sigma_a, CheckerboardTexture)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (props(longitudinal_roughness=1.1), "longitudinal_roughness"),
        (props(longitudinal_roughness=-0.1), "longitudinal_roughness"),
        (props(azimuthal_roughness=2.0), "azimuthal_roughness"),
        (props(int_ior=1.5, ext_ior=1.5), "1.5 on both sides"),
        (props(eumelanin=1.0) + RGB.format("1, 1, 1"), 'together with "sigma_a"'),
        (props(roughness=0.3), "roughness"),
        ('<string name="int_ior" value="keratin"/>', "keratin"),
        (
            '<texture name="longitudinal_roughness" type="checkerboard"/>',
            "longitudinal_roughness",
        ),
    ],
)
def test_mistakes_are_refused_as_in_mitsuba(content, words):
    text = SHAPE.format(content)
    assert words in error_of(text)
    mitsuba_refuses(text)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (props(eumelanin=-1.0), "eumelanin"),
        (props(scale=-1.0) + RGB.format("1, 1, 1"), "scale"),
        (RGB.format("0.1, -2, 0"), "-2"),
    ],
)
def test_hair_that_would_emit_is_refused(content, words):
    """Mitsuba takes negative absorption, and makes light of it."""
    assert words in error_of(SHAPE.format(content))


def test_it_cannot_be_twosided():
    text = SHAPE.format("").replace("<bsdf", '<bsdf type="twosided"><bsdf')
    text = text.replace("</bsdf>", "</bsdf></bsdf>")
    assert "light goes through it" in error_of(text)
    mitsuba_refuses(text)
